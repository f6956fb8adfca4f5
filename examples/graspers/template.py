#!/usr/bin/env python3
"""The least that a grasp planner for `grip pack --grasper "cmd:python3 template.py"` must do (docs/graspers.md).

It needs no packages, and grips the box around each object as its estimated pose has it, from straight above.
"""

import json
import os
import sys


def times(A, B):
    """A B, for matrices of nine numbers, row by row."""
    return [sum(A[3 * i + k] * B[3 * k + j] for k in range(3)) for i in range(3) for j in range(3)]


def turned(A, v):
    return [sum(A[3 * i + k] * v[k] for k in range(3)) for i in range(3)]


def grasps(pose, size, look, gripper):
    """World from gripper as (R, t, score); `pose` is world from object, `size` that of its box. Yours to write."""
    R, t = pose
    half_height = sum(abs(R[6 + k]) * size[k] for k in range(3)) / 2
    reach = min(2 * half_height - 0.008, gripper["finger_depth"] - 0.012)
    z = max(t[2] + half_height - reach, look["table"] + 0.008) + gripper["pad_length"] / 2
    for axis in range(3):
        x, y = R[axis], R[3 + axis]
        length = (x * x + y * y) ** 0.5
        if length > 0.5:
            x, y = x / length, y / length
            width = sum(abs(x * R[k] + y * R[3 + k]) * size[k] for k in range(3))
            if width < gripper["opening"] - 0.006:
                # Columns: approach down, closing along (x, y), and their cross product.
                yield [0, x, y, 0, y, -x, -1, 0, 0], [t[0], t[1], z], -width


def main():
    for line in sys.stdin:
        message = json.loads(line)
        if message["type"] == "hello":
            gripper, models = message["gripper"], {}
            for model in message["models"]:
                with open(os.path.join(os.path.dirname(model["mesh"]), "models_info.json")) as file:
                    info = json.load(file)[str(model["obj_id"])]
                models[model["obj_id"]] = [info[f"size_{axis}"] / 1000 for axis in "xyz"]
            answer = {"type": "hello", "protocol": 1, "name": "template", "wants": ["poses"]}
        else:
            camera, found = message["world_from_camera"], []
            back = [camera["R"][3 * j + i] for i in range(3) for j in range(3)]
            for item in message["objects"]:
                if item["wanted"] and "pose" in item:
                    at = turned(camera["R"], item["pose"]["t"])
                    pose = times(camera["R"], item["pose"]["R"]), [a + b for a, b in zip(at, camera["t"])]
                    for R, t, score in grasps(pose, models[item["obj_id"]], message, gripper):
                        t = turned(back, [a - b for a, b in zip(t, camera["t"])])
                        found.append({"R": times(back, R), "t": t, "score": score, "index": item["index"]})
            answer = {"type": "grasps", "id": message["id"], "grasps": found}
        print(json.dumps(answer), flush=True)


main()
