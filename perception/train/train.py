#!/usr/bin/env python3
"""Trains PyramidCNN: makes the scenes, trains, writes the ONNX file with its description, and measures it.

    pip install -r perception/train/requirements.txt
    python perception/train/train.py --out runs/training

makes runs/training/{scenes,test,checkpoint.pt,curve.csv} and pyramid-varied.onnx, .json and .md beside them (--learn-from base:
pyramid-base); copied to perception/models they become a built-in detector. A run that was stopped goes on where it was. Less than
two hours on two cores; a GPU is used where torch finds one. With --ycb (or GRIP_YCB_DIR) it trains on scanned objects, too, as the shipped one did.
"""

import argparse
import csv
import json
import os
import time
from pathlib import Path

import torch
from torch import nn

import card
from crops import CROP, RATIOS, SIDE, STRIDE, Crops, read
from network import Exported, PyramidCNN

ROOT = Path(__file__).resolve().parents[2]
BATCH = 32
# Crops between two lines of the curve, and between two checkpoints.
EPOCH = 4800
# Seeds of the test sets, which nothing was chosen by.
BUILT_IN_TEST, SCANNED_TEST = 911, 912
# By what the network learns from: options of `grip scenes`, scenes seen from anywhere around and views of each, the same from
# the robot's head. `base` is what the paper trains on: base light, spread objects. `varied` has other light, heaps, things
# that are no objects, and another camera for each picture.
LEARNT_FROM = {
    "base": ([], 200, "B,B2=base,B3=base,B4=base", 300, "B"),
    "varied": (["--profile", "hard"], 140, "B,D1,D2,O1,O2,O3", 50, "B,D1,D2,O1,O2,O3"),
}
# Every so many scenes, one is for the curve of unseen images.
HELD_OUT = 20


def make_scenes(out, learnt_from, scanned, share):
    """Data sets from anywhere around and from the robot's head, of built-in objects and, with `scanned`, of scans. Returns their
    folders."""
    folders = []
    every = ",".join(name for name, _ in objects())
    options, around, views_around, head, views_head = LEARNT_FROM[learnt_from]
    for kind, seed, folder in (("builtin", 7001, None), ("scanned", 7002, scanned)):
        if kind == "scanned" and not scanned:
            continue
        for camera, scenes, views, offset in (("sphere", around, views_around, 0), ("head", head, views_head, 2)):
            folders.append(out / f"{kind}-{camera}")
            command = ["scenes", "--resume", "--split", "train", "--out", folders[-1], "--seed", seed + offset, *options]
            command += ["--scenes", max(2, int(scenes * share)), "--objects", every, "--views", views, "--camera", camera]
            card.run_grip(ROOT, command + (["--ycb", folder] if folder else []))
    return folders


def objects():
    """(name, BOP number) of every object of scenes/objects.toml."""
    import tomllib

    table = tomllib.loads((ROOT / "scenes/objects.toml").read_text())
    return [(entry["name"], entry["bop_id"]) for entry in table["objects"]]


def loss(network, batch, device):
    """Cross entropy of the cells' classes and of the objects' aspect ratios, each per cell that an object has."""
    images, classes, shapes = (part.to(device) for part in batch)
    images = images.contiguous(memory_format=torch.channels_last)
    logits, ratios = network(images)
    count = (classes > 0).sum().clamp(min=1)
    by_class = nn.functional.cross_entropy(logits, classes, ignore_index=-1, reduction="sum") / count
    by_ratio = nn.functional.cross_entropy(ratios, shapes, ignore_index=-1, reduction="sum") / count
    return by_class, by_ratio


