#!/usr/bin/env python3
"""Checks a BOP data set against itself, without any code of this project.

    python3 tests/check_bop.py DATASET [--models-depth] [--max-median-mm 1.0]

Needs numpy and Pillow; where pycocotools or bop_toolkit_lib can be imported, their readers are tried too. Every file,
count, box, mask and matrix is compared with what it must be. With --models-depth each model is drawn at its pose by a
z-buffer of our own and compared with the depth pictures. Exits 1 when anything is wrong.
"""

import argparse
import json
import sys
from collections import defaultdict
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
from PIL import Image

SPLITS = ["test", "val", "train", "train_pbr"]
PLY_TYPES = {"float": "<f4", "double": "<f8", "int": "<i4", "uint": "<u4", "uchar": "u1"}
failures, checks = [], 0


def check(holds, message):
    """Counts a check and reports one that fails (the first hundred)."""
    global checks
    checks += 1
    if not holds:
        failures.append(message)
        if len(failures) <= 100:
            print("FAIL", message)
    return bool(holds)


def load_json(path):
    return json.loads(path.read_text()) if check(path.is_file(), f"{path}: is missing") else None


def is_rotation(values):
    r = np.resize(np.array(values, float), (3, 3))
    return np.size(values) == 9 and np.abs(r @ r.T - np.eye(3)).max() < 1e-4 and np.linalg.det(r) > 0


def toolkit_bbox(mask):
    """[x, y, w, h] with w and h the largest less the smallest index: BOP's convention."""
    rows, columns = np.nonzero(mask)
    if rows.size == 0:
        return [-1, -1, -1, -1]
    return [int(v) for v in (columns.min(), rows.min(), np.ptp(columns), np.ptp(rows))]


