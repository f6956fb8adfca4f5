"""How functions of this package become verbs of the command."""

from __future__ import annotations

import json
import logging
import os
import sys
import tempfile
from dataclasses import asdict, fields, is_dataclass
from typing import Any, Iterable, Mapping, Optional

from . import _grip

log = logging.getLogger("grip")


def plain(value: Any) -> Any:
    """What JSON has no type for."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "tolist"):  # NumPy's numbers and arrays.
        return value.tolist()
    raise TypeError(f"{value!r} of {type(value).__name__} is neither a number, a text nor a list of them")


def is_tree(value: Any) -> bool:
    """Whether it is settings, and not their class."""
    return is_dataclass(value) and not isinstance(value, type)


def changed(settings: Any, default: Any) -> dict[str, Any]:
    """Of a tree of dataclasses what is not the default: only that is said, for a robot's own numbers count where nothing is."""

    def said(value: Any, default: Any) -> Any:
        if is_tree(value):
            return changed(value, default)
        if isinstance(value, (list, tuple)):
            return [asdict(item) if is_tree(item) else item for item in value]
        return value

    pairs = ((field.name, getattr(settings, field.name), getattr(default, field.name)) for field in fields(settings))
    return {name: said(value, before) for name, value, before in pairs if value != before}


def without_none(value: Any) -> Any:
    """A tree without what says nothing."""
    if isinstance(value, Mapping):
        return {key: without_none(inner) for key, inner in value.items() if inner is not None}
    return value


def dumps(value: Any) -> str:
    """JSON, of a tree that becomes TOML."""
    return json.dumps(without_none(value), default=plain)


def settings_file(settings: Any, folder: str) -> Optional[str]:
    """The path of a file with these settings, made in ``folder`` where they are no file."""
    if settings is None or isinstance(settings, (str, os.PathLike)):
        return None if settings is None else os.fspath(settings)
    if is_tree(settings):
        settings = changed(settings, type(settings)())
    path = os.path.join(folder, "settings.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(_grip.toml(dumps(settings)))
    return path


def scene_file(scene: Mapping[str, Any], folder: str) -> str:
    """The path of a file with this scene, made in ``folder``."""
    path = os.path.join(folder, f"{scene.get('name', 'scene')}.toml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(_grip.toml(dumps(scene)))
    return path


class Bar:
    """Progress by tqdm, in a notebook or on a terminal."""

    def __init__(self, tqdm: Any, unit: str) -> None:
        # What has no known length says what it does.
        how = {"unit": f" {unit.rstrip('s')}"} if unit else {"bar_format": "{elapsed}{postfix}"}
        self.bar = tqdm(leave=False, **how)

    def begin(self, pieces: int, done: int) -> None:
        self.bar.reset(total=pieces)
        self.bar.update(done)

    def advance(self, pieces: int) -> None:
        self.bar.update(pieces)

    def message(self, text: str) -> None:
        self.bar.set_postfix_str(text)

    def close(self) -> None:
        self.bar.close()


class Progress:
    """Makes the bars of one call, and takes them away."""

    def __init__(self, show: Optional[bool]) -> None:
        self.bars: list[Bar] = []
        self.tqdm = None
        watched = sys.stderr.isatty() or "ipykernel" in sys.modules
        if show or (show is None and watched):
            try:
                from tqdm.auto import tqdm

                self.tqdm = tqdm
            except ImportError:
                if show:
                    raise

    def __call__(self, unit: str) -> Bar:
        self.bars.append(Bar(self.tqdm, unit))
        return self.bars[-1]

    def close(self) -> None:
        for bar in self.bars:
            bar.close()


def named(given: Any, fallback: str) -> Any:
    """A word, or the name and the function of one."""
    if isinstance(given, str):
        return given
    if callable(given):
        name = getattr(given, "__name__", type(given).__name__)
        return (fallback if name == "<lambda>" else name, given)
    return given


def some(given: Any, fallback: str) -> Optional[list[Any]]:
    """Words and functions as a list; None where all is left to the command's default."""
    if given is None:
        return None
    if isinstance(given, Mapping):
        return [f"{name}={who}" if isinstance(who, str) else (name, who) for name, who in given.items()]
    one = isinstance(given, (str, tuple)) or callable(given) or not isinstance(given, Iterable)
    return [named(who, fallback) for who in ([given] if one else given)]


def run(verb: str, options: Mapping[str, Any], progress: Optional[bool] = None) -> tuple[bool, str, list[str]]:
    """Runs a verb; returns whether all was done that was asked for, what it printed, and the files that it made where it chose."""
    options = {key: value for key, value in options.items() if value is not None}
    estimators = graspers = None
    if verb in ("trials", "pack", "estimate"):
        many = verb == "trials"
        estimators = some(options.pop("estimators" if many else "estimator", None), "function")
        graspers = some(options.pop("graspers" if many else "grasper", None), "function")
    bars = Progress(progress)
    with tempfile.TemporaryDirectory(prefix="grip-") as folder:
        if isinstance(options.get("scene"), Mapping):
            options["scene"] = scene_file(options["scene"], folder)
        if "settings" in options:
            options["settings"] = settings_file(options["settings"], folder)
        try:
            code, data, messages, made = _grip.call(
                verb,
                json.dumps(options, default=plain),
                estimators,
                graspers,
                bars if bars.tqdm else None,
            )
        finally:
            bars.close()
    for message in messages:
        log.info(message)
    return code == 0, data, [os.fspath(path) for path in made]
