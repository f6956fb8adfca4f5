"""The verbs of the command as functions: the same options, the same results.

Made of what ``grip --help`` says, by ``GRIP_UPDATE_DOCS=1 cargo test --release --lib -- cli:: commands::``.
"""

from __future__ import annotations

import os
from typing import Any, Literal, Mapping, Optional, Sequence, Union

from . import results as _results
from ._run import run as _run
from .functions import EstimatorFunction, GrasperFunction
from .results import DataSet, Estimates, Evaluation, Sweep, Trial, Trials
from .settings import Settings

Path = Union[str, "os.PathLike[str]"]
Estimator = Union[str, EstimatorFunction, tuple[str, EstimatorFunction]]
"""A word of the command line, a function, or a pair of a name and a function."""
Grasper = Union[str, GrasperFunction, tuple[str, GrasperFunction]]
"""The same for who plans grasps."""


def pack(
    scene: Optional[Union[Path, Mapping[str, Any]]] = None,
    *,
    seed: Optional[int] = None,
    renderer: Optional[Literal["auto", "wgpu", "cpu"]] = None,
    ycb: Optional[Path] = None,
    objects: Optional[Union[Path, Sequence[Path]]] = None,
    intrinsics: Optional[str] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    condition: Optional[str] = None,
    estimator: Optional[Estimator] = None,
    detector: Optional[Literal["pyramid", "clusters", "none"]] = None,
    detector_model: Optional[Path] = None,
    providers: Optional[Union[str, Sequence[str]]] = None,
    min_confidence: Optional[float] = None,
    hypotheses: Optional[Literal["cpu", "gpu", "auto"]] = None,
    grasper: Optional[Grasper] = None,
    grasps: Optional[Path] = None,
    items: Optional[int] = None,
    out: Optional[Path] = None,
    record: Optional[Literal["none", "failures", "events", "full", "mcap"]] = None,
    record_rate: Optional[int] = None,
    animation: bool = False,
    bop: bool = False,
    progress: Optional[bool] = None,
) -> Trial:
    r"""Pack the scene's objects into the bin and score every grasp.

    Args:
        scene: Scene file [default: scenes/grocery.toml].
        seed: Seed of everything random in the run. Default: 1.
        renderer: Who draws: `auto` takes wgpu where a graphics adapter exists, else the CPU. Default: auto.
        ycb: Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
        objects: Table of objects of your own (docs/objects.md), beside the built-in ones; may be given more than once.
        intrinsics: Another camera than the scene's: FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's
            camera.json.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        condition: Condition by name, from the folder `conditions` beside the scene file, or a path to a .toml file. Default:
            base.
        estimator: Who estimates poses: `grip`; `paper` or `paper-guarded`, the filter of the GRIP paper in place of ours, to
            the letter or with guards (five seconds of one core a pose); `cmd:PROGRAM ARGUMENTS`, a program that is
            asked at each look (docs/estimators.md), or `NAME=cmd:...`; `csv:FILE`, a results file in BOP's format with
            the seed as scene_id and the look as im_id (see --bop), a look that is not in it keeping the estimates of
            the one before; or `truth`, which reads them from the simulator, for ceilings, and is marked in every
            output. Default: grip.
        detector: Who proposes boxes. Default: pyramid.
        detector_model: The detector's network: `varied`, trained on every light, heaps and other cameras; `base`, on what the paper
            trains on; or an ONNX file with a description of the same name beside it (.json) [default: varied].
        providers: Execution providers of the native ONNX Runtime that ORT_DYLIB_PATH names, in order: cpu, cuda, tensorrt,
            rocm, openvino, directml, coreml, xnnpack. Without ORT_DYLIB_PATH networks run in tract, which is built in.
        min_confidence: Throw away boxes of a lower confidence, whoever proposes them, and do not look for an object of which none
            is left: hard detections, as the filter SUM has them. GRIP keeps all. Default: 0.
        hypotheses: Who renders pose hypotheses. Default: cpu.
        grasper: Who plans grasps: `grip`, from the shape of the objects; or `cmd:PROGRAM ARGUMENTS`, a program that is asked
            after each look (docs/graspers.md), or `NAME=cmd:...`. Default: grip.
        grasps: Folder of grasps to use instead of those that are found: a file OBJECT.json each, as `grip grasps --out`
            makes them.
        items: Pack only the first K objects of the scene; the others stay as clutter.
        out: Run folder [default: runs/SCENE-CONDITION-ESTIMATOR-SEED, with other options where they are not the
            default]; an earlier run there is replaced when this one is done.
        record: What to keep of what is known of the trial, in the folder record/ (docs/recordings.md). Default: full.
        record_rate: Samples of a recording a simulated second: joints, forces, poses. Default: 20.
        animation: Save an animated picture of the trial (replay.png), seen from outside, four times as fast.
        bop: Save what the camera saw at each look as a BOP data set in the run folder (bop/), without truth: the seed is
            the scene, the look the image.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("pack", options, *_run("pack", options, progress))


def trials(
    *,
    trials: Optional[int] = None,
    seed: Optional[int] = None,
    scene: Optional[Union[Path, Sequence[Path]]] = None,
    conditions: Optional[Union[str, Sequence[str]]] = None,
    estimators: Optional[Union[Estimator, Sequence[Estimator], Mapping[str, Estimator]]] = None,
    graspers: Optional[Union[Grasper, Sequence[Grasper], Mapping[str, Grasper]]] = None,
    detector: Optional[Literal["pyramid", "clusters", "none"]] = None,
    detector_model: Optional[Path] = None,
    providers: Optional[Union[str, Sequence[str]]] = None,
    min_confidence: Optional[float] = None,
    grasps: Optional[Path] = None,
    renderer: Optional[Literal["auto", "wgpu", "cpu"]] = None,
    ycb: Optional[Path] = None,
    objects: Optional[Union[Path, Sequence[Path]]] = None,
    intrinsics: Optional[str] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    out: Optional[Path] = None,
    jobs: Optional[int] = None,
    resume: bool = False,
    shard: Optional[str] = None,
    record: Optional[Literal["none", "failures", "events", "full", "mcap"]] = None,
    record_rate: Optional[int] = None,
    progress: Optional[bool] = None,
) -> Trials:
    r"""Run many trials: scenes, conditions, estimators and grasp planners with the same seeds; can be killed, resumed and
    split.

    Args:
        trials: Trials of each scene, condition, estimator and grasp planner: one a seed, from --seed on. Default: 10.
        seed: The first seed. Default: 1.
        scene: Scene files [default: scenes/grocery.toml].
        conditions: Conditions, by name or file, separated by commas. Default: base.
        estimators: Estimators, separated by commas or each behind an option of its own: grip, paper, paper-guarded, truth,
            csv:FILE, cmd:PROGRAM ARGUMENTS, NAME=cmd:PROGRAM ARGUMENTS. Default: grip.
        graspers: Grasp planners, separated by commas or each behind an option of its own: grip, cmd:PROGRAM ARGUMENTS,
            NAME=cmd:PROGRAM ARGUMENTS (docs/graspers.md). Default: grip.
        detector: Who proposes boxes. Default: pyramid.
        detector_model: The detector's network: `varied`, trained on every light, heaps and other cameras; `base`, on what the paper
            trains on; or an ONNX file with a description of the same name beside it (.json) [default: varied].
        providers: Execution providers of the native ONNX Runtime that ORT_DYLIB_PATH names, in order: cpu, cuda, tensorrt,
            rocm, openvino, directml, coreml, xnnpack. Without ORT_DYLIB_PATH networks run in tract, which is built in.
        min_confidence: Throw away boxes of a lower confidence, whoever proposes them, and do not look for an object of which none
            is left: hard detections, as the filter SUM has them. GRIP keeps all. Default: 0.
        grasps: Folder of grasps to use instead of those that are found.
        renderer: Who draws: `auto` takes wgpu where a graphics adapter exists, else the CPU. Default: auto.
        ycb: Folder of scanned objects [env: GRIP_YCB_DIR].
        objects: Table of objects of your own (docs/objects.md), beside the built-in ones; may be given more than once.
        intrinsics: Another camera than the scenes': FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's
            camera.json.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        out: Folder of the experiment. Default: runs/trials.
        jobs: Trials run at the same time [default: one a core]; results do not depend on it.
        resume: Go on with the experiment in the folder.
        shard: Run only every N-th seed, beginning with the I-th; `grip merge` puts the shards together.
        record: What to keep of what is known of each trial, in a folder of its own in records/ (docs/recordings.md).
            Default: failures.
        record_rate: Samples of a recording a simulated second: joints, forces, poses. Default: 20.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("trials", options, *_run("trials", options, progress))