def train(folders, out, crops, seed):
    """Trains on these data sets and returns the network."""
    device = "cuda" if torch.cuda.is_available() else "cpu"
    torch.manual_seed(seed)
    images = read(folders)
    known = {identity: 1 + i for i, (_, identity) in enumerate(objects())}
    # Whole scenes are held out: their views show the same objects on the same table.
    scenes = sorted({image[0].parent.parent for image in images})
    held = set(scenes[::HELD_OUT])
    unseen = Crops([image for image in images if image[0].parent.parent in held], known, 256, [seed, 1])
    seen = [image for image in images if image[0].parent.parent not in held]
    asked = {"crops": crops, "seed": seed, "images": [str(image[0].relative_to(out)) for image in images]}
    network = PyramidCNN(len(known), len(RATIOS)).to(device, memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(network.parameters(), lr=1e-3, weight_decay=1e-3)
    steps = crops // BATCH
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 3e-3, total_steps=steps, pct_start=0.15)
    done, lines, checkpoint = 0, [], out / "checkpoint.pt"
    if checkpoint.is_file():
        state = torch.load(checkpoint, map_location=device)
        if state["asked"] != asked:
            raise SystemExit(f"{checkpoint}: is of a run with other crops, seed or scenes; remove it, or choose another --out")
        for part, key in ((network, "network"), (optimizer, "optimizer"), (schedule, "schedule")):
            part.load_state_dict(state[key])
        done, lines = state["done"], state["lines"]
    print(f"{len(images)} images, {len(unseen.images)} of them for the curve alone; {done} of {crops} crops are done", flush=True)
    while done < steps * BATCH:
        began, sums = time.time(), [0.0, 0.0]
        length = min(EPOCH, steps * BATCH - done)
        network.train()
        # A stream for each epoch, so that a resumed run draws what an undisturbed one does.
        loader = torch.utils.data.DataLoader(Crops(seen, known, length, [seed, 0, done]), BATCH, num_workers=1)
        for batch in loader:
            parts = loss(network, batch, device)
            optimizer.zero_grad()
            sum(parts).backward()
            nn.utils.clip_grad_norm_(network.parameters(), 10.0)
            optimizer.step()
            schedule.step()
            sums = [total + part.item() * len(batch[0]) / length for total, part in zip(sums, parts)]
        done += length
        network.eval()
        with torch.no_grad():
            batches = list(torch.utils.data.DataLoader(unseen, 64))
            held = [sum(loss(network, batch, device)[i].item() for batch in batches) / len(batches) for i in (0, 1)]
        line = [done, *(round(x, 4) for x in (*sums, *held)), round(time.time() - began, 1)]
        print("crops {}: classes {}, ratios {}; unseen: classes {}, ratios {}; {} s".format(*line), flush=True)
        lines.append(line)
        state = {"network": network.state_dict(), "optimizer": optimizer.state_dict(), "schedule": schedule.state_dict(), "asked": asked, "done": done, "lines": lines}
        torch.save(state, out / "checkpoint.tmp")
        os.replace(out / "checkpoint.tmp", checkpoint)
        with (out / "curve.csv").open("w", newline="") as file:
            csv.writer(file).writerows([["crops", "classes", "ratios", "unseen_classes", "unseen_ratios", "seconds"], *lines])
    return network


def export(network, path, learnt_from, models):
    """An ONNX file at `path` and its description, what `grip --detector-model` takes; `models` is a BOP folder of models."""
    facts = json.loads((models / "models_info.json").read_text())
    model = Exported(network.cpu().to(memory_format=torch.contiguous_format)).eval()
    cells = {2: "rows", 3: "columns"}
    torch.onnx.export(
        model,
        torch.zeros(1, 3, CROP, CROP),
        path,
        input_names=["image"],
        output_names=["classes", "shapes"],
        dynamic_axes={"image": {2: "height", 3: "width"}, "classes": cells, "shapes": cells},
        opset_version=17,
        dynamo=False,
    )
    description = {
        "schema": "grip.detector/1",
        "name": f"vgg16-w0.25-{learnt_from}",
        "objects": [
            {"name": name, "bop_id": identity, "diameter_m": round(facts[str(identity)]["diameter"] / 1000, 4)}
            for name, identity in objects()
        ],
        "aspect_ratios": RATIOS,
        "stride_px": STRIDE,
        "side_px": SIDE,
    }
    path.with_suffix(".json").write_text(json.dumps(description, indent=2) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "runs/training")
    parser.add_argument("--learn-from", choices=LEARNT_FROM, default="varied", help="base: what the paper has; varied: what the world has")
    parser.add_argument("--ycb", default=os.environ.get("GRIP_YCB_DIR"), help="folder of scanned objects, to train on them too")
    parser.add_argument("--crops", type=int, default=96_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenes-share", type=float, default=1.0, help="share of the scenes to make; for a quick try")
    arguments = parser.parse_args()
    arguments.ycb = arguments.ycb and str(Path(arguments.ycb).resolve())
    arguments.out = arguments.out.resolve()
    arguments.out.mkdir(parents=True, exist_ok=True)
    folders = make_scenes(arguments.out / "scenes", arguments.learn_from, arguments.ycb, arguments.scenes_share)
    network = train(folders, arguments.out, arguments.crops, arguments.seed)
    model = arguments.out / f"pyramid-{arguments.learn_from}.onnx"
    export(network, model, arguments.learn_from, folders[0] / "models")
    measured = {"Built-in objects": (BUILT_IN_TEST, None)} | ({"Scanned objects": (SCANNED_TEST, arguments.ycb)} if arguments.ycb else {})
    measured = {
        name: (seed, card.measure(ROOT, arguments.out / "test", model, name.split()[0].lower(), seed, scanned))
        for name, (seed, scanned) in measured.items()
    }
    images = {folder.name: len(read([folder])) for folder in folders}
    card.write(model.with_suffix(".md"), model, arguments.learn_from, objects(), images, arguments.crops, arguments.seed, arguments.out / "curve.csv", measured)
    print(f"wrote {model}, its description (.json) and its page (.md)")


if __name__ == "__main__":
    main()
