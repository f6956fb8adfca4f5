"""Scenes, from files or from dictionaries."""

from __future__ import annotations

import os
import sys
import tempfile
from typing import Any, Mapping, Optional, Sequence, Union

from . import _grip
from ._run import scene_file, settings_file
from .settings import Settings

if sys.version_info >= (3, 11):
    import tomllib
else:  # The same library, before it was Python's own.
    import tomli as tomllib

Path = Union[str, "os.PathLike[str]"]


def read_scene(path: Path = "scenes/grocery.toml") -> dict[str, Any]:
    """A scene file as a dictionary, to be changed and given to :class:`Scene`.

    Paths in it no longer depend on where the file is. A name such as ``scenes/shelf.toml`` is that of a file that ships with the program
    where there is no such file on disk.
    """
    path = _grip.find(os.fspath(path))
    scene = tomllib.loads(_grip.read_text(path))
    folder = os.path.dirname(path)

    def found(file: str) -> str:
        here = file if os.path.isabs(file) or file.startswith(("package:", "builtin:")) else os.path.join(folder, file)
        return here if here.startswith("builtin:") else os.path.abspath(here)

    robot = scene.get("robot", {})
    for name in ("urdf", "config"):
        if not robot.get(name, "package:").startswith("package:"):
            robot[name] = found(robot[name])
    tables = scene.get("objects", {}).get("tables")
    if tables:
        scene["objects"]["tables"] = [found(table) for table in tables]
    intrinsics = scene.get("camera", {}).get("intrinsics")
    if isinstance(intrinsics, str) and "." in intrinsics:
        scene["camera"]["intrinsics"] = found(intrinsics)
    return scene


class Scene(_grip.Scene):
    """Everything that a run depends on: robot, table, bin, objects, light, camera, settings, seed."""

    def __new__(
        cls,
        scene: Union[Path, Mapping[str, Any]] = "scenes/grocery.toml",
        *,
        condition: Path = "base",
        seed: int = 1,
        objects: Union[Path, Sequence[Path]] = (),
        ycb: Optional[Path] = None,
        intrinsics: Optional[Path] = None,
        robot: Optional[Path] = None,
        robot_config: Optional[Path] = None,
        package_path: Union[Path, Sequence[Path]] = (),
        settings: Union[Settings, Mapping[str, Any], Path, None] = None,
    ) -> "Scene":
        """Reads everything that is named.

        Args:
            scene: A scene file, or its content as a dictionary (:func:`read_scene`).
            condition: By name, from the folder ``conditions`` beside the scene file, or a path to a .toml file.
            seed: Of everything random.
            objects: Tables of objects of your own (docs/objects.md).
            ycb: Folder of scanned objects.
            intrinsics: Another camera than the scene's: ``FX,FY,CX,CY,WIDTH,HEIGHT``, a ROS calibration, or BOP's camera.json.
            robot: Another URDF than the scene's.
            robot_config: Another file of what the URDF does not say.
            package_path: Where ``package://`` meshes are looked up.
            settings: What is not to be the default.

        Raises:
            Error: A file is missing or wrong; names file, field, value and what to try.
        """
        many = lambda paths: [os.fspath(paths)] if isinstance(paths, (str, os.PathLike)) else [os.fspath(p) for p in paths]  # noqa: E731
        one = lambda path: None if path is None else os.fspath(path)  # noqa: E731
        with tempfile.TemporaryDirectory(prefix="grip-") as folder:
            if isinstance(scene, Mapping):
                file = scene_file(scene, folder)
            else:
                file = _grip.find(os.fspath(scene))
            made: Any = super().__new__(
                cls,
                file,
                os.fspath(condition),
                seed,
                one(ycb),
                many(objects),
                one(intrinsics),
                one(robot),
                one(robot_config),
                many(package_path),
                settings_file(settings, folder),
            )
        return made  # type: ignore[no-any-return]
