"""examples/records.py says of recordings what the report and the results say: exactly.

Usage: check_records.py SCRIPT EXPERIMENT REPORT.html
"""

import csv
import io
import json
import subprocess
import sys
from pathlib import Path

script, experiment, report = map(Path, sys.argv[1:])
assert len([line for line in script.read_text().splitlines() if line.strip()]) <= 27, "a short script"
said = subprocess.run([sys.executable, "-B", script, experiment], check=True, capture_output=True, text=True).stdout
cells, first = (list(csv.DictReader(io.StringIO(text))) for text in said.split("\n\n")[:2])

reported = list(csv.DictReader(report.with_suffix(".trials.csv").open()))
page = report.read_text()
assert len(cells) == len(reported) == 2
for ours, theirs in zip(cells, reported):
    for name in ("scene", "condition", "estimator", "grasper", "items", "packed", "full"):
        assert ours[name] == theirs[name], (name, ours, theirs)
    assert float(ours["share"]) == float(theirs["share"])
    if ours["estimator"] != "truth":
        assert f"{ours['estimator']}: AUC {100 * float(ours['auc']):.1f}" in page, ours

trials = [json.loads(line) for line in (experiment / "trials.jsonl").read_text().splitlines()]
scored = {}
for trial in trials:
    for item in trial["items"]:
        if item["first_attempt"]:
            key = (trial["estimator"], str(trial["seed"]), item["object"], str(item.get("instance", 1)))
            scored[key] = item["first_attempt"]
assert len(first) == len(scored) > 0
for row in first:
    attempt = scored[(row["estimator"], row["seed"], row["object"], row["instance"])]
    assert float(row["adds_m"]) == attempt["adds_m"], (row, attempt)
    assert (row["held"] == "True") == attempt["held"], (row, attempt)
print(f"{len(cells)} cells and {len(first)} first grasps agree")
