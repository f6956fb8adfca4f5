#!/usr/bin/env python3
"""Fast point feature histograms, RANSAC and ICP, by Open3D: a classical estimator of shape alone (docs/estimators.md).

Rusu et al., "Fast Point Feature Histograms (FPFH) for 3D Registration", ICRA 2009. Each object is matched with each segment of what
stands on the largest plane; the best fit counts, and what it explains is taken away for the next of its kind. Needs open3d.
"""

import json
import os
import sys

import numpy as np
import open3d as o3d

# What libraries print is no answer: it goes to stderr, and so to the log.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)

VOXEL = 0.005  # metres
FEWEST = 40  # points of a segment
registration = o3d.pipelines.registration


def prepared(cloud):
    """The cloud, thinned out, with normals, and its features."""
    cloud = cloud.voxel_down_sample(VOXEL)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=3 * VOXEL, max_nn=30))
    feature = registration.compute_fpfh_feature(cloud, o3d.geometry.KDTreeSearchParamHybrid(radius=5 * VOXEL, max_nn=100))
    return cloud, feature


def model_cloud(model):
    """An object's surface, metres."""
    mesh = o3d.io.read_triangle_mesh(model["mesh"])
    mesh.scale(0.001, center=np.zeros(3))
    o3d.utility.random.seed(1)
    return mesh.sample_points_uniformly(20_000)


def segments(look, largest):
    """What is left without planes, in pieces that do not touch, none much larger than an object; in the camera's frame."""
    depth = np.load(look["depth"])
    K = np.array(look["K"]).reshape(3, 3)
    v, u = np.nonzero(depth > 0)
    z = depth[v, u].astype(float)
    points = np.stack([(u - K[0, 2]) * z / K[0, 0], (v - K[1, 2]) * z / K[1, 1], z], axis=1)
    if look["space"]:
        pose = look["world_from_camera"]
        world = points @ np.array(pose["R"]).reshape(3, 3).T + pose["t"]
        points = points[np.all((world > look["space"]["min"]) & (world < look["space"]["max"]), axis=1)]
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)).voxel_down_sample(VOXEL)
    all_points = len(cloud.points)
    o3d.utility.random.seed(1)
    while len(cloud.points) > FEWEST:
        _, on_it = cloud.segment_plane(1.5 * VOXEL, 3, 1000)
        if len(on_it) < 0.1 * all_points:
            break
        cloud = cloud.select_by_index(on_it, invert=True)
    labels = np.asarray(cloud.cluster_dbscan(eps=2.5 * VOXEL, min_points=8))
    pieces = [cloud.select_by_index(np.nonzero(labels == k)[0]) for k in range(labels.max(initial=-1) + 1)]
    extent = [np.linalg.norm(piece.get_max_bound() - piece.get_min_bound()) for piece in pieces]
    return [p for p, e in zip(pieces, extent) if len(p.points) >= FEWEST and e < 1.2 * largest]


def fit(model, scene):
    """Scene from model, and the share of the segment's points that it explains."""
    (source, source_feature), (target, target_feature) = model, scene
    o3d.utility.random.seed(1)
    # From the scene to the model: a scene's segment is a part of its object, and not the other way round.
    coarse = registration.registration_ransac_based_on_feature_matching(
        target, source, target_feature, source_feature, True, 1.5 * VOXEL,
        registration.TransformationEstimationPointToPoint(False), 3,
        [registration.CorrespondenceCheckerBasedOnEdgeLength(0.9), registration.CorrespondenceCheckerBasedOnDistance(1.5 * VOXEL)],
        registration.RANSACConvergenceCriteria(100_000, 0.999))  # fmt: skip
    fine = registration.registration_icp(
        target, source, 1.5 * VOXEL, coarse.transformation, registration.TransformationEstimationPointToPlane()
    )
    return np.linalg.inv(fine.transformation), fine.fitness


def main():
    models = {}
    for line in sys.stdin:
        message = json.loads(line)
        if message["type"] == "hello":
            models = {model["obj_id"]: prepared(model_cloud(model)) for model in message["models"]}
            largest = max(model["diameter"] for model in message["models"])
            answer = {"type": "hello", "protocol": 1, "name": "open3d-fpfh", "version": o3d.__version__}
        else:
            scene = [prepared(segment) for segment in segments(message, largest)]
            fits = []
            for asked in message["objects"]:
                for k, segment in enumerate(scene):
                    pose, fitness = fit(models[asked["obj_id"]], segment)
                    # Little is soon explained: points count.
                    fits.append((fitness * len(segment[0].points), asked["index"], k, pose, fitness))
            poses, taken = [], set()
            for _, index, k, pose, fitness in sorted(fits, key=lambda f: (-f[0], f[1], f[2])):
                if not {("object", index), ("segment", k)} & taken:
                    taken |= {("object", index), ("segment", k)}
                    R, t = pose[:3, :3].flatten().tolist(), pose[:3, 3].tolist()
                    poses.append({"index": index, "R": R, "t": t, "score": fitness, "confidence": min(1.0, fitness)})
            answer = {"type": "poses", "id": message["id"], "poses": poses}
        print(json.dumps(answer), file=answers, flush=True)


main()
