"""Campaigns: work that is cut into units, which any process of any machine runs, killed and run again as often as it may be.

    grip.campaign.plan("packing.toml", out="runs/packing")
    grip.campaign.run("runs/packing", shard="1/1")               # here; grip.ray.run does it on many machines
    grip.campaign.merge("runs/packing", out="runs/packing-all")

What the file says and what a merged folder holds is on the page of campaigns. While ``plan`` and ``run`` work, the current folder of the
process is that of the campaign's file, since options are meant from there: other threads should name files by whole paths.
"""

from __future__ import annotations

import json
import logging
from typing import Any, Mapping, Optional, Union

from . import _grip, _run
from .verbs import Path

__all__ = ["TryAgain", "merge", "missing", "plan", "run", "status"]

log = logging.getLogger("grip")


class TryAgain(_grip.Error):
    """A unit could not be run to its end now, and can be another time: the disk is full, or another process runs it."""


def _call(verb: str, options: Mapping[str, Any], progress: Optional[bool] = None) -> tuple[int, str, list[str]]:
    bars = _run.Progress(progress)
    words = {key: value for key, value in options.items() if value is not None}
    try:
        answer = _grip.call(f"campaign {verb}", json.dumps(words, default=_run.plain), None, None, bars if bars.tqdm else None)
    finally:
        bars.close()
    code, data, messages, _ = answer
    for message in messages:
        log.info(message)
    return code, data, messages


def plan(file: Path, *, out: Path) -> dict[str, Any]:
    """Writes what is to be run, cut into units, with hashes of all that it depends on.

    Args:
        file: What is to be run: TOML.
        out: Folder of the campaign: a new one, which all machines see.

    Returns:
        The manifest, which is ``campaign.json`` in the folder.

    Raises:
        Error: When the file, or something that it names, is wrong.
    """
    return json.loads(_call("plan", {"file": file, "out": out, "json": True})[1])


def run(
    folder: Path,
    *,
    unit: Optional[Union[int, str]] = None,
    shard: Optional[str] = None,
    jobs: Optional[int] = None,
    again: bool = False,
    progress: Optional[bool] = None,
) -> bool:
    """Runs units, those that are done excepted. At Ctrl-C what is finished of a unit is kept, and the next run goes on from there.

    Args:
        folder: Folder of the campaign.
        unit: Number of a unit, from 0 on, or numbers and ranges: ``"0-3,7"``. Default: the one that Slurm or Kubernetes says.
        shard: Every N-th unit, beginning with the I-th: ``"I/N"``; ``"1/1"`` is all.
        jobs: Results of a unit made at the same time; they do not depend on it. Default: one a core.
        again: Whether to try units again that could not be done.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Returns:
        Whether all these units are done; False where one cannot be done: :func:`status` says why.

    Raises:
        TryAgain: When a unit can be done another time.
        Error: When the campaign is wrong, such as inputs that are not what they were when it was planned.
    """
    options = {"folder": folder, "unit": None if unit is None else str(unit), "shard": shard, "jobs": jobs, "again": again}
    code, _, messages = _call("run", options, progress)
    if code == 75:
        raise TryAgain("; ".join(messages))
    return code == 0


def status(folder: Path) -> dict[str, Any]:
    """Tells what is done and what is missing.

    Args:
        folder: Folder of the campaign.

    Returns:
        What ``grip campaign status --json`` prints: ``units`` and ``done`` are counts, ``missing`` is numbers and ranges as a text (see
        :func:`missing`), ``failed`` lists units that cannot be done with their ``reason``.

    Raises:
        Error: When there is no campaign, or a unit in it is damaged.
    """
    return json.loads(_call("status", {"folder": folder, "json": True})[1])


def missing(folder: Path) -> list[int]:
    """The numbers of the units that are to be run: not those that cannot be done.

    Args:
        folder: Folder of the campaign.

    Raises:
        Error: As :func:`status`.
    """
    spans = [span.split("-") for span in status(folder)["missing"].split(",") if span]
    return [number for span in spans for number in range(int(span[0]), int(span[-1]) + 1)]


def merge(folder: Path, *, out: Path, progress: Optional[bool] = None) -> dict[str, Any]:
    """Puts all units together to what one undisturbed run would have written.

    Args:
        folder: Folder of the campaign.
        out: Folder of the whole: a new one.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Returns:
        A summary: counts of units and results, and the canaries of the machines.

    Raises:
        Error: When a unit is missing, or is not what it was when it was done; then there is no ``out``.
    """
    return json.loads(_call("merge", {"folder": folder, "out": out, "json": True}, progress)[1])
