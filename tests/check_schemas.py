"""Files of ours are what their JSON Schemas say, by another's validator.

Usage: check_schemas.py NAME=FILE ...

NAME is that of a schema in docs/schemas; FILE is JSON, TOML, or JSON lines, each of which counts.
"""

import json
import sys
import tomllib
from pathlib import Path

from jsonschema import Draft202012Validator

SCHEMAS = Path(__file__).parent.parent / "docs" / "schemas"


def load(path):
    text = path.read_text()
    if path.suffix == ".toml":
        return [tomllib.loads(text)]
    if path.suffix == ".jsonl":
        return [json.loads(line) for line in text.splitlines()]
    return [json.loads(text)]


used = set()
for argument in sys.argv[1:]:
    name, file = argument.split("=", 1)
    schema = json.loads((SCHEMAS / f"{name}.json").read_text())
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    documents = load(Path(file))
    assert documents, f"{file}: empty"
    for document in documents:
        errors = sorted(validator.iter_errors(document), key=lambda e: list(map(str, e.path)))
        shown = "\n".join(f"  {'.'.join(map(str, e.path))}: {e.message[:300]}" for e in errors[:10])
        assert not errors, f"{file} is no {name}:\n{shown}"
        # And a file of another version is none.
        if "schema" in schema.get("properties", {}):
            assert not validator.is_valid({**document, "schema": "other/1"}), f"{name}: any version passes"
            assert not validator.is_valid({k: v for k, v in document.items() if k != "schema"}), name
    used.add(name)
print(f"{len(sys.argv) - 1} files of {len(used)} schemas are valid")
unused = sorted({path.stem for path in SCHEMAS.glob("*.json")} - used)
assert not unused, f"no file was given for {unused}"
