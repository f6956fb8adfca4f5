"""An MCAP file, read by the official packages, has Foxglove's schemas and says what the recording says.

Usage: check_mcap.py FILE.mcap RECORDING
"""

import importlib
import io
import json
import math
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import trimesh
from google.protobuf.descriptor import FieldDescriptor
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from PIL import Image

file, record = Path(sys.argv[1]), Path(sys.argv[2])
about = json.loads((record / "record.json").read_text())
table = lambda name: pq.read_table(record / f"{name}.parquet").to_pylist()  # noqa: E731


def described(message):
    """Fields of a message, and of all messages in it."""
    all_of = {}

    def add(of):
        if of.full_name in all_of:
            return
        fields = {}
        for field in of.fields:
            kind = field.message_type or field.enum_type
            values = [(v.name, v.number) for v in field.enum_type.values] if field.enum_type else None
            scalar = field.type != FieldDescriptor.TYPE_MESSAGE
            fields[field.number] = (
                field.name,
                field.type,
                field.is_repeated,
                kind and kind.full_name,
                values,
                scalar and field.has_presence,
            )
        all_of[of.full_name] = fields
        for field in of.fields:
            if field.message_type:
                add(field.message_type)

    add(message)
    return all_of


def official(schema):
    name = schema.rsplit(".")[-1]
    return getattr(importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name).DESCRIPTOR


topics, times, schemas = defaultdict(list), defaultdict(list), {}
with file.open("rb") as stream:
    reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    for schema, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False):
        assert message.log_time == message.publish_time
        assert message.sequence == len(topics[channel.topic])
        topics[channel.topic].append(decoded)
        times[channel.topic].append(message.log_time)
        schemas[channel.topic] = schema.name
    metadata = {item.name: item.metadata for item in reader.iter_metadata()}
assert metadata["grip"]["seed"] == str(about["seed"]), metadata
assert sum(map(len, topics.values())) == summary.statistics.message_count

for topic, messages in topics.items():
    if schemas[topic].startswith("foxglove."):
        ours, theirs = described(messages[0].DESCRIPTOR), described(official(schemas[topic]))
        assert ours == theirs, (topic, {k for k in theirs if ours.get(k) != theirs[k]})
    assert all(a <= b for a, b in zip(times[topic], times[topic][1:])), f"{topic}: time runs backwards"
    for time, message in zip(times[topic], messages):
        if "timestamp" in message.DESCRIPTOR.fields_by_name:
            assert message.timestamp.seconds * 10**9 + message.timestamp.nanos == time, topic


def number(instance):
    return "" if instance == 1 else f" ({instance})"


def array(v):
    return np.array([v.x, v.y, v.z] + ([v.w] if hasattr(v, "w") else []))


# Transforms: a tree below the world at every time, and bodies where the table says that they are.
rows = defaultdict(list)
for row in table("poses"):
    rows[round(row["time_s"] * 1e9)].append(row)
frames, where = None, {}
assert list(rows) == times["/tf"]
for time, message in zip(times["/tf"], topics["/tf"]):
    parents = {t.child_frame_id: t.parent_frame_id for t in message.transforms}
    assert len(parents) == len(message.transforms), "a frame has two parents"
    for frame in parents:
        seen = [frame]
        while seen[-1] != "world":
            assert len(seen) <= len(parents), f"a ring of frames: {seen}"
            seen.append(parents[seen[-1]])
    frames = frames or set(parents)
    assert set(parents) == frames, "frames come and go"
    for row in rows[time]:
        name = row["name"] if row["kind"] == "link" else f"object/{row['name']}{number(row['instance'])}"
        where[name] = [row[f"position_{k}"] for k in "xyz"], [row[f"rotation_{k}"] for k in "xyzw"]
    for t in message.transforms:
        assert math.isclose(np.linalg.norm(array(t.rotation)), 1, abs_tol=1e-6)
        if t.child_frame_id != "camera/optical":
            position, rotation = where[t.child_frame_id]
            assert np.allclose(array(t.translation), position, atol=1e-9), t.child_frame_id
            assert np.allclose(array(t.rotation), rotation, atol=1e-6), t.child_frame_id
for name, instance in about["objects"]:
    assert f"object/{name}{number(instance)}" in frames

samples = table("samples")
assert len(topics["/joint_states"]) == len(topics["/gripper"]) == len(samples) > 0
for row, joints, hand in zip(samples, topics["/joint_states"], topics["/gripper"]):
    assert [joint.name for joint in joints.joints] == about["joints"]
    assert all(joint.position == row[f"q_{joint.name}"] for joint in joints.joints)
    assert (hand.step, hand.width_m, hand.right_finger_n) == (row["step"], row["width_m"], row["right_finger_n"])

