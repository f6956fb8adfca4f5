"""What is written in Rust."""

from __future__ import annotations

import os
from typing import Any, Callable, Literal, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

Path = Union[str, "os.PathLike[str]"]

class Error(Exception):
    """What could not be done, and why: the text that the command ``grip`` prints."""

class Frame:
    """One registered RGB-D frame. The middle of the first pixel is (0, 0); x is right, y down, z forward."""

    def __init__(self, rgb: NDArray[np.uint8], depth: ArrayLike, K: ArrayLike, world_from_camera: Optional[ArrayLike] = None) -> None:
        """A frame of any camera; pictures are copied.

        Raises:
            Error: An array has another shape or type, or values that mean nothing.
        """
    @property
    def rgb(self) -> NDArray[np.uint8]:
        """Height x width x 3: sRGB."""
    @property
    def depth(self) -> NDArray[np.float32]:
        """Height x width: metres along the optical axis, 0 where there is no reading."""
    @property
    def K(self) -> NDArray[np.float64]:
        """Camera matrix, 3 x 3, pixels."""
    @property
    def world_from_camera(self) -> Optional[NDArray[np.float64]]:
        """4 x 4, from the camera's frame to the world's (z up), metres, as the robot believes; None where nobody knows."""

class Model:
    """The shape of an object."""

    @property
    def name(self) -> str:
        """The object's name."""
    @property
    def obj_id(self) -> int:
        """Its number in BOP's data sets."""
    @property
    def vertices(self) -> NDArray[np.float32]:
        """N x 3, metres in the object's frame."""
    @property
    def triangles(self) -> NDArray[np.uint32]:
        """N x 3: the corners of each triangle."""
    @property
    def diameter(self) -> float:
        """Largest distance of two of its points, metres."""

class Scene:
    """Everything that a run depends on; see :class:`grip.Scene`."""

    def __new__(cls, path: Path, condition: str, seed: int, ycb: Optional[Path], objects: Sequence[Path], intrinsics: Optional[str], robot: Optional[Path], robot_config: Optional[Path], package_path: Sequence[Path], settings: Optional[Path]) -> Scene: ...
    @property
    def name(self) -> str:
        """The scene's name."""
    @property
    def seed(self) -> int:
        """The seed of everything random."""
    @property
    def condition(self) -> str:
        """The condition's name."""
    @property
    def objects(self) -> list[str]:
        """The names of its objects; of a further one of a kind with a number behind it."""
    @property
    def models(self) -> list[Model]:
        """Their models, in the same order."""
    @property
    def packable(self) -> int:
        """How many of them a trial packs: the first ones."""
    @property
    def resolution(self) -> tuple[int, int]:
        """Columns and rows of the camera's pictures."""
    @property
    def workspace(self) -> tuple[list[float], list[float]]:
        """Lowest and highest corner of the space over the table in which objects are, metres."""
    @property
    def world_from_bin(self) -> NDArray[np.float64]:
        """4 x 4, from the bin's frame (origin in the middle of its floor) to the world's."""
    @property
    def bin_inner(self) -> list[float]:
        """Sides of the bin's inside, metres."""
    @property
    def joint_names(self) -> list[str]:
        """The names of the robot's joints."""
    def with_seed(self, seed: int) -> Scene:
        """The same scene for another seed; no file is read again."""
    def world(self, renderer: Literal["auto", "wgpu", "cpu"] = "auto") -> World:
        """A physics world in which its objects are at rest."""
    def estimator(self, kind: Literal["grip", "paper", "paper-guarded"] = "grip", *, detector: Literal["pyramid", "clusters", "none"] = "pyramid", detector_model: Optional[Path] = None) -> Estimator:
        """One of our own estimators for it, behind a detector."""

