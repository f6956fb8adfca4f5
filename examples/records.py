"""The success table and the error figures of a report, from recordings alone.

    grip trials --trials 20 --record events --out runs/b && python3 examples/records.py runs/b
"""
import sys
from pathlib import Path

import pandas as pd

KEY, ITEM = ["scene", "condition", "estimator", "grasper"], ["seed", "object", "instance"]
items, attempts, estimates = (
    pd.concat(map(pd.read_parquet, sorted(Path(sys.argv[1]).glob(f"records/*/{name}.parquet"))))
    for name in ("items", "attempts", "estimates"))

cells = items.groupby(KEY).packed.agg(items="size", packed="sum", share="mean")
cells["auc"] = items.groupby(KEY).adds_m.apply(lambda e: (1 - e / 0.04).clip(0).fillna(0).mean())  # Of ADD-S up to 40 mm.
cells["full"] = items.groupby(KEY + ["seed"]).packed.all().groupby(KEY).sum()
print(cells.reset_index().to_csv(index=False))

first = attempts[attempts.action == "pack"].drop_duplicates(KEY + ITEM)
first = first.merge(estimates[~estimates.in_bin], on=KEY + ITEM + ["look"])
first["held"] = first.opposing_contacts & first.lifted_clear & first.held_after_carry & first.slip_within
print(first[KEY + ITEM + ["adds_m", "held"]].sort_values(KEY + ITEM).to_csv(index=False))