# Pictures; each point of a cloud is seen in the pixel that it came from.
camera, looks = about["intrinsics"], table("looks")
size = (camera["width"], camera["height"])
seen = ["/camera/info", "/camera/color", "/camera/depth", "/camera/points", "/camera/annotations"]
assert all(times[topic] == [round(look["time_s"] * 1e9) for look in looks] for topic in seen)
for number_of, (info, color, depth, cloud, boxes) in enumerate(zip(*(topics[topic] for topic in seen))):
    assert (info.width, info.height) == size and info.K[0] == camera["fx"] and len(info.P) == 12
    assert {m.frame_id for m in (info, color, depth, cloud)} == {"camera/optical"}
    picture = Image.open(io.BytesIO(color.data))
    assert picture.size == size and color.format == "png"
    picture = np.asarray(picture)
    assert (depth.width, depth.height, depth.encoding) == (*size, "16UC1")
    millimetres = np.frombuffer(depth.data, "<u2").reshape(depth.height, depth.step // 2)
    saved = np.asarray(Image.open(record / f"looks/{number_of:02}_depth.png"))
    assert (millimetres == saved).all()
    kinds = {1: "u1", 7: "<f4"}
    kind = np.dtype(
        {
            "names": [f.name for f in cloud.fields],
            "formats": [kinds[f.type] for f in cloud.fields],
            "offsets": [f.offset for f in cloud.fields],
            "itemsize": cloud.point_stride,
        }
    )
    assert len(cloud.data) % cloud.point_stride == 0
    points = np.frombuffer(cloud.data, kind)
    assert 1000 < len(points) <= 20_000, len(points)
    u = points["x"] / points["z"] * info.K[0] + info.K[2]
    v = points["y"] / points["z"] * info.K[4] + info.K[5]
    column, line = np.rint(u).astype(int), np.rint(v).astype(int)
    assert np.abs(u - column).max() < 0.01 and np.abs(v - line).max() < 0.01
    assert np.allclose(points["z"], millimetres[line, column] / 1000)
    assert (np.stack([points["red"], points["green"], points["blue"]], -1) == picture[line, column]).all()
    assert len(boxes.points) == len(boxes.texts) > 0
    assert all(0 <= p.x < size[0] and 0 <= p.y < size[1] for box in boxes.points for p in box.points)

# Bodies: every object has a mesh in its frame, and is as large as the box that stands for its estimates.
(scene,) = topics["/scene"]
extents = {}
for entity in scene.entities:
    assert entity.frame_id in frames | {"world"} and entity.frame_locked, entity.id
    (model,) = entity.models
    mesh = trimesh.load(io.BytesIO(model.data), file_type="glb")
    # glTF has y up.
    x, y, z = mesh.extents
    extents[entity.id] = np.array([x, z, y])
assert {f"object/{name}{number(instance)}" for name, instance in about["objects"]} < set(extents)
assert any(name.startswith("link/") for name in extents) and "furniture" in extents
estimates = 0
for message in topics["/scene/estimates"]:
    for entity in message.entities:
        name = entity.id.removeprefix("estimate/")
        assert np.allclose(array(entity.cubes[0].size), extents[f"object/{name}"], atol=1e-4), name
        estimates += 1
assert estimates == len(table("estimates"))
for topic in ("/scene/estimates", "/scene/plan", "/scene/contacts"):
    assert all(message.deletions[0].type == 1 for message in topics[topic]), topic
attempts = table("attempts")
assert len(topics["/scene/plan"]) == 2 * len(attempts)
ways = [message.entities[0].lines[0].points for message in topics["/scene/plan"][::2]]
planned = [[row for row in table("trajectories") if row["attempt"] == n] for n in range(len(ways))]
assert [len(way) for way in ways] == [len(rows) for rows in planned]

# Newtons as arrows: those that are neither cut nor too short to be seen.
arrows = sum(len(entity.arrows) for message in topics["/scene/contacts"] for entity in message.entities)
norms = [
    math.hypot(*(row[f"force_n_{k}"] + row[f"friction_n_{k}"] for k in "xyz")) for row in table("contacts")
]
assert abs(arrows - sum(0.004 * norm >= 1e-3 for norm in norms)) <= len(norms) // 1000 + 1

said = [line.message for line in topics["/log"]]
assert sum(line.startswith("look ") for line in said) == len(looks) and len(said) >= len(looks) + len(attempts)
counts = {topic: len(messages) for topic, messages in topics.items()}
print(f"{file.stat().st_size / 1e6:.1f} MB, {len(frames)} frames, messages: {counts}")
