"""Training images: 128 x 128 crops about one object each, with the class and the aspect ratio of every cell.

The paper trains on 224 x 224 with a cell of 32 pixels; here objects are about half as large in the pyramid.

A cell is an object's where the centre of its box is near and its longer side is about `SIDE` pixels; another level of
the image pyramid takes care of any other size.
"""

import json
import math
from pathlib import Path

import numpy as np
from PIL import Image

CROP = 128
STRIDE = 8
# Longer side of a box that a cell stands for, pixels of its level; levels are half an octave apart.
SIDE = 40.0
RATIOS = [2.0 ** (2.0 * i / 3.0) for i in range(-3, 4)]  # width over height, 1/4 to 4

# An object counts in a level whose SIDE its own is within this of, octaves; from there to the second number it is neither object
# nor background. Half a level is 0.25.
IN_LEVEL, OUT_OF_LEVEL = 0.28, 0.45
# The same for the distance of a cell to the box's centre along either axis, cells.
NEAR, FAR = 1.0, 1.7
# Objects that are hidden to more than this are neither.
LEAST_VISIBLE = 0.3
IGNORED = -1


def read(folders):
    """(image file, boxes) of every image of these BOP data sets; boxes: [(object id, left, top, width, height, visible share)].
    As in the BOP challenge, a box is that of the whole silhouette within the image, hidden parts included."""
    images = []
    for folder in folders:
        for truth_file in sorted(Path(folder).glob("*/*/scene_gt.json")):
            scene = truth_file.parent
            truths = json.loads(truth_file.read_text())
            infos = json.loads((scene / "scene_gt_info.json").read_text())
            with Image.open(next((scene / "rgb").iterdir())) as first:
                size = first.size
            for image in sorted(truths, key=int):
                boxes = [
                    (truth["obj_id"], *within(info["bbox_obj"], size), info["visib_fract"])
                    for truth, info in zip(truths[image], infos[image])
                    if info["bbox_visib"][2] > 0
                ]
                images.append((scene / "rgb" / f"{int(image):06d}.png", boxes))
    return images


def within(box, size):
    """The part of a box [left, top, width, height] that is in an image."""
    left, top = max(box[0], 0), max(box[1], 0)
    # BOP's boxes reach from the first pixel to the last one: one less than there are.
    return left, top, min(box[0] + box[2] + 1, size[0]) - left, min(box[1] + box[3] + 1, size[1]) - top


def labels(boxes, objects):
    """Class and aspect ratio of each cell of a crop, (16, 16) each; `boxes` are [(object id, left, top, width, height, visible
    share)] in its pixels, `objects` maps ids to classes from 1."""
    cells = CROP // STRIDE
    classes = np.zeros((cells, cells), np.int64)
    shapes = np.full((cells, cells), IGNORED, np.int64)
    nearest = np.full((cells, cells), np.inf)
    at = (np.arange(cells) + 0.5) * STRIDE
    for identity, left, top, width, height, visible in boxes:
        octaves = abs(math.log2(max(width, height, 1.0) / SIDE))
        if octaves > OUT_OF_LEVEL:
            continue
        x = np.abs(at - left - width / 2)[None, :] / STRIDE
        y = np.abs(at - top - height / 2)[:, None] / STRIDE
        distance = np.maximum(x, y)
        sure = octaves <= IN_LEVEL and visible >= LEAST_VISIBLE
        inside = (distance <= NEAR) & (distance < nearest) if sure else np.zeros_like(distance, bool)
        vague = (distance <= FAR) & ~inside & (classes == 0)
        ratio = math.log2(width / height)
        classes[vague] = IGNORED
        classes[inside] = objects[identity]
        shapes[inside] = min(range(len(RATIOS)), key=lambda i: abs(math.log2(RATIOS[i]) - ratio))
        nearest[inside] = distance[inside]
    return classes, shapes


class Crops:
    """Crops drawn from images; an epoch has `length` of them, each from its own stream of `seed`, a list of numbers."""

    def __init__(self, images, objects, length, seed):
        self.images, self.objects, self.length, self.seed = images, objects, length, seed
        self.pictures = {}
        self.targets = [(i, b) for i, (_, boxes) in enumerate(images) for b in boxes if b[5] >= LEAST_VISIBLE]

    def __len__(self):
        return self.length

    def picture(self, index):
        if index not in self.pictures:
            with Image.open(self.images[index][0]) as picture:
                self.pictures[index] = picture.convert("RGB")
        return self.pictures[index]

    def __getitem__(self, index):
        random = np.random.default_rng([*self.seed, index])
        image, (_, left, top, width, height, _) = self.targets[random.integers(len(self.targets))]
        picture = self.picture(image)
        # The object becomes as large as a level may show it, and lies anywhere in the crop.
        scale = SIDE * 2.0 ** random.uniform(-0.3, 0.3) / max(width, height)
        side = CROP / scale
        u = left + width / 2 - side * random.uniform(0.1, 0.9)
        v = top + height / 2 - side * random.uniform(0.1, 0.9)
        if side <= picture.width and side <= picture.height:
            u, v = min(max(u, 0), picture.width - side), min(max(v, 0), picture.height - side)
        crop = cut(picture, u, v, side)
        moved = [(b[0], (b[1] - u) * scale, (b[2] - v) * scale, b[3] * scale, b[4] * scale, b[5]) for b in self.images[image][1]]
        classes, shapes = labels(moved, self.objects)
        # Cameras differ in exposure and white balance.
        gain = random.uniform(0.8, 1.25) * random.uniform(0.93, 1.07, 3)
        pixels = np.clip(crop * gain.astype(np.float32), 0, 1)
        return np.ascontiguousarray(pixels.transpose(2, 0, 1)), classes, shapes


def cut(picture, u, v, side):
    """The square at (u, v) as (128, 128, 3) in [0, 1]; what lies outside the picture has the network's mean, as its padding."""
    u1, v1 = u + side, v + side
    inner = (max(u, 0), max(v, 0), min(u1, picture.width), min(v1, picture.height))
    out = np.full((CROP, CROP, 3), 0.45, np.float32)
    x0, y0, x1, y1 = (round(t * CROP / side) for t in (inner[0] - u, inner[1] - v, inner[2] - u, inner[3] - v))
    if x1 > x0 and y1 > y0:
        part = picture.resize((x1 - x0, y1 - y0), Image.Resampling.BILINEAR, box=inner)
        out[y0:y1, x0:x1] = np.asarray(part, np.float32) / 255
    return out
