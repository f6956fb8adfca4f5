#!/usr/bin/env python3
"""Point pair features, voting and ICP, by OpenCV contrib: a classical estimator of shape alone (docs/estimators.md).

Drost et al., "Model Globally, Match Locally", CVPR 2010. Each object is matched with all that stands on the largest plane; the pose
that explains most points counts, and they are taken away for the next of its kind. Needs opencv-contrib-python-headless, scipy and trimesh.
"""

import json
import os
import sys

import cv2
import numpy as np
import trimesh
from scipy.spatial import cKDTree

# What libraries print is no answer: it goes to stderr, and so to the log.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
# Where there is no reading there is no number.
np.seterr(invalid="ignore", divide="ignore")

NEAR = 0.005  # metres from the model's surface: explained
CANDIDATES = 8  # poses an object that are refined


def prepared(model):
    """The detector of an object, its surface as points with normals, metres, and a tree to find the nearest of them."""
    mesh = trimesh.load(model["mesh"], force="mesh", process=False)
    points, faces = trimesh.sample.sample_surface(mesh, 4000, seed=1)
    surface = np.hstack([points / 1000, mesh.face_normals[faces]]).astype(np.float32)
    detector = cv2.ppf_match_3d_PPF3DDetector(0.08, 0.08, 30)
    detector.trainModel(surface)
    return detector, surface, cKDTree(surface[:, :3])


def scene_of(look):
    """What stands on the largest plane, as points with normals towards the camera, in its frame."""
    depth = np.load(look["depth"]).astype(float)
    K = np.array(look["K"]).reshape(3, 3)
    v, u = np.indices(depth.shape)
    depth[depth <= 0] = np.nan
    p = np.stack([(u - K[0, 2]) * depth / K[0, 0], (v - K[1, 2]) * depth / K[1, 1], depth], axis=2)
    known = np.isfinite(p)
    smooth = cv2.blur(np.where(known, p, 0), (5, 5)) / cv2.blur(known.astype(float), (5, 5))
    n = np.cross(np.gradient(smooth, axis=1), np.gradient(smooth, axis=0))
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    n *= -np.sign(np.sum(n * p, axis=2, keepdims=True))
    points = np.concatenate([p, n], axis=2)[::2, ::2].reshape(-1, 6)
    points = points[np.isfinite(points).all(axis=1)]
    if look["space"]:
        pose = look["world_from_camera"]
        world = points[:, :3] @ np.array(pose["R"]).reshape(3, 3).T + pose["t"]
        points = points[np.all((world > look["space"]["min"]) & (world < look["space"]["max"]), axis=1)]
    return points[above_plane(points)].astype(np.float32)


def above_plane(points):
    """Which points are nearer to the camera than the plane that most points with its normal are on."""
    random, best, above = np.random.default_rng(1), 0, np.ones(len(points), bool)
    for i in random.integers(0, len(points), 300 if len(points) else 0):
        normal = points[i, 3:]
        height = (points[:, :3] - points[i, :3]) @ normal
        on_it = np.count_nonzero((np.abs(height) < 0.006) & (points[:, 3:] @ normal > 0.95))
        if on_it > best:
            best, above = on_it, height > 0.008
    return above


def explained(scene, tree, surface, pose):
    """Which points of the scene lie on the object's surface."""
    local = (scene[:, :3] - pose[:3, 3]) @ pose[:3, :3]
    distance, nearest = tree.query(local, distance_upper_bound=NEAR)
    near = np.isfinite(distance)
    near[near] = np.sum((scene[near, 3:] @ pose[:3, :3]) * surface[nearest[near], 3:], axis=1) > 0.7
    return near


def locate(model, scene):
    """Camera from object and the points that it explains, of the best pose; none where there is no match."""
    detector, surface, tree = model
    if len(scene) < 100:
        return None
    found = detector.match(scene, 0.1, 0.05)[:CANDIDATES]
    if not found:
        return None
    icp = cv2.ppf_match_3d_ICP(50, 0.01, 2.5, 4)
    _, found = icp.registerModelToScene(surface, scene, found)
    candidates = [(pose.pose, explained(scene, tree, surface, pose.pose)) for pose in found]
    return max(candidates, key=lambda candidate: np.count_nonzero(candidate[1]))


def main():
    models = {}
    for line in sys.stdin:
        message = json.loads(line)
        if message["type"] == "hello":
            models = {model["obj_id"]: prepared(model) for model in message["models"]}
            answer = {"type": "hello", "protocol": 1, "name": "opencv-ppf", "version": cv2.__version__}
        else:
            scene, poses, left = scene_of(message), [], list(message["objects"])
            while left:
                found = [(locate(models[asked["obj_id"]], scene), k) for k, asked in enumerate(left)]
                found = [(np.count_nonzero(best[1]), k, *best) for best, k in found if best]
                if not found:
                    break
                # What explains most goes first, and takes its points with it.
                count, k, pose, points = max(found, key=lambda f: (f[0], -f[1]))
                scene = scene[~points]
                R, t = pose[:3, :3].flatten().tolist(), pose[:3, 3].tolist()
                poses.append({"index": left.pop(k)["index"], "R": R, "t": t, "score": float(count)})
            answer = {"type": "poses", "id": message["id"], "poses": poses}
        print(json.dumps(answer), file=answers, flush=True)


main()
