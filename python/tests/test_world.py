"""Scenes, worlds and estimators."""

import threading

import numpy as np
import pytest

import grip


def test_estimates_are_where_the_objects_are(scene, frame):
    world = scene.world(renderer="cpu")
    truth = world.true_poses()
    camera_from_world = np.linalg.inv(frame.world_from_camera)
    estimator = scene.estimator()
    found = estimator.estimate(frame, seed=1)
    assert [p.object for p in found] == scene.objects
    for posterior in found:
        off = (camera_from_world @ truth[posterior.object] - posterior.camera_from_object)[:3, 3]
        assert np.linalg.norm(off) < 0.01, posterior
        assert posterior.samples.shape[1:] == (4, 4) and np.isclose(posterior.weights.sum(), 1.0)
    again = estimator.estimate(frame, seed=1)
    assert all((a.camera_from_object == b.camera_from_object).all() for a, b in zip(found, again)), "the same bits"


def test_a_world_goes_on_by_steps(scene):
    world = scene.world(renderer="cpu")
    hash_before, time = world.state_hash(), world.time
    world.step(0.5)
    assert world.time - time == pytest.approx(0.5)
    assert world.state_hash() != hash_before, "time is a part of the state"
    assert scene.world(renderer="cpu").state_hash() == hash_before, "the same seed, the same world"
    assert len(world.joints) == len(scene.joint_names)
    with pytest.raises(grip.Error, match="seconds"):
        world.step(-1.0)


def test_a_scene_may_be_a_dictionary():
    groceries = grip.read_scene("scenes/grocery.toml")
    groceries["objects"]["names"] = ["025_mug", "011_banana"]
    scene = grip.Scene(groceries, seed=3, condition="dark", settings={"belief": {"follow": True}})
    assert (scene.objects, scene.condition, scene.packable) == (["025_mug", "011_banana"], "dark", 2)
    groceries["table"]["height"] = "high"
    with pytest.raises(grip.Error, match="height"):
        grip.Scene(groceries)


def test_the_same_scene_with_another_seed_is_that_of_the_seed(scene):
    other = scene.with_seed(8)
    assert other.world("cpu").state_hash() == grip.Scene(seed=8).world("cpu").state_hash()


def test_wrong_names_are_told():
    with pytest.raises(grip.Error, match="nowhere.toml"):
        grip.Scene("nowhere.toml")
    with pytest.raises(grip.Error, match="did you mean"):
        grip.Scene(condition="drak")
    with pytest.raises(grip.Error, match="give auto, wgpu or cpu"):
        grip.Scene().world(renderer="gpu")
    with pytest.raises(grip.Error, match="give grip, paper"):
        grip.Scene().estimator("truth")


def test_settings_say_only_what_was_changed():
    from grip._run import changed

    settings = grip.Settings()
    assert changed(settings, grip.Settings()) == {}
    settings.belief.follow = True
    settings.perception.grip.search.levels[0].samples = 10
    tree = changed(settings, grip.Settings())
    assert tree["belief"] == {"follow": True} and tree["perception"]["grip"]["search"]["levels"][0]["samples"] == 10
    settings.planner.grasp.antipodal.pad_friction = -1.0
    with pytest.raises(grip.Error, match="pad_friction"):
        grip.Scene(settings=settings)


def test_other_threads_run_while_a_world_is_made(scene):
    beats, stop = [], threading.Event()

    def beat():
        while not stop.wait(0.002):
            beats.append(1)

    thread = threading.Thread(target=beat)
    thread.start()
    scene.world(renderer="cpu").look()
    stop.set()
    thread.join()
    assert len(beats) > 20, "the interpreter's lock was held"