class World:
    """A physics world with the scene's objects at rest in it, and the camera that looks at them."""

    def __init__(self, scene: Scene, renderer: Literal["auto", "wgpu", "cpu"] = "auto") -> None:
        """Lays the objects out from the seed, and lets them come to rest."""
    def look(self) -> Frame:
        """What the camera sees as everything is now. Each look has noise of its own."""
    def step(self, seconds: float) -> None:
        """Lets ``seconds`` go by, to the nearest step of 1/240 s, while the robot stays as it is."""
    @property
    def time(self) -> float:
        """Simulated seconds since the objects were at rest."""
    @property
    def joints(self) -> NDArray[np.float64]:
        """Where the robot's joints are, radians or metres."""
    def true_poses(self) -> dict[str, NDArray[np.float64]]:
        """Where each object really is, 4 x 4, from its frame to the world's: for scores, and not for estimators."""
    def state_hash(self) -> str:
        """A hash of everything that moves: equal for equal states."""
    @property
    def renderer(self) -> Literal["wgpu", "cpu"]:
        """Who draws."""

class Posterior:
    """What is believed of an object."""

    @property
    def index(self) -> int:
        """Position in the scene's list of objects."""
    @property
    def object(self) -> str:
        """The object's name."""
    @property
    def camera_from_object(self) -> NDArray[np.float64]:
        """4 x 4, the pose that explains the frame best: from the object's frame (of its mesh, in metres) to the camera's."""
    @property
    def score(self) -> float:
        """How well it does: 1 is perfect, about 0.5 is what an absent object finds by chance."""
    @property
    def confidence(self) -> float:
        """Probability-like, 0 to 1: that the object is in view and that this is its pose."""
    @property
    def samples(self) -> NDArray[np.float64]:
        """N x 4 x 4, poses that stand for the belief, the best first."""
    @property
    def weights(self) -> NDArray[np.float64]:
        """N, their weights; they sum to 1."""
    @property
    def seconds(self) -> float:
        """Wall time."""

class Estimator:
    """One of our own estimators, for the cell and the objects of a scene."""

    def __init__(self, scene: Scene, kind: str = "grip", *, detector: str = "pyramid", detector_model: Optional[Path] = None) -> None: ...
    def estimate(self, frame: Frame, objects: Optional[Sequence[int]] = None, *, seed: int = 1) -> list[Posterior]:
        """Where the scene's objects are in a frame, those at the positions ``objects`` or all. ``seed`` is of everything random in it."""

class Asked:
    """An object that is looked for."""

    @property
    def index(self) -> int:
        """Of the object in the trial: an answer names it."""
    @property
    def object(self) -> str:
        """Its name; several may have the same."""
    @property
    def obj_id(self) -> int:
        """Its number in BOP's data sets."""
    @property
    def model(self) -> Model:
        """Its shape."""

class Target:
    """An object on the table."""

    @property
    def index(self) -> int:
        """Position in the trial's list of objects."""
    @property
    def obj_id(self) -> int:
        """Its number in BOP's data sets."""
    @property
    def wanted(self) -> bool:
        """Whether it is to be picked."""
    @property
    def camera_from_object(self) -> Optional[NDArray[np.float64]]:
        """4 x 4, where it is believed to be; None where that is not known."""

class Episode:
    """A trial that someone else acts in, a grasp and a place at a time; :mod:`grip.gym` is made of it."""

    def __init__(self, scene: Scene, estimator: str = "truth", renderer: str = "auto", items: Optional[int] = None, steps: int = 20) -> None: ...
    def next(self, action: Optional[dict[str, Any]] = None) -> dict[str, Any]: ...
    def finish(self) -> dict[str, Any]: ...

def call(verb: str, options: str, estimators: Optional[list[Any]] = None, graspers: Optional[list[Any]] = None, progress: Optional[Callable[[str], Any]] = None) -> tuple[int, str, list[str], list[os.PathLike[str]]]:
    """Runs a verb of the command with options as JSON: its exit code, what it printed, its messages, and files whose place it chose."""

def main(arguments: list[str]) -> int:
    """The command ``grip`` itself."""

def read_text(path: Path) -> str:
    """The text of a file of the project, on disk or built in (``builtin:scenes/grocery.toml``)."""

def find(relative: str) -> str:
    """The path of a file that ships with the program; as it is where there is no such file."""

def toml(json: str) -> str:
    """JSON as TOML."""
