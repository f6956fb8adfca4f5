"""The model card: what the network was made of, and what it is worth on scenes that training never saw."""

import csv
import json
import os
import subprocess

from crops import CROP, RATIOS, SIDE, STRIDE

PICTURES = {
    "base": "; base light only",
    "varied": "; in every light, in heaps, with things that are no objects, another camera each (`--profile hard`)",
}
VIEWS_SAID = {
    "base": "B is the light of training; dark (D), one flash light (D1, D2) and clutter (O1 to O3) are not in it.",
    "varied": "Cameras and things are those of the standard profile, which is easier than what training showed; it had no dark (D).",
}
VIEWS = ("B", "D", "D1", "D2", "O1", "O2", "O3")


def run_grip(root, arguments, **options):
    """Runs grip, with no scanned objects but those that the arguments name."""
    environment = {key: value for key, value in os.environ.items() if key != "GRIP_YCB_DIR"}
    command = ["cargo", "run", "--release", "--quiet", "--locked", "--", *map(str, arguments)]
    return subprocess.run(command, cwd=root, env=environment, check=True, **options)


def measure(root, folder, model, name, seed, scanned):
    """Makes the adversarial test set of 40 scenes where it is not there yet; returns what `grip detect` says of it."""
    data = folder / name
    scenes = ["scenes", "--resume", "--out", data, "--seed", seed, "--scenes", 40]
    run_grip(root, scenes + (["--ycb", scanned] if scanned else []))
    said = run_grip(root, ["detect", data, "--detector-model", model, "--json"], stdout=subprocess.PIPE)
    return json.loads(said.stdout)


def percent(share):
    return "-" if share is None else f"{100 * share:.1f}"


def table(header, rows):
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def write(path, model, learnt_from, objects, images, crops, seed, curve, measured):
    """Writes the card; `objects` are names and BOP numbers, `images` numbers of training images by data set; `measured` maps a name of a test set to (seed, what `grip detect --json` said)."""
    with curve.open() as file:
        epochs = list(csv.DictReader(file))
    minutes = sum(float(line["seconds"]) for line in epochs) / 60
    out = [
        f"# PyramidCNN, `vgg16-w0.25-{learnt_from}`",
        "",
        "Made by `perception/train/train.py`; this page is written by it. The network is that of the paper (Chen et al. 2019, sections",
        "Object Detection and Implementation) with a quarter of VGG-16's width and without its last two poolings: 13 convolutions,",
        "two fully convolutional heads of two more each, softmax on both. From random weights: no other data than these.",
        "",
        table(
            ["", ""],
            [
                ["input", "`image`, float (1, 3, height, width), RGB in 0 to 1, any size"],
                ["outputs", f"`classes` (1, {1 + len(objects)}, height/{STRIDE}, width/{STRIDE}), background first; `shapes`, {len(RATIOS)} aspect ratios from {RATIOS[0]:g} to {RATIOS[-1]:g}"],
                ["a cell stands for", f"a box with a longer side of about {SIDE:g} pixels about it"],
                ["size", f"{model.stat().st_size / 1e6:.1f} MB"],
                ["training images", "; ".join(f"{name}: {count}" for name, count in images.items()) + PICTURES[learnt_from]],
                ["training", f"{crops} crops of {CROP} x {CROP} pixels, batches of 32, AdamW, one cycle to 3e-3, cross entropy, seed {seed}; {minutes:.0f} minutes on the machine that made this page"],
            ],
        ),
        "",
        "The paper trains on 224 x 224; here the pyramid is half as large, to run on two cores.",
        "",
        "## Scenes that training never saw",
        "",
        "`grip scenes --seed S --scenes 40`, then `grip detect`: boxes of whole silhouettes, per cent, means of the objects.",
        VIEWS_SAID[learnt_from],
        "",
    ]
    for name, (test_seed, said) in measured.items():
        rows = [(f"view {view}", said["views"][view]) for view in VIEWS if view in said["views"]] + [("all", said["all"])]
        rows += [(name, said["objects"][str(identity)]) for name, identity in objects if str(identity) in said["objects"]]
        rows = [(title, figures) for title, figures in rows if figures["instances"]]
        out += [
            f"{name}, seed {test_seed}, {said['images']} images, {1000 * said['latency_s']:.0f} ms an image on two cores ({said['network']}):",
            "",
            table(
                ["", "instances", "AP50", "AP", "recall at 100", "AR at 100", "best box right"],
                [[title, f["instances"], *(percent(f[key]) for key in ("ap50", "ap", "recall50", "ar", "top1"))] for title, f in rows],
            ),
            "",
        ]
    shown = epochs[:: max(1, len(epochs) // 10)] + ([epochs[-1]] if epochs else [])
    out += [
        "## Curve",
        "",
        "Cross entropy per cell that an object has, of training crops and of crops from images that were held out.",
        "",
        table(
            ["crops", "classes", "aspect ratios", "classes, held out", "aspect ratios, held out"],
            [[e["crops"], e["classes"], e["ratios"], e["unseen_classes"], e["unseen_ratios"]] for i, e in enumerate(shown) if i == 0 or e["crops"] != shown[i - 1]["crops"]],
        ),
        "",
    ]
    path.write_text("\n".join(out))
