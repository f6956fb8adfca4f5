"""A grasp planner that knows no grasp, and does something wrong once: `faulty.py SEED crash|hang|nonsense`."""

import json
import sys
import time

seed, how = int(sys.argv[1]), sys.argv[2]
for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "hello":
        answer = {"type": "hello", "protocol": 1, "name": "faulty"}
    else:
        answer = {"type": "grasps", "id": message["id"], "grasps": []}
        if message["seed"] == seed:
            if how == "crash":
                sys.exit("segmentation fault, nearly")
            if how == "hang":
                time.sleep(60)
            answer["grasps"] = [{"R": [1] * 9, "t": [0, 0, 1]}]
    print(json.dumps(answer), flush=True)
