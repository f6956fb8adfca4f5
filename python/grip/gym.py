"""The Gymnasium environment ``grip/Pack-v0``: pack a box, a grasp and a place at a time, in contact physics.

    import gymnasium, grip.gym

    env = gymnasium.make("grip/Pack-v0")
    observation, info = env.reset(seed=7)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

An action is where the gripper closes and where what it holds is put. How the arm gets there is planned; what becomes of it is decided by
physics and scored as in every trial: nothing is welded to the hand. The sum of an episode's rewards is the number of items that are packed
in the end, by the nine clauses of success (docs/experiments.md).
"""

from __future__ import annotations

import json
from typing import Any, Mapping, Optional, Sequence, Union

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import ArrayLike, NDArray

from . import _grip
from .scene import Path, Scene

__all__ = ["DOWN", "PackEnv", "decode", "encode"]

DOWN: NDArray[np.float64] = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""The gripper's orientation in the world with a rotation vector of zero: its fingers point down, and close along y."""

WIDEST = 0.10
"""Of the action's opening, metres; a gripper that opens less opens as far as it can."""

FARTHEST = 100.0
"""No camera sees farther, metres."""


def rotation(vector: ArrayLike) -> NDArray[np.float64]:
    """The rotation matrix of a rotation vector (axis times angle, radians), by Rodrigues' formula."""
    vector = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)


def rotation_vector(matrix: ArrayLike) -> NDArray[np.float64]:
    """The rotation vector of a rotation matrix; its length is at most pi."""
    matrix = np.asarray(matrix, dtype=np.float64)
    # By the unit quaternion, which is exact near a half turn, too.
    w, x, y, z = _quaternion(matrix)
    sine = float(np.sqrt(x * x + y * y + z * z))
    if sine < 1e-12:
        return np.zeros(3)
    return 2.0 * np.arctan2(sine, w) / sine * np.array([x, y, z])


def _quaternion(m: NDArray[np.float64]) -> NDArray[np.float64]:
    # Each of the four has one form that does not cancel: the largest decides.
    squares = np.array([1 + m[0, 0] + m[1, 1] + m[2, 2], 1 + m[0, 0] - m[1, 1] - m[2, 2], 1 - m[0, 0] + m[1, 1] - m[2, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2]])
    k = int(np.argmax(squares))
    rows = [
        [squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], squares[1], m[1, 0] + m[0, 1], m[0, 2] + m[2, 0]],
        [m[0, 2] - m[2, 0], m[1, 0] + m[0, 1], squares[2], m[2, 1] + m[1, 2]],
        [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[2, 1] + m[1, 2], squares[3]],
    ]
    quaternion = np.array(rows[k]) / np.linalg.norm(rows[k])
    return quaternion if quaternion[0] >= 0 else -quaternion


def encode(world_from_gripper: ArrayLike, width: float = WIDEST, place: Sequence[float] = (0.0, 0.0, 0.0)) -> NDArray[np.float32]:
    """The action of a grasp.

    Args:
        world_from_gripper: 4 x 4: the origin is the middle between the pads, x the approach, y the closing direction.
        width: How far the fingers open, metres.
        place: Where the centre of the object is put in the bin's frame (x, y, metres) and how far it is turned about the vertical, radians.
    """
    pose = np.asarray(world_from_gripper, dtype=np.float64)
    turn = rotation_vector(pose[:3, :3] @ DOWN.T)
    return np.concatenate([pose[:3, 3], turn, [width], place]).astype(np.float32)


def decode(action: ArrayLike) -> tuple[NDArray[np.float64], float, tuple[float, float, float]]:
    """The grasp, the opening and the place of an action: the inverse of :func:`encode`."""
    action = np.asarray(action, dtype=np.float64)
    pose = np.eye(4)
    pose[:3, :3] = rotation(action[3:6]) @ DOWN
    pose[:3, 3] = action[:3]
    x, y, turn = action[7:10]
    return pose, float(action[6]), (float(x), float(y), float(turn))


