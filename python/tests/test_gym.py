"""The environment, by Gymnasium's own checker and by a policy that packs."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis.extra import numpy as arrays

import grip.gym

# Small pictures: the checker looks a dozen times.
SMALL = {"renderer": "cpu", "intrinsics": "138.6,138.6,79.5,59.5,160,120"}


def test_gymnasium_finds_nothing_wrong():
    check_env(gymnasium.make("grip/Pack-v0", max_steps=2, items=2, **SMALL).unwrapped)


@settings(max_examples=200, deadline=None)
@given(arrays.arrays(np.float64, 3, elements={"min_value": -1.8, "max_value": 1.8}))
def test_actions_and_grasps_are_the_same_thing(vector):
    pose = np.eye(4)
    pose[:3, :3] = grip.gym.rotation(vector) @ grip.gym.DOWN
    pose[:3, 3] = [0.6, -0.1, 0.8]
    again, width, place = grip.gym.decode(grip.gym.encode(pose, 0.07, (0.1, -0.05, 0.5)))
    assert np.allclose(again, pose, atol=1e-6) and np.isclose(width, 0.07) and np.allclose(place, (0.1, -0.05, 0.5))
    assert np.allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3)) and np.isclose(np.linalg.det(pose[:3, :3]), 1.0)


def above(vertices, place):
    """A grasp from above across the narrowest side."""
    directions = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0, np.pi, 36, endpoint=False)]
    closing = min(directions, key=lambda d: np.ptp(vertices @ d))
    gripper = np.eye(4)
    gripper[:3, 0], gripper[:3, 1] = [0, 0, -1], closing
    gripper[:3, 2] = np.cross(gripper[:3, 0], gripper[:3, 1])
    along = vertices @ gripper[:3, 1], vertices @ gripper[:3, 2]
    middle = sum((x.min() + x.max()) / 2 * axis for x, axis in zip(along, gripper[:3, 1:].T))
    gripper[:3, 3] = [*middle[:2], vertices[:, 2].max() - 0.02]
    return grip.gym.encode(gripper, min(np.ptp(along[0]) + 0.02, 0.1), place)


def test_a_policy_packs_where_it_wants_and_is_rewarded_by_the_score():
    env = gymnasium.make("grip/Pack-v0", poses=True, max_steps=4, items=2, **SMALL).unwrapped
    observation, info = env.reset(seed=7)
    assert info["names"] == grip.Scene(seed=7).objects[:2] and info["outcomes"] == ["not_attempted"] * 2
    spots, rewards = [(-0.12, 0.08, 0.0), (0.12, -0.08, 0.0)], []
    models = grip.Scene(seed=7).models
    ended = False
    # One action that leads nowhere: far above the table.
    nowhere = grip.gym.encode(np.vstack([np.column_stack([grip.gym.DOWN, [0.6, 0.0, 1.2]]), [0, 0, 0, 1]]))
    _, reward, ended, _, info = env.step(nowhere)
    assert reward == 0.0 and not info["planned"] and not ended
    while not ended:
        k = int(np.argmax(observation["open"]))
        pose = observation["poses"][k].astype(float)
        vertices = models[k].vertices @ pose[:3, :3].T + pose[:3, 3]
        observation, reward, ended, truncated, info = env.step(above(vertices, spots[len(rewards)]))
        rewards.append(reward)
        assert not truncated
    assert sum(rewards) == info["result"]["packed"] == 2
    assert info["result"]["grasper"] == "episode" and not observation["open"].any()
    with pytest.raises(grip.Error, match="call reset"):
        env.step(nowhere)
    assert env.reset(seed=7)[0]["rgb"].shape == (120, 160, 3), "and begins anew"
    env.close()


def test_many_run_in_processes_of_their_own():
    many = gymnasium.make_vec("grip/Pack-v0", num_envs=2, vectorization_mode="async", max_steps=1, items=1, **SMALL)
    observation, _ = many.reset(seed=3)
    alone = gymnasium.make("grip/Pack-v0", max_steps=1, items=1, **SMALL).reset(seed=3)[0]
    assert (observation["rgb"][0] == alone["rgb"]).all(), "the same bits in another process"
    many.action_space.seed(1)
    _, rewards, _, truncated, _ = many.step(many.action_space.sample())
    assert rewards.shape == (2,) and truncated.all()
    many.close()


def test_what_it_cannot_do_is_told():
    with pytest.raises(ValueError, match="give 1 to 5"):
        grip.gym.PackEnv(items=6)
    with pytest.raises(ValueError, match="render_mode"):
        grip.gym.PackEnv(render_mode="human")
    with pytest.raises(grip.Error, match="did you mean"):
        grip.gym.PackEnv(estimator="grop").reset(seed=1)
