"""A recording at level full, read by Apache Arrow and trimesh, agrees with itself, with the result and with the laws of motion.

Usage: check_recording.py RUN
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import trimesh
from PIL import Image

run = Path(sys.argv[1])
record = run / "record"
about = json.loads((record / "record.json").read_text())
result = json.loads((run / "result.json").read_text())
tables = {path.stem: pq.read_table(path).to_pylist() for path in record.glob("*.parquet")}
assert about["seed"] == result["seed"] and about["scenario"] == result["scenario"]
for name, rows in tables.items():
    assert rows, name
    assert {row["seed"] for row in rows} == {str(result["seed"])}, name

# Candidates: each that was tried is free or ran into something.
for row in tables["plans"]:
    ran_into = sum(row[f"{at}_{what}"] for at in ("blocked", "closing") for what in ("fixtures", "objects", "unmodelled"))
    # The hand itself is never in its own way.
    assert row["tried"] == row["free"] + ran_into, row
    assert row["reached"] >= row["found"] and row["found"] == (row["grasp_x"] is not None) == (not row["stage"]), row

# Attempts: as many as were scored, with their steps in order.
packs = [row for row in tables["attempts"] if row["action"] == "pack"]
assert len(packs) == sum(item["attempts"] for item in result["items"]) == result["score"]["attempts"]
for attempt in tables["attempts"]:
    steps = [row for row in tables["steps"] if row["attempt"] == attempt["attempt"]]
    assert all(a["end_s"] <= b["begin_s"] + 1e-9 for a, b in zip(steps, steps[1:]))
    assert attempt["begin_s"] <= steps[0]["begin_s"] and steps[0]["step"] == "open"

# Samples: 20 a second while the robot moves, and where the plan said.
times = np.array([row["time_s"] for row in tables["samples"]])
gaps = np.diff(times)
assert gaps.min() > 0.05 - 1 / 240 and np.median(gaps) < 0.056, (gaps.min(), np.median(gaps))
joints = [f"q_{name}" for name in about["joints"]]
assert all(name in tables["samples"][0] for name in joints)
followed = 0
for attempt in tables["attempts"]:
    parts = defaultdict(list)
    for row in tables["trajectories"]:
        if row["attempt"] == attempt["attempt"]:
            parts[row["part"]].append(row)
    carry = next(rows for rows in parts.values() if rows[0]["step"] == "carry")
    begin = next(row["begin_s"] for row in tables["steps"] if row["attempt"] == attempt["attempt"] and row["step"] == "carry")
    moving = [name for name in joints if np.isfinite(carry[0][name])]
    assert len(moving) >= 7, moving
    planned_t = [row["time_s"] for row in carry]
    for row in tables["samples"]:
        if row["attempt"] == attempt["attempt"] and row["step"] == "carry":
            for name in moving:
                planned = np.interp(row["time_s"] - begin, planned_t, [r[name] for r in carry])
                off = abs((row[name] - planned + np.pi) % (2 * np.pi) - np.pi)
                assert off < 0.15, (name, row["time_s"], off)
            followed += 1
assert followed > 20

# Poses: what a look calls the truth is where the table of poses has it.
where = defaultdict(list)
for row in tables["poses"]:
    where[(row["kind"], row["name"], row["instance"])].append(row)
for rows in where.values():
    assert all(a["time_s"] <= b["time_s"] for a, b in zip(rows, rows[1:]))
for row in tables["estimates"]:
    before = [p for p in where[("object", row["object"], row["instance"])] if p["time_s"] <= row["time_s"] + 1e-9][-1]
    off = max(abs(before[f"position_{axis}"] - row[f"truth_{axis}"]) for axis in "xyz")
    assert off < 5e-6, (row["object"], off)

# Contacts: what lies still is carried by them. Masses are in scenario.json.
masses = {}
def find(value):
    if isinstance(value, dict):
        if "name" in value and "mass_kg" in value:
            masses[value["name"]] = value["mass_kg"]
        list(map(find, value.values()))
    elif isinstance(value, list):
        list(map(find, value))
find(json.loads((run / "scenario.json").read_text()))
start = tables["estimates"][0]["time_s"]
checked = 0
for item in result["items"]:
    held = [row for row in tables["contacts"] if row["object"] == item["object"] and abs(row["time_s"] - start) < 1e-9]
    if held and item["object"] in masses:
        up = sum(row["force_n_z"] + row["friction_n_z"] for row in held)
        weight = 9.81 * masses[item["object"]]
        assert abs(up / weight - 1) < 0.1, (item["object"], up, weight)
        checked += 1
assert checked == len(result["items"]), (checked, masses)
fingers = [row for row in tables["contacts"] if row["by"] in ("right finger", "left finger")]
assert {row["object"] for row in fingers} == {row["object"] for row in packs}

# The scene: bodies where they were first, y up.
scene = trimesh.load(record / "replay.glb")
names = set(scene.graph.nodes)
turn = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
for (kind, name, instance), rows in where.items():
    node = f"{kind}/{name}" + (f" ({instance})" if instance > 1 else "")
    if node not in names:
        assert kind == "link", node
        continue
    matrix, _ = scene.graph.get(node)
    first = np.array([rows[0][f"position_{axis}"] for axis in "xyz"] + [1.0])
    assert np.allclose(matrix[:, 3], turn @ first, atol=1e-5), node
assert any(name.startswith("estimate/0/") for name in names)
# trimesh has no nodes for lines.
glb = (record / "replay.glb").read_bytes()
gltf = json.loads(glb[20 : 20 + int.from_bytes(glb[12:16], "little")])
lines = [node["name"] for node in gltf["nodes"] if node.get("name", "").startswith("plan/")]
assert lines == [f"plan/{row['attempt']}" for row in tables["attempts"]], lines

camera = about["intrinsics"]
for path in sorted((record / "looks").iterdir()):
    assert Image.open(path).size == (camera["width"], camera["height"]), path
print(f"{len(tables)} tables, {len(where)} bodies, {followed} samples along plans, {checked} weights agree")