def load_ply(path):
    """Vertices (n, 3) in millimetres, triangles (m, 3) and the name of the texture; ASCII or little-endian binary."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    elements, texture, binary = [], None, False
    for line in data[:end].decode("ascii").splitlines():
        words = line.split()
        if words[:2] == ["comment", "TextureFile"]:
            texture = words[2]
        elif words[0] == "format":
            binary = words[1] == "binary_little_endian"
            assert binary or words[1] == "ascii", f"{path}: {words[1]} is not supported"
        elif words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property":
            elements[-1][2].append(words[1:])
    (_, count, properties), (_, faces, lists) = elements
    assert elements[1][0] == "face" and len(lists) == 1, f"{path}: unusual elements"
    names = [p[-1] for p in properties]
    if binary:
        vertex = np.dtype([(p[-1], PLY_TYPES[p[0]]) for p in properties])
        face = np.dtype([("n", PLY_TYPES[lists[0][1]]), ("i", PLY_TYPES[lists[0][2]], 3)])
        body = np.frombuffer(data, vertex, count, end)
        triangles = np.frombuffer(data, face, faces, end + count * vertex.itemsize)
        check(end + count * vertex.itemsize + faces * face.itemsize == len(data), f"{path}: has a tail")
        check((triangles["n"] == 3).all(), f"{path}: has faces that are no triangles")
        points = np.stack([body[axis] for axis in "xyz"], 1).astype(float)
        if "nx" in names:
            squares = sum(body[axis] ** 2 for axis in ("nx", "ny", "nz"))
            check(np.abs(squares - 1).max() < 1e-3, f"{path}: normals are not of unit length")
        return points, triangles["i"].astype(int), texture
    lines = [line.split() for line in data[end:].decode("ascii").splitlines()]
    points = np.array(lines[:count], float)[:, [names.index(axis) for axis in "xyz"]]
    return points, np.array(lines[count:count + faces])[:, 1:4].astype(int), texture


def diameter(points):
    """Largest distance of two points, exactly: both must lie farther out than a first guess leaves over."""
    points = np.unique(points, axis=0)
    directions = np.random.default_rng(0).normal(size=(500, 3))
    extreme = points[np.unique((points @ directions.T).argmax(0))]
    guess = max(np.linalg.norm(extreme - p, axis=1).max() for p in extreme)
    reach = np.linalg.norm(points - (points.min(0) + points.max(0)) / 2, axis=1)
    outer = points[reach >= guess - reach.max() - 1e-6]
    return max(np.linalg.norm(outer - p, axis=1).max() for p in outer)


def check_models(folder, tolerance_mm):
    """Every model against models_info.json; returns the models by object."""
    models = {}
    for key, info in (load_json(folder / "models_info.json") or {}).items():
        path = folder / f"obj_{int(key):06d}.ply"
        if not check(path.is_file(), f"{path}: is missing"):
            continue
        points, triangles, texture = load_ply(path)
        models[int(key)] = (points, triangles)
        check(triangles.min() >= 0 and triangles.max() < len(points), f"{path}: names vertices that do not exist")
        if texture is not None and check((folder / texture).is_file(), f"{folder / texture}: is missing"):
            Image.open(folder / texture).load()
        low, high = points.min(0), points.max(0)
        measured = {"diameter": diameter(points)}
        for axis, letter in enumerate("xyz"):
            measured[f"min_{letter}"], measured[f"size_{letter}"] = low[axis], high[axis] - low[axis]
        for field, value in measured.items():
            check(abs(info[field] - value) <= tolerance_mm, f"{path}: {field} {info[field]} is {value}")
        for turn in info.get("symmetries_discrete", []):
            m = np.array(turn, float).reshape(4, 4)
            check(is_rotation(m[:3, :3]) and (m[3] == [0, 0, 0, 1]).all(), f"object {key}: symmetry {turn} is no turn")
        for axis in info.get("symmetries_continuous", []):
            check(np.linalg.norm(axis["axis"]) > 0 and len(axis["offset"]) == 3, f"object {key}: axis {axis}")
    return models


def render(points, triangles, rotation, translation, k, shape):
    """Depth (mm) of a model at a pose, 0 where it is not; pixel centres at integers. None if it reaches the camera."""
    p = points @ rotation.T + translation
    if p[:, 2].min() < 1.0:
        return None
    height, width = shape
    inverse, nearest = 1.0 / p[:, 2], np.zeros(shape)
    u, v = k[0, 0] * p[:, 0] * inverse + k[0, 2], k[1, 1] * p[:, 1] * inverse + k[1, 2]
    # One over the depth is linear in the image, so it is interpolated there.
    for a, b, c in triangles:
        left, right = max(int(np.ceil(min(u[a], u[b], u[c]))), 0), min(int(max(u[a], u[b], u[c], -1)), width - 1)
        top, bottom = max(int(np.ceil(min(v[a], v[b], v[c]))), 0), min(int(max(v[a], v[b], v[c], -1)), height - 1)
        area = (u[b] - u[a]) * (v[c] - v[a]) - (u[c] - u[a]) * (v[b] - v[a])
        if left > right or top > bottom or abs(area) < 1e-12:
            continue
        x, y = np.arange(left, right + 1)[None], np.arange(top, bottom + 1)[:, None]
        wb = ((x - u[a]) * (v[c] - v[a]) - (u[c] - u[a]) * (y - v[a])) / area
        wc = ((u[b] - u[a]) * (y - v[a]) - (x - u[a]) * (v[b] - v[a])) / area
        wa = 1 - wb - wc
        value = wa * inverse[a] + wb * inverse[b] + wc * inverse[c]
        window = nearest[top:bottom + 1, left:right + 1]
        closer = (np.minimum(np.minimum(wa, wb), wc) >= -1e-9) & (value > window)
        window[closer] = value[closer]
    return np.divide(1.0, nearest, out=np.zeros(shape), where=nearest > 0)


def picture(path, modes):
    if not check(path.is_file(), f"{path}: is missing"):
        return None
    image = Image.open(path)
    check(image.mode in modes, f"{path}: has the mode {image.mode}")
    return np.array(image)


def rle_decode(rle):
    """Column after column, the first run is not set."""
    values = np.repeat(np.arange(len(rle["counts"])) % 2 == 1, rle["counts"])
    height, width = rle["size"]
    return values.reshape(width, height).T if values.size == height * width else None


def check_masks(name, info, mask, seen, depth):
    """Both masks of an instance against each other and against its counts."""
    check(np.isin([mask, seen], (0, 255)).all(), f"{name}: masks have values between 0 and 255")
    mask, seen = mask > 0, seen > 0
    check(not (seen & ~mask).any(), f"{name}: mask_visib leaves mask")
    if info is None:
        return
    count, inside = int(seen.sum()), int(mask.sum())
    everything, x, y, w, h = info["px_count_all"], *info["bbox_obj"]
    check(info["px_count_visib"] == count, f"{name}: px_count_visib {info['px_count_visib']} is {count}")
    check(everything >= inside, f"{name}: px_count_all {everything} is less than the {inside} pixels of mask")
    valid = int((mask & (depth > 0)).sum())
    check(info["px_count_valid"] == valid, f"{name}: px_count_valid {info['px_count_valid']} is {valid}")
    fraction = count / everything if everything else 0.0
    check(abs(info["visib_fract"] - fraction) < 1e-9, f"{name}: visib_fract {info['visib_fract']} is {fraction}")
    check(info["bbox_visib"] == toolkit_bbox(seen), f"{name}: bbox_visib {info['bbox_visib']} is {toolkit_bbox(seen)}")
    if count == 0:
        return check(info["bbox_obj"] == [-1] * 4, f"{name}: bbox_obj of a hidden object is {info['bbox_obj']}")
    # Only the part of the silhouette in the image can be seen here.
    height, width = mask.shape
    left, top, inner_w, inner_h = toolkit_bbox(mask)
    cut = x < 0 or y < 0 or x + w >= width or y + h >= height
    within = x <= left and y <= top and left + inner_w <= x + w and top + inner_h <= y + h
    check(within if cut else [x, y, w, h] == toolkit_bbox(mask), f"{name}: bbox_obj {info['bbox_obj']} is not that of mask")
    check(cut == (everything > inside), f"{name}: px_count_all {everything}, mask {inside}, bbox_obj {info['bbox_obj']}")


def check_evaluation_models(root, models, tolerance_mm):
    """The models for evaluation: the same numbers, sizes and symmetries as the others, and vertices spread evenly, within 0.3 mm."""
    check(load_json(root / "models_eval" / "models_info.json") == load_json(root / "models" / "models_info.json"),
          f"{root / 'models_eval'}: models_info.json differs from that of models")
    for key, (points, triangles) in check_models(root / "models_eval", max(tolerance_mm, 0.6)).items():
        corners = points[triangles]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        check(edges.max() <= 9.01, f"object {key}: an edge of {edges.max()} mm in models_eval")
        area = lambda p, t: np.linalg.norm(np.cross(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]]), axis=1).sum()
        whole = area(*models[key])
        check(abs(area(points, triangles) - whole) <= 0.02 * whole, f"object {key}: another surface in models_eval")


def check_image(scene, im_id, camera, truths, infos, models, arguments, errors):
    """One image; returns its visible masks and silhouettes, or None."""
    name = f"{scene.parent.name}/{scene.name} image {im_id}"
    names = [scene / f"{kind}/{im_id:06d}.{ending}" for kind in ("rgb", "gray") for ending in ("png", "jpg")]
    rgb = picture(next((path for path in names if path.is_file()), names[0]), ("RGB", "L"))
    raw = picture(scene / f"depth/{im_id:06d}.png", ("I", "I;16", "I;16B"))
    if rgb is None or raw is None or not check(rgb.shape[:2] == raw.shape, f"{name}: sizes of rgb and depth"):
        return None
    shape = raw.shape
    k = np.array(camera["cam_K"], float).reshape(3, 3)
    check((k[2] == [0, 0, 1]).all() and k[0, 0] > 0 and k[1, 1] > 0, f"{name}: cam_K {k.tolist()}")
    turn, t = camera.get("cam_R_w2c", np.eye(3)), camera.get("cam_t_w2c", [0, 0, 0])
    check(is_rotation(turn) and len(t) == 3, f"{name}: pose of the camera {turn} {t}")
    depth = raw * float(camera["depth_scale"])
    check(infos is None or len(infos) == len(truths), f"{name}: scene_gt and scene_gt_info differ in length")
    taken = np.zeros(shape, int)
    silhouettes, visible = [], []
    for index, truth in enumerate(truths):
        who = f"{name} instance {index} (object {truth['obj_id']})"
        turn, t = np.array(truth["cam_R_m2c"], float), np.array(truth["cam_t_m2c"], float)
        check(is_rotation(turn) and t.shape == (3,) and np.isfinite(t).all(), f"{who}: not a pose")
        check(not models or truth["obj_id"] in models, f"{who}: there is no such model")
        files = [scene / f"{kind}/{im_id:06d}_{index:06d}.png" for kind in ("mask", "mask_visib")]
        if (scene / "mask").is_dir():
            mask, seen = (picture(path, ("L",)) for path in files)
            if mask is None or seen is None or not check(mask.shape == seen.shape == shape, f"{who}: size of masks"):
                continue
            check_masks(who, infos[index] if infos else None, mask, seen, raw)
            taken += seen > 0
            silhouettes, visible = silhouettes + [mask > 0], visible + [seen > 0]
        if arguments.models_depth and truth["obj_id"] in models:
            drawn = render(*models[truth["obj_id"]], turn.reshape(3, 3), t, k, shape)
            if drawn is None:
                continue
            # Without masks, whatever is drawn within 15 mm of the depth (BOP's tolerance) counts as visible.
            where = (visible[-1] if visible else np.abs(drawn - depth) < 15) & (drawn > 0) & (depth > 0)
            errors[truth["obj_id"]].append(np.abs(drawn - depth)[where])
            if silhouettes:
                differ = int((silhouettes[-1] ^ (drawn > 0)).sum())
                # Rasterisers may disagree along the outline alone.
                outline = sum(int((m[1:] ^ m[:-1]).sum()) for m in (silhouettes[-1], silhouettes[-1].T))
                check(differ <= 0.5 * outline + 4, f"{who}: mask and drawn model differ in {differ} pixels")
    check(taken.max(initial=0) <= 1, f"{name}: visible masks overlap in {int((taken > 1).sum())} pixels")
    return silhouettes, visible


def check_coco(path, base, masks):
    """A COCO file against the masks of its scene ({image id: (silhouettes, visible)}); None leaves the masks out."""
    coco = load_json(path)
    ids, categories = ([entry["id"] for entry in coco[kind]] for kind in ("annotations", "categories"))
    images = {image["id"]: image for image in coco["images"]}
    check(len(set(ids)) == len(ids) and len(images) == len(coco["images"]), f"{path}: ids are not unique")
    for image in images.values():
        check((base / image["file_name"]).is_file(), f"{path}: {image['file_name']} is missing")
    by_image = defaultdict(list)
    for annotation in coco["annotations"]:
        known = annotation["image_id"] in images and annotation["category_id"] in categories
        check(known, f"{path}: annotation {annotation['id']} is of no known image or category")
        mask = rle_decode(annotation["segmentation"])
        if check(mask is not None and mask.sum() == annotation["area"], f"{path}: runs of annotation {annotation['id']}"):
            by_image[annotation["image_id"]].append((annotation, mask))
    for im_id, (silhouettes, visible) in (masks or {}).items():
        shown = [(whole, seen) for whole, seen in zip(silhouettes, visible) if seen.any()]
        found = by_image[im_id]
        check(len(shown) == len(found), f"{path}: image {im_id} has {len(found)} annotations, {len(shown)} visible")
        for (whole, seen), (annotation, mask) in zip(shown, found):
            x, y, w, h = toolkit_bbox(whole)
            right = (mask == seen).all() and annotation["bbox"] == [x, y, w + 1, h + 1]
            check(right, f"{path}: annotation {annotation['id']} is not mask_visib in the box of mask")
    foreign_coco(path, by_image)


def foreign_coco(path, by_image):
    """The same file read by pycocotools, where it is installed."""
    try:
        from pycocotools.coco import COCO
    except ImportError:
        return
    with redirect_stdout(sys.stderr):
        loaded = COCO(str(path))
    for annotation, mask in (pair for pairs in by_image.values() for pair in pairs):
        same = (loaded.annToMask(annotation) == mask).all()
        check(same, f"{path}: pycocotools decodes annotation {annotation['id']} otherwise")


def foreign_bop(root, scenes):
    """The same files read by the BOP toolkit, where it is installed."""
    try:
        from bop_toolkit_lib import inout
    except ImportError:
        return "not installed"
    for scene in map(str, scenes):
        camera, truth = inout.load_scene_camera(f"{scene}/scene_camera.json"), inout.load_scene_gt(f"{scene}/scene_gt.json")
        check(camera.keys() == truth.keys(), f"{scene}: the toolkit finds other images")
    for path in sorted((root / "models").glob("obj_*.ply")):
        same = np.allclose(inout.load_ply(str(path))["pts"], load_ply(path)[0])
        check(same, f"{path}: the toolkit reads it otherwise")
    return "used"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--split", help="default: the first of test, val, train, train_pbr, else any that has scenes")
    parser.add_argument("--models-depth", action="store_true", help="draw the models and compare with the depth")
    parser.add_argument("--max-median-mm", type=float, default=1.0)
    parser.add_argument("--model-tolerance-mm", type=float, default=0.01, help="of sizes; thinned-out models need more")
    arguments = parser.parse_args()
    root = arguments.dataset
    splits = sorted({path.parent.parent.name for path in root.glob("*/[0-9]*/scene_camera.json")},
                    key=lambda name: (SPLITS + [name]).index(name))
    split = arguments.split or (splits[0] if splits else None)
    if split not in splits:
        sys.exit(f"{root}: no split {split or ''} with scenes; found: {', '.join(splits) or 'none'}")
    models = check_models(root / "models", arguments.model_tolerance_mm)
    if (root / "models_eval").is_dir():
        check_evaluation_models(root, models, arguments.model_tolerance_mm)
    sensor = load_json(root / "camera.json")
    missing = {"fx", "fy", "cx", "cy", "width", "height"} - set(sensor or {})
    check(not missing, f"{root}/camera.json: lacks {missing}")
    scenes = sorted(path.parent for path in root.glob(f"{split}/[0-9]*/scene_camera.json"))
    errors, images = defaultdict(list), {}
    for scene in scenes:
        cameras, truth = load_json(scene / "scene_camera.json"), load_json(scene / "scene_gt.json")
        infos = load_json(scene / "scene_gt_info.json") if (scene / "scene_gt_info.json").exists() else None
        if cameras is None or truth is None:
            continue
        same = cameras.keys() == truth.keys() and (infos is None or infos.keys() == truth.keys())
        check(same, f"{scene}: files list different images")
        masks = {}
        for key in sorted(cameras, key=int):
            found = check_image(scene, int(key), cameras[key], truth.get(key, []), infos and infos.get(key), models,
                                arguments, errors)
            images[int(scene.name), int(key)] = len(truth.get(key, []))
            if found is not None:
                masks[int(key)] = found
        if (scene / "scene_gt_coco.json").exists():
            check_coco(scene / "scene_gt_coco.json", scene, masks)
    if (root / "coco.json").exists():
        check_coco(root / "coco.json", root, None)
    for target in (load_json(root / "test_targets_bop19.json") or []) if split == "test" else []:
        check((target["scene_id"], target["im_id"]) in images, f"target {target}: there is no such image")
    toolkit = foreign_bop(root, scenes)
    print(f"{split}: {len(scenes)} scenes, {len(images)} images, {sum(images.values())} instances, {len(models)} models; "
          f"{checks} checks, {len(failures)} failed; bop_toolkit_lib {toolkit}")
    if arguments.models_depth:
        rows = [(f"object {obj_id:3}", np.concatenate(parts)) for obj_id, parts in sorted(errors.items())]
        every = np.concatenate([off for _, off in rows] + [np.empty(0)])
        for name, off in rows + [("all", every)]:
            median, p95 = np.percentile(off, (50, 95)) if off.size else (np.nan, np.nan)
            print(f"{name:10}: {off.size:8} pixels  median {median:6.2f} mm  p95 {p95:6.2f} mm")
        check(median <= arguments.max_median_mm, f"median {median:.2f} mm is above {arguments.max_median_mm} mm")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
