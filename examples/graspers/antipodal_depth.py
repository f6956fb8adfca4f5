#!/usr/bin/env python3
"""Grasps from depth alone, by a hand that comes from straight above: `grip pack --grasper "cmd:python3 antipodal_depth.py"`.

Needs numpy, and knows no object. The depth picture becomes a map of heights over the table. Where what stands there has two
edges, as seen from above, that face each other, lie nearly across the line between them and are no farther apart than the
fingers, it is gripped (docs/graspers.md). What the camera does not see is taken for empty.
"""

import json
import sys

import numpy as np

CELL = 0.004  # metres
DIRECTIONS = 12
ROOM = 0.012  # of each finger beside what it grips, metres
STEEPEST = 0.4  # edges may lean so far from across the closing direction: the tangent that rubber holds
DEEPEST = 0.035  # of the fingertips below the top, metres


def points_of(look):
    """What the camera saw as points of the world, n x 3."""
    z = np.load(look["depth"]).astype(float)
    K, camera = look["K"], look["world_from_camera"]
    v, u = np.nonzero(z)
    z = z[v, u]
    seen = np.stack([(u - K[2]) / K[0] * z, (v - K[5]) / K[4] * z, z], axis=1)
    return seen @ np.reshape(camera["R"], (3, 3)).T + camera["t"]


def height_map(points, look):
    """Height over the table by cell; 0 where nothing is seen."""
    low, high = np.array(look["space"]["min"]), np.array(look["space"]["max"])
    points = points[np.all((points >= low) & (points <= high), axis=1)]
    shape = np.ceil((high[:2] - low[:2]) / CELL).astype(int)
    heights = np.zeros(shape)
    i, j = np.minimum(((points[:, :2] - low[:2]) / CELL).astype(int), shape - 1).T
    np.maximum.at(heights, (i, j), np.maximum(points[:, 2] - look["table"], 0))
    return heights, low[:2]


def pieces(heights, least=0.012, fewest=25, step=0.02):
    """What hangs together without a step in height, as lists of cells: neighbours within two cells, for depth has holes."""
    near = [(a, b) for a in range(-2, 3) for b in range(-2, 3)]
    todo = set(zip(*map(np.ndarray.tolist, np.nonzero(heights > least))))
    while todo:
        queue = [todo.pop()]
        for i, j in queue:
            for a, b in near:
                other = (i + a, j + b)
                if other in todo and abs(heights[other] - heights[i, j]) < step:
                    todo.remove(other)
                    queue.append(other)
        if len(queue) >= fewest:
            yield np.array(queue)


def grasps(heights, low, gripper):
    """World from gripper as (R, (x, y, height over the table), width, score)."""
    high = np.argwhere(heights > 0.012)
    tops = heights[tuple(high.T)]
    high = low + (high + 0.5) * CELL
    side = gripper["pad_width"] / 2
    outside = ROOM + gripper["finger_thickness"]
    for piece in pieces(heights):
        top = heights[tuple(piece.T)]
        piece = low + (piece + 0.5) * CELL
        middle = piece.mean(axis=0)
        for angle in np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
            closing = np.array([np.cos(angle), np.sin(angle)])
            across = np.array([-closing[1], closing[0]])
            u, v = (piece - middle) @ closing, (piece - middle) @ across
            all_u, all_v = (high - middle) @ closing, (high - middle) @ across
            for v0 in np.arange(v.min() + side, v.max() - side + 1e-9, side):
                strip = np.abs(v - v0) <= side
                if strip.sum() < 6:
                    continue
                tip = max(np.percentile(top[strip], 90) - DEEPEST, 0.007)
                tall = strip & (top > tip + 0.003)
                if tall.sum() < 6:
                    continue
                # The edges, cell by cell across the pad: where they are and how much they lean.
                rows = np.round((v[tall] - v0) / CELL).astype(int)
                ends = np.array([[u[tall][rows == r].min(), u[tall][rows == r].max(), r * CELL] for r in np.unique(rows)])
                if len(ends) < 3:
                    continue
                lean = [abs(np.polyfit(ends[:, 2], ends[:, k], 1)[0]) for k in (0, 1)]
                begin, end = ends[:, 0].min() - CELL / 2, ends[:, 1].max() + CELL / 2
                width = end - begin
                if max(lean) > STEEPEST or width + 2 * ROOM > gripper["opening"]:
                    continue
                # Nothing stands where the fingers go down.
                beside = (np.abs(all_v - v0) <= side + CELL) & (tops > tip - 0.004)
                left = (all_u < begin - CELL) & (all_u > begin - outside)
                right = (all_u > end + CELL) & (all_u < end + outside)
                if np.any(beside & (left | right)):
                    continue
                x, y = middle + closing * (begin + end) / 2 + across * v0
                # Off the middle it would turn in the hand.
                lever = np.hypot((begin + end) / 2, v0)
                R = [[0, closing[0], closing[1]], [0, closing[1], -closing[0]], [-1, 0, 0]]
                score = 1 - max(lean) - lever / 0.06 + 0.5 * (1 - width / gripper["opening"])
                yield np.array(R), (x, y, tip + gripper["pad_length"] / 2), width, score


def main():
    for line in sys.stdin:
        message = json.loads(line)
        if message["type"] == "hello":
            gripper = message["gripper"]
            answer = {"type": "hello", "protocol": 1, "name": "antipodal depth", "version": "1"}
        else:
            camera = np.reshape(message["world_from_camera"]["R"], (3, 3))
            found = []
            for R, (x, y, z), width, score in grasps(*height_map(points_of(message), message), gripper):
                t = np.array([x, y, z + message["table"]]) - message["world_from_camera"]["t"]
                grasp = {"R": (camera.T @ R).ravel().tolist(), "t": (camera.T @ t).tolist()}
                found.append({**grasp, "width": min(width + 2 * ROOM, gripper["opening"]), "score": score})
            answer = {"type": "grasps", "id": message["id"], "grasps": found}
        print(json.dumps(answer), flush=True)


main()
