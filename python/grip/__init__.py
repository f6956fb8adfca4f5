"""Grocery packing in simulation: poses are estimated, a robot packs, physics decides, every grasp is scored.

    import grip

    print(grip.pack(seed=7).items)                      # one trial, with a report in its folder
    world = grip.Scene(seed=7, condition="dark").world()
    frame = world.look()                                # frame.rgb, frame.depth, frame.K: NumPy arrays

Poses are 4 x 4 matrices, metres; ``a_from_b`` maps coordinates in frame b to frame a. The world's z is up; a camera's frame has x to the
right, y down, z forward. Everything random follows from a seed: the same seed gives the same bits as the command ``grip``.
"""

from . import campaign
from ._grip import Error, Estimator, Frame, Posterior, World
from .functions import Asked, Grasp, GraspScene, Look, Model, Pose, Target
from .results import DataSet, Estimates, Evaluation, Sweep, Trial, Trials
from .scene import Scene, read_scene
from .settings import Settings
from .verbs import (
    convergence,
    detect,
    estimate,
    evaluate,
    explain,
    export,
    grasps,
    init,
    merge,
    pack,
    plan,
    render,
    report,
    reproduce,
    robot,
    scenes,
    sweep,
    trials,
)

__all__ = [
    "Asked",
    "DataSet",
    "Error",
    "Estimates",
    "Estimator",
    "Evaluation",
    "Frame",
    "Grasp",
    "GraspScene",
    "Look",
    "Model",
    "Pose",
    "Posterior",
    "Scene",
    "Settings",
    "Sweep",
    "Target",
    "Trial",
    "Trials",
    "World",
    "campaign",
    "convergence",
    "detect",
    "estimate",
    "evaluate",
    "explain",
    "export",
    "grasps",
    "init",
    "merge",
    "pack",
    "plan",
    "read_scene",
    "render",
    "report",
    "reproduce",
    "robot",
    "scenes",
    "sweep",
    "trials",
]