class PackEnv(gymnasium.Env[dict[str, Any], NDArray[np.float32]]):
    """Packs the scene's items into the bin.

    Observation (a dictionary):
        rgb: height x width x 3, uint8.
        depth: height x width, float32, metres, 0 where there is no reading.
        open: an item each: 1 if it is still to be packed.
        poses: with ``poses=True`` only: items x 4 x 4, from each item's frame to the world's, by ``estimator``; zeros where none is known.

    Action (float32, 10 numbers): position of the gripper in the world (3, metres); rotation vector from :data:`DOWN` (3, radians); opening
    (metres); x, y of the object in the bin's frame (metres); its turn about the vertical (radians). :func:`encode` makes one of a matrix.

    Reward: how many more items than before count as packed, by the score of trials. The last step waits until everything is at rest,
    scores anew, and gives the difference.

    An episode ends (``terminated``) when no item is open any more, and is cut (``truncated``) after ``max_steps``. ``info`` tells the
    camera (``K``, ``world_from_camera``), the items' names, what would be their outcome now (``outcomes``), whether the action led to a
    plan (``planned``), and at the end the whole ``result``.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 1}

    def __init__(
        self,
        scene: Union[Path, Mapping[str, Any]] = "scenes/grocery.toml",
        *,
        estimator: str = "truth",
        poses: bool = False,
        items: Optional[int] = None,
        max_steps: int = 20,
        renderer: str = "auto",
        render_mode: Optional[str] = None,
        **options: Any,
    ) -> None:
        """Reads the scene.

        Args:
            scene: A scene file, or its content as a dictionary.
            estimator: Who tells the motion planner where things are: ``truth``, or ``grip``, which sees no more than the camera does.
            poses: Whether the observation has its poses.
            items: How many of the scene's objects are to be packed; the rest is clutter.
            max_steps: After so many actions the episode is cut.
            renderer: ``auto``, ``wgpu`` or ``cpu``.
            render_mode: ``rgb_array``, or None.
            options: Those of :class:`grip.Scene`: condition, settings, intrinsics, robot and so on.
        """
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: {render_mode}: give rgb_array or None")
        self.render_mode = render_mode
        self._scene: _grip.Scene = Scene(scene, **options)
        self._estimator, self._poses, self._renderer, self._steps = estimator, poses, renderer, max_steps
        packable = self._scene.packable
        self._items = packable if items is None else items
        if not 1 <= self._items <= packable:
            raise ValueError(f"items: {items}: the scene has {packable} objects that can be packed; give 1 to {packable}")
        width, height = self._scene.resolution
        observed: dict[str, spaces.Space[Any]] = {
            "rgb": spaces.Box(0, 255, (height, width, 3), np.uint8),
            "depth": spaces.Box(0.0, FARTHEST, (height, width), np.float32),
            "open": spaces.MultiBinary(self._items),
        }
        if poses:
            observed["poses"] = spaces.Box(-np.inf, np.inf, (self._items, 4, 4), np.float32)
        self.observation_space = spaces.Dict(observed)
        (low, high), (half_x, half_y) = self._scene.workspace, [0.5 * side for side in self._scene.bin_inner]
        turn = [np.pi] * 3
        self.action_space = spaces.Box(
            np.array([*low, *[-t for t in turn], 0.001, -half_x, -half_y, -np.pi], np.float32),
            np.array([*high, *turn, WIDEST, half_x, half_y, np.pi], np.float32),
            dtype=np.float32,
        )
        self._episode: Optional[_grip.Episode] = None
        self._rgb: Optional[NDArray[np.uint8]] = None
        self._observation: dict[str, Any] = {}
        self._info: dict[str, Any] = {}
        self._taken, self._packed = 0, 0

    def reset(self, *, seed: Optional[int] = None, options: Optional[dict[str, Any]] = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """Lays another scene out: that of ``seed``, as ``grip pack --seed`` has it, or of a seed that is drawn."""
        super().reset(seed=seed)
        scene_seed = int(self.np_random.integers(2**31)) if seed is None else seed
        self._scene = self._scene.with_seed(scene_seed)
        self._episode = _grip.Episode(
            self._scene,
            estimator=self._estimator,
            renderer=self._renderer,
            items=self._items,
            steps=self._steps + 1,
        )
        self._taken, self._packed = 0, 0
        observation, info = self._seen(self._episode.next())
        info["seed"] = scene_seed
        return observation, info

    def step(self, action: NDArray[np.float32]) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Grasps, carries and puts down, as far as it goes, and looks again."""
        if self._episode is None:
            raise _grip.Error("the episode has not begun; call reset first")
        pose, width, place = decode(action)
        told = self._episode.next({"grasp": pose, "width": max(width, 1e-3), "place": place})
        self._taken += 1
        if "result" in told:
            return self._ended(told, truncated=False)
        observation, info = self._seen(told)
        packed = sum(outcome == "packed" for outcome in info["outcomes"])
        reward, self._packed = float(packed - self._packed), packed
        if self._taken >= self._steps:
            # Not acted upon: the trial ends, settles and scores.
            end = self._episode.finish()
            observation, more, _, _, info = self._ended(end, truncated=True)
            return observation, reward + more, False, True, info
        return observation, reward, False, False, info

    def render(self) -> Optional[NDArray[np.uint8]]:
        """What the camera saw last."""
        return self._rgb if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Leaves the episode."""
        self._episode = None

    def _seen(self, told: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        frame, items = told["frame"], json.loads(told["items"])
        names = self._scene.objects[: self._items]
        outcomes = [item["outcome"] for item in items]
        observation: dict[str, Any] = {
            "rgb": frame.rgb,
            "depth": frame.depth,
            "open": np.array([outcome != "packed" for outcome in outcomes], np.int8),
        }
        if self._poses:
            poses = np.zeros((self._items, 4, 4), np.float32)
            for _, index, pose, _ in told["believed"]:
                if index < self._items:
                    poses[index] = pose
            observation["poses"] = poses
        self._rgb, self._observation = frame.rgb, observation
        info = {
            "K": frame.K,
            "world_from_camera": frame.world_from_camera,
            "names": names,
            "outcomes": outcomes,
            "planned": told["handled"] is not None,
        }
        self._info = info
        return observation, info

    def _ended(self, told: Mapping[str, Any], truncated: bool) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        result = json.loads(told["result"])
        outcomes = [item["outcome"] for item in result["items"]]
        observation = {**self._observation, "open": np.array([outcome != "packed" for outcome in outcomes], np.int8)}
        reward, self._packed, self._episode = float(result["packed"] - self._packed), result["packed"], None
        info = {**self._info, "outcomes": outcomes, "result": result}
        return observation, reward, not truncated, truncated, info


gymnasium.register(id="grip/Pack-v0", entry_point="grip.gym:PackEnv")
