"""The table of items, read by Apache Arrow, says what the trials' records say.

Usage: check_items.py EXPERIMENT
"""

import json
import math
import sys
from pathlib import Path

import pyarrow.parquet as pq

folder = Path(sys.argv[1])
rows = pq.read_table(folder / "items.parquet").to_pylist()
trials = [json.loads(line) for line in (folder / "trials.jsonl").read_text().splitlines()]
items = [(trial, item) for trial in trials for item in trial["items"]]
assert len(rows) == len(items) > 0, (len(rows), len(items))
for row, (trial, item) in zip(rows, items):
    for field in ("scene", "condition", "estimator", "grasper", "detector", "object_set", "scenario"):
        assert row[field] == trial[field], (field, row)
    assert int(row["seed"]) == trial["seed"]
    assert row["packed"] == (item["outcome"] == "packed")
    for field in ("object", "reason", "attempts"):
        assert row[field] == item[field], (field, row)
    for field in ("add_m", "adds_m", "slip_m", "peak_force_n", "others_moved_m"):
        same = row[field] == item[field] or (item[field] is not None and math.isclose(row[field], item[field]))
        assert same, (field, row, item)
    for clause, holds in item["clauses"].items():
        assert row[clause] == holds, (clause, row)
print(f"{len(rows)} items agree")
