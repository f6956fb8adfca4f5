"""An estimator that sees nothing, and does something wrong once: `faulty.py SEED LOOK crash|hang|nonsense`."""

import json
import sys
import time

seed, look, how = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
for line in sys.stdin:
    message = json.loads(line)
    if message["type"] == "hello":
        answer = {"type": "hello", "protocol": 1, "name": "faulty"}
    else:
        answer = {"type": "poses", "id": message["id"], "poses": []}
        if (message["seed"], message["look"]) == (seed, look):
            if how == "crash":
                sys.exit("segmentation fault, nearly")
            if how == "hang":
                time.sleep(60)
            answer = {"type": "poses", "id": message["id"], "poses": [{"index": "first"}]}
    print(json.dumps(answer), flush=True)
