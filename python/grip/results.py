"""What the verbs return. Tables are pandas data frames, read from the files that the command writes."""

from __future__ import annotations

import base64
import html
import json
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Mapping, Optional

if TYPE_CHECKING:
    import pandas


def _pandas() -> Any:
    try:
        import pandas
    except ImportError as error:
        raise ImportError("tables need pandas: pip install 'grip-sim[tables]'") from error
    return pandas


def _lines(path: Path) -> list[dict[str, Any]]:
    with open(path, encoding="utf-8") as file:
        return [json.loads(line) for line in file if line.strip()]


def _table(rows: Any) -> "pandas.DataFrame":
    """Rows of JSON as a table: what is nested becomes columns such as ``clauses.lifted``."""
    return _pandas().json_normalize(rows)


@dataclass(frozen=True)
class Trial:
    """One trial of packing."""

    result: Mapping[str, Any]
    """The content of result.json."""
    folder: Path
    """The run folder: report.html, summary.png, film.jpg, frames, result.json, scenario.json."""

    @property
    def packed(self) -> int:
        """Items that were packed."""
        return self.result["packed"]

    @property
    def requested(self) -> int:
        """Items that were to be packed."""
        return self.result["requested"]

    @property
    def state_hash(self) -> str:
        """Of the world's last state: equal for equal runs."""
        return self.result["state_hash"]

    @cached_property
    def items(self) -> "pandas.DataFrame":
        """A row an item: outcome, clauses, errors, forces."""
        return _table(self.result["items"])

    @property
    def summary(self) -> Path:
        """A picture: before and after from outside, what the camera saw, its depth, the estimated poses."""
        return self.folder / "summary.png"

    @property
    def film(self) -> Path:
        """A picture of each attempt from outside."""
        return self.folder / "film.jpg"

    def __repr__(self) -> str:
        return f"<grip.Trial: {self.packed} of {self.requested} packed, {self.folder}>"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{html.escape(item['object'])}</td><td>{html.escape(item['outcome'])}</td></tr>" for item in self.result["items"]
        )
        picture = ""
        if self.film.exists():
            data = base64.b64encode(self.film.read_bytes()).decode()
            picture = f'<img style="max-width: 100%" src="data:image/jpeg;base64,{data}">'
        return f"<p>{self.packed} of {self.requested} packed</p><table>{rows}</table>{picture}"


@dataclass(frozen=True)
class Trials:
    """An experiment of many trials."""

    folder: Path
    """The experiment's folder, which ``resume=True`` goes on with."""
    summary: Mapping[str, Any]
    """What ``grip trials --json`` prints."""
    complete: bool
    """Whether every trial has a result: False where objects found no room."""

    @cached_property
    def cells(self) -> "pandas.DataFrame":
        """A row for each scene, condition and estimator: shares with their intervals."""
        return _table(self.summary["cells"])

    @cached_property
    def pairs(self) -> "pandas.DataFrame":
        """A row for each two estimators on the same trials, with McNemar's p."""
        return _table(self.summary["pairs"])

    @cached_property
    def items(self) -> "pandas.DataFrame":
        """A row an item of a trial."""
        return _pandas().read_parquet(self.folder / "items.parquet")

    @cached_property
    def trials(self) -> "pandas.DataFrame":
        """A row a trial."""
        return _table(_lines(self.folder / "trials.jsonl"))

    @cached_property
    def timings(self) -> "pandas.DataFrame":
        """A row a trial: its wall times."""
        return _table(_lines(self.folder / "timings.jsonl"))

    def __repr__(self) -> str:
        return f"<grip.Trials: {self.summary['trials']} trials, {self.folder}>"