def merge(
    folders: Union[Path, Sequence[Path]],
    *,
    out: Path,
    progress: Optional[bool] = None,
) -> Trials:
    r"""Put the shards of an experiment together.

    Args:
        folders: Folders of an experiment's shards.
        out: Folder of the whole experiment.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("merge", options, *_run("merge", options, progress))


def sweep(
    names: Optional[Union[str, Sequence[str]]] = None,
    *,
    axes: Optional[Union[Literal["x", "y", "z", "roll", "pitch", "yaw"], Sequence[Literal["x", "y", "z", "roll", "pitch", "yaw"]]]] = None,
    range: Optional[Union[float, Sequence[float]]] = None,
    mode: Optional[Literal["axis", "isotropic"]] = None,
    samples: Optional[int] = None,
    seeds: Optional[int] = None,
    seed: Optional[int] = None,
    grasp: Optional[Literal["planned", "fixed"]] = None,
    friction: Optional[float] = None,
    force: Optional[float] = None,
    motions: bool = False,
    scene: Optional[Union[Path, Mapping[str, Any]]] = None,
    ycb: Optional[Path] = None,
    objects: Optional[Union[Path, Sequence[Path]]] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    out: Optional[Path] = None,
    jobs: Optional[int] = None,
    resume: bool = False,
    progress: Optional[bool] = None,
) -> Sweep:
    r"""Try grasps under known pose errors: what error does a grasp forgive?.

    Args:
        names: Objects by name [default: soup can, meat can, cracker box, mustard, banana, marker].
        axes: Directions of the gripper's frame: x approach, y closing, z sideways, and turns about them. Default:
            x,y,z,roll,pitch,yaw.
        range: Largest error in each direction: millimetres and degrees. Default: 40,45.
        mode: Errors: along one axis after the other, evenly from end to end, or at random in all six. Default: axis.
        samples: Errors along each axis, or random errors a layout [default: 9, or 20].
        seeds: Layouts of each object, one a seed: where it stands or lies, and so which grasp is chosen. Default: 50.
        seed: The first seed. Default: 1.
        grasp: Which grasp is tried. Default: planned.
        friction: Coulomb friction between pads and objects: both get this coefficient in place of their own, the objects
            against the table, too. The force that is taken by default follows it.
        force: Force of each finger, newtons, in place of what weight and friction need.
        motions: Also write what another simulator needs to try the same grasps: MJCF files of hand, table and object
            (mjcf/OBJECT.xml), and with each grasp the hand's motion.
        scene: Scene whose table, region and robot are used [default: scenes/grocery.toml].
        ycb: Folder of scanned objects [env: GRIP_YCB_DIR].
        objects: Table of objects of your own (docs/objects.md), beside the built-in ones; may be given more than once.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        out: Folder of the sweep. Default: runs/sweep.
        jobs: Grasps tried at the same time [default: one a core]; results do not depend on it.
        resume: Go on with the sweep in the folder.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("sweep", options, *_run("sweep", options, progress))


