"""What `grip objects add --json` says of meshes, measured again by trimesh.

Usage: check_objects.py TABLE.toml REPORT.json...    ends with 1 if a figure differs

Compared are watertightness, and of watertight meshes size, volume, centre of mass and the tensor of inertia.
"""

import json
import sys
import tomllib
from pathlib import Path

import numpy as np
import trimesh

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}


def read(row: dict, folder: Path) -> trimesh.Trimesh:
    """The mesh in metres, z up, the middle of its bounding box at the origin."""
    path = folder / row["mesh"]
    mesh = trimesh.load(path, force="mesh")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.apply_scale(METRES[row.get("unit", "m")])
    if path.suffix in (".glb", ".gltf"):
        mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    mesh.apply_translation(-mesh.bounds.mean(axis=0))
    return mesh


def main() -> int:
    table = Path(sys.argv[1])
    rows = {row["name"]: row for row in tomllib.loads(table.read_text())["objects"]}
    faults = 0
    for file in sys.argv[2:]:
        report = json.loads(Path(file).read_text())
        mesh = read(rows[report["name"]], table.parent)
        ours: dict = {"watertight": report["watertight"]}
        theirs: dict = {"watertight": bool(mesh.is_watertight)}
        if mesh.is_watertight:
            mass = report["mass_kg"]
            for name, value in [
                ("size_m", mesh.extents),
                ("volume_m3", mesh.volume),
                ("center_of_mass_m", mesh.center_mass),
                ("inertia_kg_m2", mesh.moment_inertia * mass / mesh.volume),
            ]:
                ours[name], theirs[name] = np.array(report[name]), np.array(value)
        for name, value in ours.items():
            scale = np.max(np.abs(theirs[name])) if name != "center_of_mass_m" else np.max(mesh.extents)
            differs = value != theirs[name] if name == "watertight" else np.max(np.abs(value - theirs[name])) > 1e-4 * scale
            if differs:
                faults += 1
                print(f"{report['name']}: {name} is {value}, trimesh has {theirs[name]}")
        print(f"{report['name']}: {', '.join(ours)} compared")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