@dataclass(frozen=True)
class Sweep:
    """Grasps under known pose errors."""

    folder: Path
    """The sweep's folder, which ``resume=True`` goes on with."""
    summary: Mapping[str, Any]
    """What ``grip sweep --json`` prints."""
    complete: bool
    """Whether every grasp was tried: False where no layout of a seed has one."""

    @cached_property
    def grasps(self) -> "pandas.DataFrame":
        """A row a grasp: its error, and what became of it."""
        return _table(_lines(self.folder / "grasps.jsonl"))

    @cached_property
    def falls(self) -> "pandas.DataFrame":
        """A row for each object, axis and direction: the errors at which a half and nine tenths of the grasps still hold."""
        rows = []
        for result in self.summary["objects"]:
            for axis in result["axes"]:
                for sign, fall in zip((-1, 1), axis["falls"]):
                    rows.append({"object": result["object"], "axis": axis["axis"], "sign": sign, **(fall or {})})
        return _table(rows)

    def __repr__(self) -> str:
        return f"<grip.Sweep: {self.summary['grasps']} grasps, {self.folder}>"


@dataclass(frozen=True)
class DataSet:
    """A data set in BOP's format."""

    folder: Path
    """Its folder."""
    split: str
    """The folder of its scenes in that."""
    summary: Optional[Mapping[str, Any]] = None
    """What ``grip scenes --json`` prints, of one that was just made."""

    @cached_property
    def truth(self) -> "pandas.DataFrame":
        """A row for each object in each image: its pose (``cam_R_m2c``, ``cam_t_m2c`` in millimetres), boxes, share in view."""
        rows = []
        for scene in sorted((self.folder / self.split).iterdir()):
            if not (scene / "scene_gt.json").exists():
                continue
            info = json.loads((scene / "scene_gt_info.json").read_text(encoding="utf-8"))
            for image, objects in json.loads((scene / "scene_gt.json").read_text(encoding="utf-8")).items():
                for k, pose in enumerate(objects):
                    rows.append({"scene_id": int(scene.name), "im_id": int(image), "gt_id": k, **pose, **info[image][k]})
        return _pandas().DataFrame(rows)

    def __repr__(self) -> str:
        return f"<grip.DataSet {self.folder}/{self.split}>"


@dataclass(frozen=True)
class Estimates:
    """Poses that were estimated of a data set."""

    file: Path
    """A results file as the BOP challenge has it."""
    summary: Mapping[str, Any]
    """What ``grip estimate --json`` prints."""

    @cached_property
    def poses(self) -> "pandas.DataFrame":
        """A row a pose: scene_id, im_id, obj_id, score, R (row by row) and t (millimetres) as texts, time."""
        return _pandas().read_csv(self.file)

    def __repr__(self) -> str:
        return f"<grip.Estimates: {self.summary['poses']} poses, {self.file}>"


@dataclass(frozen=True)
class Evaluation:
    """Errors of results files against the truth."""

    summaries: tuple[Mapping[str, Any], ...]
    """What ``grip eval --json`` prints of each file."""

    @property
    def summary(self) -> Mapping[str, Any]:
        """Of the first file."""
        return self.summaries[0]

    @cached_property
    def table(self) -> "pandas.DataFrame":
        """A row a results file: all that is one number."""
        return _table([{key: value for key, value in summary.items() if not isinstance(value, (list, dict))} for summary in self.summaries])

    def __repr__(self) -> str:
        return f"<grip.Evaluation of {', '.join(str(summary['results']) for summary in self.summaries)}>"


def of(verb: str, options: Mapping[str, Any], fully: bool, data: str, made: list[str]) -> Any:
    """What a verb returns."""
    said: Any = json.loads(data) if options.get("json") and data.strip() else None

    def out(default: str) -> Path:
        return Path(os.fspath(options.get("out") or default))

    if verb == "pack":
        return Trial(said, Path(made[0]).parent)
    if verb == "trials":
        return Trials(out("runs/trials"), said, fully)
    if verb == "merge":
        return Trials(Path(os.fspath(options["out"])), said, fully)
    if verb == "sweep":
        return Sweep(out("runs/sweep"), said, fully)
    if verb == "scenes":
        return DataSet(out("runs/scenes"), options.get("split") or "test", said)
    if verb == "estimate":
        return Estimates(Path(said["out"]), said)
    if verb == "eval":
        return Evaluation(tuple(said) if isinstance(said, list) else (said,))
    return said
