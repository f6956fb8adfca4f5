"""Pose metrics by their definitions, without any code of the project (numpy alone).

    python3 tests/pose_metrics.py FOLDER

FOLDER has table.json, with models, poses, and the errors and recalls that the project finds, and depth.raw, the depth images
they are of (32-bit floats, metres). Exits with 1 if an error or a recall differs by more than a millionth. Other checkers
import the functions.

Metres and pixels; poses are pairs of a 3x3 matrix and a vector, camera from object. ADD and ADD-S: Hinterstoisser 2012. VSD,
MSSD, MSPD and average recall: Hodan et al., "BOP Challenge 2020 on 6D Object Localization".
"""

import json
import sys
from pathlib import Path

import numpy as np

LEVELS = np.linspace(0.05, 0.5, 10)


def moved(points, pose):
    return points @ pose[0].T + pose[1]


def add(points, truth, estimate):
    return np.linalg.norm(moved(points, truth) - moved(points, estimate), axis=1).mean()


def adds(points, truth, estimate):
    a, b = moved(points, truth), moved(points, estimate)
    return np.mean([np.sqrt(((b - p) ** 2).sum(1).min()) for p in a])


def about(axis, angle):
    """Rodrigues' formula."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def symmetries(discrete, continuous):
    """All turns as pairs of matrix and vector: 4x4 matrices, and (axis, point on it) in steps of a hundredth of the diameter."""
    single = [np.eye(4)] + [np.reshape(m, (4, 4)) for m in discrete]
    steps = int(np.ceil(np.pi / 0.01))
    revolved = [np.eye(4)] if not continuous else []
    for axis, point in continuous:
        for i in range(steps):
            turn = np.eye(4)
            turn[:3, :3] = about(axis, 2 * np.pi * i / steps)
            turn[:3, 3] = np.asarray(point) - turn[:3, :3] @ np.asarray(point)
            revolved.append(turn)
    return [(m[:3, :3], m[:3, 3]) for m in (r @ s for s in single for r in revolved)]


def turned(pose, turn):
    return pose[0] @ turn[0], pose[0] @ turn[1] + pose[1]


def projected(points, k):
    seen = points @ k.T
    return seen[:, :2] / seen[:, 2:]


def mssd(points, turns, truth, estimate):
    there = moved(points, estimate)
    return min(np.linalg.norm(moved(points, turned(truth, t)) - there, axis=1).max() for t in turns)


def mspd(points, turns, truth, estimate, k):
    there = projected(moved(points, estimate), k)
    return min(np.linalg.norm(projected(moved(points, turned(truth, t)), k) - there, axis=1).max() for t in turns)


def vsd(measured, truth, estimate, k, diameter):
    """For each tolerance; three whole depth images, 0 where there is nothing."""
    rows, columns = np.indices(measured.shape)
    rays = np.stack([columns, rows, np.ones_like(rows)], -1) @ np.linalg.inv(k).T
    length = np.linalg.norm(rays, axis=-1)
    scene, true, guess = (image.astype(float) * length for image in (measured, truth, estimate))
    hole = measured == 0
    seen_true = (true > 0) & (hole | (true - scene <= 0.015))
    seen_guess = (guess > 0) & (hole | (guess - scene <= 0.015) | seen_true)
    both, union = seen_true & seen_guess, seen_true | seen_guess
    if not union.any():
        return np.ones(10)
    off = np.abs(true - guess)
    return np.array([((off >= tau * diameter) | ~both)[union].mean() for tau in LEVELS])


def matched(errors, level):
    """Instances that an estimate finds; a table of estimates, the surest first, against instances."""
    taken = set()
    for row in errors:
        under = [(e, i) for i, e in enumerate(row) if e < level and i not in taken]
        if under:
            taken.add(min(under)[1])
    return len(taken)


def recalls(tables, instances):
    """Shares of instances found at each level; tables of errors in units in which the levels are thresholds."""
    return np.array([sum(matched(t, level) for t in tables) for level in LEVELS]) / instances


def compare(name, ours, theirs, worst):
    ours, theirs = np.asarray(ours, float), np.asarray(theirs, float)
    off = np.abs(ours - theirs) / np.maximum(1, np.abs(ours))
    worst[name] = max(worst.get(name, 0.0), float(off.max()) if off.size else 0.0)


def main():
    folder = Path(sys.argv[1])
    table = json.loads((folder / "table.json").read_text())
    width, height = table["size"]
    images = np.fromfile(folder / "depth.raw", "<f4").reshape(-1, height, width)
    fx, fy, cx, cy = table["camera"]
    k = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    models = [(np.array(m["points"]), m["diameter"], symmetries(m["discrete"], m["continuous"])) for m in table["models"]]
    pose = lambda numbers: (np.reshape(numbers[:9], (3, 3)), np.array(numbers[9:]))
    worst, pairs, instances = {}, 0, 0
    tables = {"mssd": [], "mspd": [], **{f"vsd{i}": [] for i in range(10)}}
    for target in table["targets"]:
        points, diameter, turns = models[target["model"]]
        measured = images[target["measured"]]
        rows = {name: [] for name in tables}
        for estimate, theirs in zip(target["estimates"], target["errors"], strict=True):
            guess = pose(estimate["pose"])
            row = {name: [] for name in tables}
            for truth, found in zip(target["truths"], theirs, strict=True):
                true = pose(truth["pose"])
                far = mssd(points, turns, true, guess)
                px = mspd(points, turns, true, guess, k)
                shares = vsd(measured, images[truth["depth"]], images[estimate["depth"]], k, diameter)
                compare("add", add(points, true, guess), found["add"], worst)
                compare("adds", adds(points, true, guess), found["adds"], worst)
                compare("mssd", far, found["mssd"], worst)
                compare("mspd", px, found["mspd"], worst)
                compare("vsd", shares, found["vsd"], worst)
                row["mssd"].append(far / diameter)
                row["mspd"].append(px / (100 * width / 640))
                for i in range(10):
                    row[f"vsd{i}"].append(shares[i])
                pairs += 1
            for name in rows:
                rows[name].append(row[name])
        for name in tables:
            tables[name].append(rows[name])
        instances += len(target["truths"])
    found = table["recall"]
    recall = {name: recalls(of_all, instances) for name, of_all in tables.items()}
    of_vsd = np.mean([recall[f"vsd{i}"] for i in range(10)], axis=0)
    compare("recall_mssd", recall["mssd"], found["recall_mssd"], worst)
    compare("recall_mspd", recall["mspd"], found["recall_mspd"], worst)
    compare("recall_vsd", of_vsd, found["recall_vsd"], worst)
    means = [of_vsd.mean(), recall["mssd"].mean(), recall["mspd"].mean()]
    compare("ar", means + [np.mean(means)], [found[name] for name in ("ar_vsd", "ar_mssd", "ar_mspd", "ar")], worst)
    print(f"{pairs} pairs of poses, {instances} instances; AR {np.mean(means):.4f} of {np.round(means, 4)}; largest differences:")
    print(", ".join(f"{name} {off:.1e}" for name, off in worst.items()))
    sys.exit(not (pairs >= 200 and max(worst.values()) <= 1e-6))


if __name__ == "__main__":
    main()
