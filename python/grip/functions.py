"""What estimators and grasp planners written in Python are asked, and what they answer.

An estimator is a function of a :class:`Look` that returns where objects are; a grasp planner is a function of a :class:`GraspScene` that
returns a list of :class:`Grasp`. An exception ends the trial with the outcome ``estimator_failed`` or ``grasper_failed``, and no more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._grip import Asked, Frame, Model, Target

__all__ = ["Asked", "EstimatorFunction", "Grasp", "GrasperFunction", "GraspScene", "Look", "Model", "Pose", "Target"]


@dataclass(frozen=True)
class Look:
    """One look of the robot, or an image of a data set."""

    frame: Frame
    """What the camera saw."""
    objects: tuple[Asked, ...]
    """What is looked for; of several of a kind each."""
    number: int
    """The number of the look in the trial, from 0 on; in a data set that of the image."""
    seed: int
    """The trial's seed; in a data set the number of the scene."""
    place: str
    """Where the objects are believed to be: ``table``, ``bin``, or ``image`` in a data set."""
    space: Optional[tuple[Sequence[float], Sequence[float]]]
    """Lowest and highest corner of the part of the world in which the objects are, metres; None in a data set."""
    boxes: Sequence[tuple[int, Sequence[float], float]]
    """Where a detector says that objects are, in a data set: their number in BOP, (left, top, width, height) in pixels, and confidence."""


@dataclass(frozen=True)
class Pose:
    """Where an object is, as an estimator says it."""

    index: int
    """Of the object that was asked for."""
    camera_from_object: ArrayLike
    """4 x 4, from the object's frame (of its mesh, in metres) to the camera's."""
    score: float = 1.0
    """How well it explains the picture, for reports."""
    confidence: float = 1.0
    """Probability that it is right: the robot acts from ``belief.least_confidence`` on."""
    samples: Optional[Sequence[ArrayLike]] = None
    """Other poses that it may have as well, itself included."""
    weights: Optional[Sequence[float]] = None
    """Of the samples, not negative; equal where none are given."""


EstimatorFunction = Callable[[Look], Union[Mapping[int, ArrayLike], Sequence[Pose]]]
"""An estimator: returns the pose of each object by its index, or a list of poses. What it does not see is left out."""


@dataclass(frozen=True)
class GraspScene:
    """What a grasp planner is asked after a look of the robot."""

    frame: Frame
    """What the camera saw."""
    objects: tuple[Target, ...]
    """What is believed to be on the table."""
    segmentation: Optional[NDArray[np.uint16]]
    """Height x width: 1 + ``index`` where an object should be seen by its estimated pose, else 0."""
    number: int
    """The number of the look in the trial, from 0 on."""
    seed: int
    """The trial's seed."""


@dataclass(frozen=True)
class Grasp:
    """How to grip something."""

    camera_from_gripper: ArrayLike
    """4 x 4: the origin is the middle between the pads, x the approach, y the closing direction."""
    width: Optional[float] = None
    """How far the fingers open for it, metres; as far as there is room where nothing is said."""
    score: float = 1.0
    """Grasps of an object are tried in this order, the largest first."""
    index: Optional[int] = None
    """The object that it is meant for; the one that is believed to be between the fingers where nothing is said."""


GrasperFunction = Callable[[GraspScene], Sequence[Grasp]]
"""A grasp planner."""
