"""ADD and ADD-S of a results file, without any code of the project (numpy alone), against those of `grip eval --errors`.

    python3 tests/check_errors.py DATASET RESULTS.csv ERRORS.csv

The data set must have models_eval and one instance of an object an image. Exits with 1 if an error differs by more than a
nanometre.
"""

import csv
import json
import sys
from pathlib import Path

import numpy as np


def points(path):
    """Vertices of a binary PLY file of floats."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    header = data[:end].decode().split("\n")
    count = next(int(line.split()[2]) for line in header if line.startswith("element vertex"))
    columns = sum(line.startswith("property float") for line in header)
    return np.frombuffer(data, "<f4", count * columns, end).reshape(count, columns)[:, :3].astype(float)


def nearest(a, b):
    """Distance of each point of a to the nearest one of b: found by the matrix of products, then measured exactly."""
    found = np.concatenate([((b ** 2).sum(1) - 2 * part @ b.T).argmin(1) for part in np.array_split(a, 20)])
    return np.linalg.norm(a - b[found], axis=1)


def main():
    root, results, errors = map(Path, sys.argv[1:])
    estimates = {tuple(int(row[k]) for k in ("scene_id", "im_id", "obj_id")): row
                 for row in csv.DictReader(results.open())}
    models, worst, count = {}, 0.0, 0
    for row in csv.DictReader(errors.open()):
        key = scene, image, number = tuple(int(row[k]) for k in ("scene_id", "im_id", "obj_id"))
        if key not in estimates:
            assert row["adds_mm"] == "", row
            continue
        if number not in models:
            models[number] = points(root / "models_eval" / f"obj_{number:06d}.ply")
        p = models[number]
        truths = json.loads((root / f"test/{scene:06d}/scene_gt.json").read_text())[str(image)]
        truth = next(t for t in truths if t["obj_id"] == number)
        true = p @ np.reshape(truth["cam_R_m2c"], (3, 3)).T + truth["cam_t_m2c"]
        estimate = estimates[key]
        numbers = lambda text: np.array([float(x) for x in text.split()])
        guess = p @ numbers(estimate["R"]).reshape(3, 3).T + numbers(estimate["t"])
        middle = true.mean(0)
        add = np.linalg.norm(true - guess, axis=1).mean()
        adds = nearest(true - middle, guess - middle).mean()
        worst = max(worst, abs(add - float(row["add_mm"])), abs(adds - float(row["adds_mm"])))
        count += 1
    print(f"{count} poses, largest difference {worst:.2e} mm")
    sys.exit(not (count > 0 and worst < 1e-6))


main()