def report(
    sources: Union[Path, Sequence[Path]],
    *,
    out: Optional[Path] = None,
    progress: Optional[bool] = None,
) -> None:
    r"""Make a page, and CSV files, of experiments, sweeps and single runs.

    Args:
        sources: Folders that trials, merge, sweep, campaign and pack have made, and figures (SVG) to show with them.
        out: The page; CSV files get its name. Default: runs/report.html.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    _results.of("report", options, *_run("report", options, progress))


def plan(
    problems: Path,
    *,
    seed: Optional[int] = None,
    jobs: Optional[int] = None,
    out: Optional[Path] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    progress: Optional[bool] = None,
) -> dict[str, Any]:
    r"""Solve motion planning problems of MotionBenchMaker (MoveIt's YAML) and check the solutions.

    Args:
        problems: Folder of requestNNNN.yaml and sceneNNNN.yaml, or of such folders.
        seed: Seed of the search; each problem draws its own stream from it. Default: 1.
        jobs: Problems solved at the same time; times are those of one core only with 1. Default: 1.
        out: Folder for the trajectories [default: none is written]: of each solved problem NAME.json, NAME.yaml (ROS 2's
            trajectory_msgs/msg/JointTrajectory) and NAME.png (start, goal and the path of the hand), and plan.json,
            what --json prints. An earlier one there is replaced.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("plan", options, *_run("plan", options, progress))


def render(
    scene: Optional[Union[Path, Mapping[str, Any]]] = None,
    *,
    seed: Optional[int] = None,
    renderer: Optional[Literal["auto", "wgpu", "cpu"]] = None,
    ycb: Optional[Path] = None,
    objects: Optional[Union[Path, Sequence[Path]]] = None,
    intrinsics: Optional[str] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    condition: Optional[str] = None,
    out: Optional[Path] = None,
    progress: Optional[bool] = None,
) -> None:
    r"""Draw what the head camera sees of a scene.

    Args:
        scene: Scene file [default: scenes/grocery.toml].
        seed: Seed of everything random in the run. Default: 1.
        renderer: Who draws: `auto` takes wgpu where a graphics adapter exists, else the CPU. Default: auto.
        ycb: Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
        objects: Table of objects of your own (docs/objects.md), beside the built-in ones; may be given more than once.
        intrinsics: Another camera than the scene's: FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's
            camera.json.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        condition: Condition by name, from the folder `conditions` beside the scene file, or a path to a .toml file. Default:
            base.
        out: Folder for the pictures. Default: runs/render.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    _results.of("render", options, *_run("render", options, progress))


def scenes(
    scene: Optional[Union[Path, Mapping[str, Any]]] = None,
    *,
    seed: Optional[int] = None,
    renderer: Optional[Literal["auto", "wgpu", "cpu"]] = None,
    ycb: Optional[Path] = None,
    intrinsics: Optional[str] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    out: Optional[Path] = None,
    scenes: Optional[int] = None,
    views: Optional[Union[str, Sequence[str]]] = None,
    camera: Optional[Literal["head", "all", "sphere"]] = None,
    profile: Optional[Literal["standard", "hard"]] = None,
    shiny: Optional[float] = None,
    depth_noise: Optional[str] = None,
    distortion: Optional[Union[float, Sequence[float]]] = None,
    split: Optional[str] = None,
    format: Optional[Literal["bop"]] = None,
    resume: bool = False,
    jobs: Optional[int] = None,
    preview: bool = False,
    objects: Optional[Union[Path, Sequence[Path]]] = None,
    progress: Optional[bool] = None,
) -> DataSet:
    r"""Make a BOP data set of the scene: the paper's adversarial set, or training data.

    Args:
        seed: Seed of everything random in the run. Default: 1.
        renderer: Who draws: `auto` takes wgpu where a graphics adapter exists, else the CPU. Default: auto.
        ycb: Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
        intrinsics: Another camera than the scene's: FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's
            camera.json.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        out: Folder of the data set; one that is unfinished is gone on with by --resume. Default: runs/scenes.
        scenes: How many scenes: each with its own objects, surroundings and light. Default: 40.
        views: Frames of each scene: B, D, D1, D2, O1, O2, O3 of the paper (base, dark, light-left, light-right, clutter-1
            to clutter-3), or NAME=CONDITION. Frames whose condition spreads the objects show the same poses. Default:
            B,D,D1,D2,O1,O2,O3.
        camera: Where the camera is: where the scene has it, the robot's head or a place of its own; there and at each of
            the scene's `[[cameras]]`, which take pictures of the same; or anywhere on the scene's `camera.sphere`, anew
            for each frame. Default: head.
        profile: Who takes the pictures. Default: standard.
        shiny: Chance of each object, anew in each frame, to shine as metal does: depth lacks 20 to 80 % of it, in pieces.
            Default: 0.
        depth_noise: Depth camera in place of the scene's: none, nguyen, handa, redwood, carmine-109, carmine-109-near, xtion,
            fetch-head, d435; with --profile hard in place of any of the last three and carmine-109.
        distortion: Lens distortion by OpenCV's coefficients k1,k2,p1,p2,k3; pictures, masks and depth are all distorted.
        split: Name of the split's folder. Default: test.
        format: Format of the data set. Default: bop.
        resume: Keep the scenes that are there already and make the rest.
        jobs: Scenes made at a time [default: one a core]; the files do not depend on it.
        preview: Write preview.png, a contact sheet, too; for a BOP set that is whole already, ours or not, write only that.
        scene: Scene file [default: scenes/adversarial.toml].
        objects: Objects to draw from, by name, separated by commas [default: the scene's]; and tables of objects of your own
            (docs/objects.md), beside the built-in ones; may be given more than once.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("scenes", options, *_run("scenes", options, progress))


def detect(
    input: Path,
    *,
    detector_model: Optional[Path] = None,
    providers: Optional[Union[str, Sequence[str]]] = None,
    min_confidence: Optional[float] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    split: Optional[str] = None,
    top: Optional[int] = None,
    heatmaps: Optional[Path] = None,
    out: Optional[Path] = None,
    jobs: Optional[int] = None,
    progress: Optional[bool] = None,
) -> dict[str, Any]:
    r"""Find objects by PyramidCNN, the first stage: boxes and heat maps of an image, or boxes of a data set and what they
    are worth.

    Args:
        input: A picture (PNG or JPEG), or the folder of a data set in BOP's format.
        detector_model: The detector's network: `varied`, trained on every light, heaps and other cameras; `base`, on what the paper
            trains on; or an ONNX file with a description of the same name beside it (.json) [default: varied].
        providers: Execution providers of the native ONNX Runtime that ORT_DYLIB_PATH names, in order: cpu, cuda, tensorrt,
            rocm, openvino, directml, coreml, xnnpack. Without ORT_DYLIB_PATH networks run in tract, which is built in.
        min_confidence: Throw away boxes of a lower confidence, whoever proposes them, and do not look for an object of which none
            is left: hard detections, as the filter SUM has them. GRIP keeps all. Default: 0.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        split: Split of the data set, such as test or train_pbr [default: test, else the first there is].
        top: Boxes that are shown of a picture, the most confident of all objects. Default: 10.
        heatmaps: Draw heat maps, PNG: of a picture into this file, of a data set into this folder.
        out: Write the boxes of a data set to this file, the 100 most confident of each object and image, in COCO's
            format: for `grip estimate --boxes FILE` and others' tools.
        jobs: Threads [default: all cores].
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("detect", options, *_run("detect", options, progress))


def estimate(
    dataset: Path,
    *,
    split: Optional[str] = None,
    boxes: Optional[str] = None,
    detector_model: Optional[Path] = None,
    providers: Optional[Union[str, Sequence[str]]] = None,
    min_confidence: Optional[float] = None,
    estimator: Optional[Estimator] = None,
    track: bool = False,
    absent: Optional[int] = None,
    hypotheses: Optional[Literal["cpu", "gpu", "auto"]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    seed: Optional[int] = None,
    out: Optional[Path] = None,
    posteriors: Optional[Path] = None,
    resume: bool = False,
    jobs: Optional[int] = None,
    progress: Optional[bool] = None,
) -> Estimates:
    r"""Estimate the poses of a data set in BOP's format.

    Args:
        dataset: Folder of the data set, in BOP's format.
        split: Split, such as test or train_pbr [default: test, else the first there is].
        boxes: Where to look for objects: `pyramid` (PyramidCNN's boxes), `clusters` (what stands on the support), `none`,
            `gt` (boxes of the truth), `jittered` (those moved by 10 % of their sides, among four false ones each), or a
            .json file of detections in COCO's format [default: pyramid; for cmd: none].
        detector_model: The detector's network: `varied`, trained on every light, heaps and other cameras; `base`, on what the paper
            trains on; or an ONNX file with a description of the same name beside it (.json) [default: varied].
        providers: Execution providers of the native ONNX Runtime that ORT_DYLIB_PATH names, in order: cpu, cuda, tensorrt,
            rocm, openvino, directml, coreml, xnnpack. Without ORT_DYLIB_PATH networks run in tract, which is built in.
        min_confidence: Throw away boxes of a lower confidence, whoever proposes them, and do not look for an object of which none
            is left: hard detections, as the filter SUM has them. GRIP keeps all. Default: 0.
        estimator: Who estimates: `grip`; `paper`, the filter of the GRIP paper to the letter, 400 iterations of which take
            about five seconds of one core a pose; `paper-guarded`, the same with guards that the paper leaves out,
            without which it does not converge; or `cmd:PROGRAM ARGUMENTS`, a program that is asked of each image
            (docs/estimators.md). Default: grip.
        track: Follow objects through each scene, whose images are a sequence in the order of their numbers: what is
            believed in one is where to look in the next. (--resume goes on with whole scenes.).
        absent: Look for so many objects an image that are not in it, too, in boxes of others: `grip eval` then tells how
            well confidence tells present from absent ones. Default: 0.
        hypotheses: Who renders pose hypotheses. Default: cpu.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        seed: Seed of everything random. Default: 1.
        out: Where the results go: a CSV file as the BOP challenge has it; an older one is replaced. Default:
            runs/results.csv.
        posteriors: Also write where each object may be and how far off, as JSON, a line an estimate; for grip eval
            --posteriors.
        resume: Go on with a run that was stopped.
        jobs: Threads [default: all cores].
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("estimate", options, *_run("estimate", options, progress))


def evaluate(
    dataset: Path,
    results: Union[Path, Sequence[Path]],
    *,
    split: Optional[str] = None,
    errors: Optional[Path] = None,
    posteriors: Optional[Path] = None,
    figure: Optional[Path] = None,
    paper: bool = False,
    progress: Optional[bool] = None,
) -> Evaluation:
    r"""Measure the errors of a results file against the truth of its data set.

    Args:
        dataset: Folder of the data set, in BOP's format.
        results: Pose estimates, CSV files as the BOP challenge has them.
        split: Split, such as test or train_pbr [default: test, else the first there is].
        errors: Also write the errors of every instance to this CSV file; for one results file.
        posteriors: Also tell whether these posteriors (of grip estimate --posteriors) hold the truth as often as they say; for
            one results file.
        figure: Also draw the share of instances under a threshold against the threshold, 0 to 4 cm, a curve a results file;
            SVG.
        paper: Print the table of the GRIP paper instead: its objects, views and metrics, beside its own figures.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("eval", options, *_run("eval", options, progress))


def explain(
    dataset: Path,
    results: Path,
    *,
    split: Optional[str] = None,
    scene: Union[Path, Mapping[str, Any]],
    image: int,
    all: bool = False,
    truth: bool = False,
    out: Optional[Path] = None,
    progress: Optional[bool] = None,
) -> dict[str, Any]:
    r"""Draw a picture that explains the pose estimates of one image.

    Args:
        dataset: Folder of the data set, in BOP's format.
        results: Pose estimates, a CSV file as the BOP challenge has it.
        split: Split, such as test or train_pbr [default: test, else the first there is].
        scene: Number of the scene.
        image: Number of the image.
        all: Draw estimates with a confidence below 0.05, too; without it they are listed only.
        truth: Draw the outlines of the truth, too, thin and dashed.
        out: The picture, PNG; an older one is replaced. Default: runs/explain.png.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("explain", options, *_run("explain", options, progress))


def convergence(
    dataset: Path,
    *,
    split: Optional[str] = None,
    scene: Union[Path, Mapping[str, Any]],
    image: int,
    object: Optional[Union[int, Sequence[int]]] = None,
    estimator: Optional[Union[str, Sequence[str]]] = None,
    seeds: Optional[int] = None,
    boxes: Optional[str] = None,
    detector_model: Optional[Path] = None,
    providers: Optional[Union[str, Sequence[str]]] = None,
    min_confidence: Optional[float] = None,
    out: Optional[Path] = None,
    progress: Optional[bool] = None,
) -> dict[str, Any]:
    r"""Draw how searches converge: error of the best pose against iterations and time.

    Args:
        dataset: Folder of the data set, in BOP's format.
        split: Split, such as test or train_pbr [default: test, else the first there is].
        scene: Number of the scene.
        image: Number of the image.
        object: Numbers of objects, separated by commas [default: all in the image].
        estimator: Who searches: grip, paper or paper-guarded, with a TOML file of settings that are not to be the defaults
            where there is one (paper=fewer.toml); may be given more than once. Default: grip,paper-guarded,paper.
        seeds: Searches of each object, with the seeds 1 to N. Default: 3.
        boxes: Where to look for objects, as for `grip estimate`. Default: jittered.
        detector_model: The detector's network: `varied`, trained on every light, heaps and other cameras; `base`, on what the paper
            trains on; or an ONNX file with a description of the same name beside it (.json) [default: varied].
        providers: Execution providers of the native ONNX Runtime that ORT_DYLIB_PATH names, in order: cpu, cuda, tensorrt,
            rocm, openvino, directml, coreml, xnnpack. Without ORT_DYLIB_PATH networks run in tract, which is built in.
        min_confidence: Throw away boxes of a lower confidence, whoever proposes them, and do not look for an object of which none
            is left: hard detections, as the filter SUM has them. GRIP keeps all. Default: 0.
        out: The figure, SVG; an older one is replaced. Default: runs/convergence.svg.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("convergence", options, *_run("convergence", options, progress))


def reproduce(
    what: Literal["table1"],
    *,
    out: Optional[Path] = None,
    methods: Optional[Union[str, Sequence[str]]] = None,
    scenes: Optional[int] = None,
    seed: Optional[int] = None,
    real: Optional[Path] = None,
    progress: Optional[bool] = None,
) -> dict[str, Any]:
    r"""Redo a table of the GRIP paper: scenes, every method, the table, in one command that can be stopped and run again.

    Args:
        what: What: `table1`, the areas under the accuracy curve of 15 objects in three settings.
        out: Folder of the data set, the poses and the table; what the same command made there before is kept. Default:
            runs/table1.
        methods: Methods, separated by commas or each behind an option of its own: grip; paper-guarded, the filter of the
            paper with its guards; sum, that over hard detections; paper, the filter to the letter; or a program of your
            own, NAME=cmd:PROGRAM ARGUMENTS. Default: grip,paper-guarded,sum.
        scenes: Scenes, seven frames each. Default: 40.
        seed: Seed of the scenes. Default: 901.
        real: A data set of real frames that the same methods estimate, too.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("reproduce", options, *_run("reproduce", options, progress))


def grasps(
    names: Optional[Union[str, Sequence[str]]] = None,
    *,
    out: Optional[Path] = None,
    preview: Optional[Path] = None,
    ycb: Optional[Path] = None,
    objects: Optional[Union[Path, Sequence[Path]]] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    progress: Optional[bool] = None,
) -> Any:
    r"""Find the grasps of objects and save them as files, for `pack --grasps` and for other programs.

    Args:
        names: Objects, by name [default: all of the table].
        out: Folder for one file an object [default: none is written]; an earlier one there is replaced.
        preview: Picture for people: each object from two sides with outlines of the gripper, coloured by the share of the
            pads that touches.
        ycb: Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
        objects: Table of objects of your own (docs/objects.md), beside the built-in ones; may be given more than once.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("grasps", options, *_run("grasps", options, progress))


def export(
    scene: Optional[Union[Path, Mapping[str, Any]]] = None,
    *,
    seed: Optional[int] = None,
    renderer: Optional[Literal["auto", "wgpu", "cpu"]] = None,
    ycb: Optional[Path] = None,
    objects: Optional[Union[Path, Sequence[Path]]] = None,
    intrinsics: Optional[str] = None,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    settings: Optional[Union[Settings, Mapping[str, Any], Path]] = None,
    condition: Optional[str] = None,
    mjcf: Optional[Path] = None,
    hand: bool = False,
    progress: Optional[bool] = None,
) -> None:
    r"""Write a settled scene for another program: MuJoCo's MJCF.

    Args:
        scene: Scene file [default: scenes/grocery.toml].
        seed: Seed of everything random in the run. Default: 1.
        renderer: Who draws: `auto` takes wgpu where a graphics adapter exists, else the CPU. Default: auto.
        ycb: Folder of scanned objects (official YCB layout, or a BOP `models` folder) [env: GRIP_YCB_DIR].
        objects: Table of objects of your own (docs/objects.md), beside the built-in ones; may be given more than once.
        intrinsics: Another camera than the scene's: FX,FY,CX,CY,WIDTH,HEIGHT in pixels, a ROS calibration (.yaml), or BOP's
            camera.json.
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        settings: Settings that are not to be the defaults: any part of the tree that `grip settings` prints, TOML.
        condition: Condition by name, from the folder `conditions` beside the scene file, or a path to a .toml file. Default:
            base.
        mjcf: MJCF file: the scene with its objects at rest, in convex pieces, and the robot with a drive on each joint.
            Default: runs/scene.xml.
        hand: The hand alone, as a heavy free body, in place of the whole robot.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    _results.of("export", options, *_run("export", options, progress))


def convert(
    recording: Path,
    *,
    out: Path,
    progress: Optional[bool] = None,
) -> None:
    r"""Make one MCAP file of a recording, for Foxglove, Rerun and whatever else reads that.

    Args:
        recording: A recording at level full: the folder record/ of a run, the run's folder, or a folder in records/ of an
            experiment.
        out: The MCAP file (docs/mcap.md); an earlier one is replaced.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    _results.of("convert", options, *_run("convert", options, progress))


def robot(
    *,
    robot: Optional[Path] = None,
    robot_config: Optional[Path] = None,
    package_path: Optional[Union[Path, Sequence[Path]]] = None,
    check: bool = False,
    draw: Optional[Path] = None,
    scene: Optional[Union[Path, Mapping[str, Any]]] = None,
    find_allowed: bool = False,
    write_config: Optional[Path] = None,
    progress: Optional[bool] = None,
) -> dict[str, Any]:
    r"""Show the robot: what was loaded, joints, limits.

    Args:
        robot: URDF [default: the scene's; robots/fetch/fetch.urdf where there is none].
        robot_config: What the URDF does not say: groups, poses, limits, gripper (robots/README.md) [default: the scene's;
            robots/fetch/fetch.toml where there is none].
        package_path: Where `package://` meshes are looked up; may be given more than once.
        check: Check the robot in a scene: named poses for collisions, and the share of grasps and places that it reaches;
            ends with 1 where something does not fit.
        draw: Draw its named poses, from the front and from the side, in a scene: PNG.
        scene: The scene for `--check` and `--draw` [default: scenes/grocery.toml].
        find_allowed: Print `[self_collision]` with the pairs of links that may touch, found by sampling, and nothing else.
        write_config: Write a first file for `--robot-config`, guessed from the URDF, to be checked by a person; none may be
            there.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    options["json"] = True
    return _results.of("robot", options, *_run("robot", options, progress))


def init(
    folder: Path,
    *,
    progress: Optional[bool] = None,
) -> None:
    r"""Write the scenes, conditions, objects and robot that are built into the program to a folder, to be edited.

    Args:
        folder: The folder: a new or an empty one.
        progress: Whether to show a bar, which needs tqdm. Default: where tqdm is installed.

    Raises:
        Error: With the text that the command prints.
    """
    options = {key: value for key, value in locals().items() if key != "progress" and value is not False}
    _results.of("init", options, *_run("init", options, progress))
