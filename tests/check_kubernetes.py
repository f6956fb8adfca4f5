"""The Job of deploy/kubernetes is one by the schema of Kubernetes, which knows no other fields, and its failure policy by the exit codes.

Usage: check_kubernetes.py JOB.yaml
"""

import sys
from pathlib import Path

import kubernetes_validate
import yaml

VERSION = "1.33"

documents = list(yaml.safe_load_all(Path(sys.argv[1]).read_text(encoding="utf-8")))
for document in documents:
    kubernetes_validate.validate(document, VERSION, strict=True)
    # And the schema is one that refuses.
    for spoiled in [{**document, "spek": {}}, {**document, "spec": {**document["spec"], "completions": "many"}}]:
        try:
            kubernetes_validate.validate(spoiled, VERSION, strict=True)
        except kubernetes_validate.ValidationError:
            continue
        sys.exit("the schema takes anything")
spec = documents[0]["spec"]
actions = {
    value: rule["action"]
    for rule in spec["podFailurePolicy"]["rules"]
    for value in rule.get("onExitCodes", {}).get("values", [])
}
assert actions == {2: "FailJob", 1: "FailIndex"}, actions
assert (spec["completionMode"], spec["template"]["spec"]["restartPolicy"]) == ("Indexed", "Never")
names = {container["name"] for container in spec["template"]["spec"]["containers"]}
assert all(rule["onExitCodes"]["containerName"] in names for rule in spec["podFailurePolicy"]["rules"] if "onExitCodes" in rule)
print(f"{sys.argv[1]}: {len(documents)} documents are valid in Kubernetes {VERSION}")
