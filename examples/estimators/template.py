#!/usr/bin/env python3
"""The least that an estimator for `grip pack --estimator "cmd:python3 template.py"` must do (docs/estimators.md).

It needs no packages, and sees nothing: it says where each object was found by `locate`, which is yours to write.
"""

import json
import os
import sys

# What libraries print is no answer: it goes to stderr, and so to the log.
answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)


def locate(model, look):
    """Camera from object as (R, t, score): nine numbers row by row, metres, any scale. None where it is not seen.

    `look["rgb"]` and `look["depth"]` are files for `numpy.load`; `model["mesh"]` is a PLY file in millimetres.
    """
    return None


def main():
    models = {}
    for line in sys.stdin:
        message = json.loads(line)
        if message["type"] == "hello":
            models = {model["obj_id"]: model for model in message["models"]}
            answer = {"type": "hello", "protocol": 1, "name": "template"}
        else:
            poses = []
            for asked in message["objects"]:
                found = locate(models[asked["obj_id"]], message)
                if found:
                    R, t, score = found
                    poses.append({"index": asked["index"], "R": R, "t": t, "score": score})
            answer = {"type": "poses", "id": message["id"], "poses": poses}
        print(json.dumps(answer), file=answers, flush=True)


main()
