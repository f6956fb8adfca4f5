"""The verbs: the same bits as the command, functions of Python as estimators and grasp planners, errors, Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
import textwrap

import numpy as np
import pytest

import grip

SMALL = {"trials": 2, "seed": 5, "estimators": "truth", "renderer": "cpu"}


def command(*arguments, **options):
    return subprocess.run([sys.executable, "-m", "grip", *map(str, arguments)], capture_output=True, text=True, **options)


def test_trials_write_the_same_bytes_as_the_command(tmp_path):
    ours = grip.trials(**SMALL, out=tmp_path / "python")
    done = command("trials", "--trials", 2, "--seed", 5, "--estimators", "truth", "--renderer", "cpu", "--out", tmp_path / "command", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == ours.summary
    for file in ("trials.jsonl", "items.parquet"):
        assert (tmp_path / "python" / file).read_bytes() == (tmp_path / "command" / file).read_bytes(), file
    assert len(ours.items) == 10 and len(ours.trials) == len(ours.timings) == 2 and len(ours.cells) == 1
    assert ours.complete


def test_pack_is_the_trial_of_its_seed(tmp_path):
    trial = grip.pack(seed=5, estimator="truth", renderer="cpu", items=1, out=tmp_path / "run")
    done = command("pack", "--seed", 5, "--estimator", "truth", "--renderer", "cpu", "--items", 1, "--json", "--out", tmp_path / "again")
    assert json.loads(done.stdout)["state_hash"] == trial.state_hash
    assert trial.summary.exists() and trial.film.exists() and trial.folder == tmp_path / "run"
    assert trial.items.iloc[0].outcome == "packed" and "packed" in trial._repr_html_()


def by_truth(scene):
    """An estimator that knows, for it is told: what it says is what is done."""
    poses = scene.world(renderer="cpu").true_poses()

    def knows(look):
        camera_from_world = np.linalg.inv(look.frame.world_from_camera)
        if look.number > 0:
            return {}
        return {o.index: camera_from_world @ poses[o.object] for o in look.objects}

    return knows


def test_a_function_is_an_estimator_and_what_it_does_wrong_ends_its_trial_alone(scene, tmp_path):
    looks = []

    def watched(look):
        looks.append((look.place, look.number, len(look.objects), look.frame.rgb.shape, look.objects[0].model.vertices.shape[1]))
        return by_truth(scene)(look)

    trial = grip.pack(seed=7, estimator=watched, renderer="cpu", items=1, out=tmp_path / "a")
    assert trial.packed == 1 and looks[0] == ("table", 0, 5, (480, 640, 3), 3)
    assert trial.result["estimator"] == "watched"

    def wrong(answer):
        return grip.pack(seed=7, estimator=("odd", lambda look: answer), renderer="cpu", items=1, out=tmp_path / "b").items.iloc[0]

    for answer, told in [
        (None, "NoneType"),
        ({0: np.eye(3)}, "shape [3, 3]"),
        ({17: np.eye(4)}, "index 17"),
        ({"can": np.eye(4)}, "keys are indices"),
        ({0: np.full((4, 4), np.nan)}, "finite"),
        ({0: np.diag([1.0, 1.0, -1.0, 1.0])}, "rotation"),
        ([grip.Pose(0, np.eye(4), confidence=2.0)], "confidence"),
        ([grip.Pose(0, np.eye(4), samples=[np.eye(4)], weights=[])], "weights"),
        (3, "int"),
    ]:
        item = wrong(answer)
        assert item.outcome == "estimator_failed" and told in item.reason, (answer, item.reason)

    def fails(look):
        raise ValueError(f"no idea of {look.objects[0].object}")

    trials = grip.trials(trials=1, seed=7, estimators=["truth", fails], renderer="cpu", out=tmp_path / "c")
    outcomes = trials.items.groupby("estimator").outcome.unique()
    assert list(outcomes["fails"]) == ["estimator failed"] and "packed" in outcomes["truth"]


def test_a_function_is_a_grasp_planner(scene, tmp_path):
    asked = []

    def from_above(scene_now):
        asked.append(scene_now)
        grasps = []
        for target in scene_now.objects:
            pose = scene_now.frame.world_from_camera @ target.camera_from_object
            vertices = scene.models[target.index].vertices @ pose[:3, :3].T + pose[:3, 3]
            directions = [np.array([np.cos(a), np.sin(a), 0.0]) for a in np.linspace(0, np.pi, 24, endpoint=False)]
            closing = min(directions, key=lambda d: np.ptp(vertices @ d))
            gripper = np.eye(4)
            gripper[:3, 0], gripper[:3, 1] = [0, 0, -1], closing
            gripper[:3, 2] = np.cross(gripper[:3, 0], gripper[:3, 1])
            middle = (vertices.min(0) + vertices.max(0)) / 2
            gripper[:3, 3] = [*middle[:2], vertices[:, 2].max() - 0.02]
            grasps.append(grip.Grasp(np.linalg.inv(scene_now.frame.world_from_camera) @ gripper, index=target.index))
        return grasps

    trial = grip.pack(seed=7, estimator="truth", grasper=from_above, renderer="cpu", items=2, out=tmp_path / "a")
    assert trial.packed >= 1 and trial.result["grasper"] == "from_above"
    assert asked[0].segmentation.shape == (480, 640) and asked[0].segmentation.max() <= 5
    bad = grip.pack(seed=7, estimator="truth", grasper=lambda s: [grip.Grasp(np.eye(4), width=-1.0)], renderer="cpu", items=1, out=tmp_path / "b")
    assert bad.items.iloc[0].outcome == "grasper_failed" and "width -1" in bad.items.iloc[0].reason


def test_a_data_set_is_made_estimated_and_measured(tmp_path):
    data = grip.scenes(scenes=1, views=["B"], objects=["005_tomato_soup_can", "025_mug"], renderer="cpu", out=tmp_path / "set", seed=3)
    assert sorted(data.truth.obj_id) == [4, 14] and data.summary["frames"] == 1
    truth = {row.obj_id: np.vstack([np.column_stack([np.reshape(row.cam_R_m2c, (3, 3)), np.array(row.cam_t_m2c) / 1000]), [0, 0, 0, 1]]) for row in data.truth.itertuples()}

    def knows(look):
        assert look.place == "image"
        return {o.index: truth[o.obj_id] for o in look.objects}

    estimates = grip.estimate(data.folder, estimator=knows, out=tmp_path / "poses.csv")
    assert len(estimates.poses) == 2
    errors = grip.evaluate(data.folder, estimates.file)
    assert errors.summary["dataset"] and errors.table.shape[0] == 1


def test_a_sweep_is_a_table(tmp_path):
    sweep = grip.sweep("005_tomato_soup_can", axes=["y"], samples=3, seeds=1, out=tmp_path / "sweep")
    assert len(sweep.grasps) == 3 and set(sweep.falls.axis) == {"y"}


def test_wrong_options_are_told_as_the_command_tells_them(tmp_path):
    for wrong, told in [
        ({"trials": 0}, "1..=1000000"),
        ({"conditions": "drak"}, "did you mean"),
        ({"estimators": "grop"}, "did you mean"),
        ({"estimators": 3}, "give a text or a function"),
        ({"estimators": [("a b", lambda look: {})]}, "letters"),
        ({"estimators": [("twice", lambda look: {}), ("twice", lambda look: {})]}, "twice"),
        ({"settings": {"belief": {"follows": True}}}, "did you mean"),
    ]:
        with pytest.raises(grip.Error) as caught:
            grip.trials(**{**SMALL, **wrong}, out=tmp_path / "none")
        assert told in str(caught.value), caught.value
    with pytest.raises(TypeError, match="trails"):
        grip.trials(trails=3)
    assert not (tmp_path / "none").exists(), "nothing half-written is left"
    assert "error: " not in str(caught.value)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_ctrl_c_is_heard_and_what_is_finished_is_kept(tmp_path):
    script = textwrap.dedent(
        f"""
        import signal, grip
        # Where shells start things in the background it is ignored.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            grip.trials(trials=40, seed=5, estimators="truth", renderer="cpu", out={str(tmp_path / "out")!r}, jobs=1)
        except KeyboardInterrupt:
            print("interrupted")
        """
    )
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    journal = tmp_path / "out" / "trials.jsonl"
    while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") >= 1):
        pass
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate(timeout=600)
    assert said == "interrupted\n"
    kept = journal.read_bytes().count(b"\n")
    assert 1 <= kept < 40
    # The folder can be gone on with; it is the same experiment only with the same options.
    with pytest.raises(grip.Error, match="trials is not what it was"):
        grip.trials(trials=2, seed=5, estimators="truth", renderer="cpu", out=tmp_path / "out", resume=True)


def test_a_keyboard_interrupt_in_a_function_ends_everything(tmp_path):
    def interrupts(look):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        grip.pack(seed=7, estimator=interrupts, renderer="cpu", out=tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_the_command_says_what_it_says():
    assert command("--version").stdout.startswith("grip ")
    wrong = command("pack", "--seed", "x")
    assert wrong.returncode == 2 and "invalid value 'x'" in wrong.stderr
