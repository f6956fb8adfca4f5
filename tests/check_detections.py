"""AP and AR of a file of detections by pycocotools, without any code of the project, against those of `grip detect --json`.

    python3 tests/check_detections.py DATASET DETECTIONS.json FIGURES.json

Boxes of the truth are those of whole silhouettes within the image; instances of which less than a tenth is seen are ignored, as
in the BOP challenge. Exits with 1 if a figure differs by more than 1e-9.
"""

import contextlib
import io
import json
import sys
from pathlib import Path

import numpy as np
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

SIZE = 640, 480


class Evaluation(COCOeval):
    """COCO's evaluation with instances that are ignored without being crowds."""

    def _prepare(self):
        super()._prepare()
        for annotations in self._gts.values():
            for annotation in annotations:
                annotation["ignore"] = annotation["hidden"]


def main():
    root, found, figures = map(Path, sys.argv[1:])
    figures = json.loads(figures.read_text())
    images, annotations, numbers = [], [], {}
    for file in sorted((root / figures["split"]).glob("*/scene_gt.json")):
        truths, infos = json.loads(file.read_text()), json.loads((file.parent / "scene_gt_info.json").read_text())
        for image in sorted(truths, key=int):
            number = numbers[int(file.parent.name), int(image)] = len(images)
            images.append({"id": number, "width": SIZE[0], "height": SIZE[1]})
            for truth, info in zip(truths[image], infos[image]):
                x, y, w, h = info["bbox_obj"]
                left, top = max(x, 0), max(y, 0)
                box = [left, top, min(x + w + 1, SIZE[0]) - left, min(y + h + 1, SIZE[1]) - top]
                annotations.append({"id": len(annotations) + 1, "image_id": number, "category_id": truth["obj_id"], "bbox": box,
                                    "area": box[2] * box[3], "iscrowd": 0, "hidden": int(info["visib_fract"] < 0.1)})
    detections = [{"image_id": numbers[d["scene_id"], d["image_id"]], "category_id": d["category_id"], "bbox": d["bbox"], "score": d["score"]}
                  for d in json.loads(found.read_text())]
    worst, checked = 0.0, 0
    for number, said in figures["objects"].items():
        if not said["instances"]:
            continue
        with contextlib.redirect_stdout(io.StringIO()):
            truth = COCO()
            truth.dataset = {"images": images, "annotations": annotations, "categories": [{"id": int(n)} for n in figures["objects"]]}
            truth.createIndex()
            evaluation = Evaluation(truth, truth.loadRes(detections), "bbox")
            evaluation.params.catIds = [int(number)]
            evaluation.evaluate()
            evaluation.accumulate()
        # Precision: overlaps, recalls, objects, areas, limits; all areas, the last limit (100).
        precision, recall = evaluation.eval["precision"][:, :, 0, 0, -1], evaluation.eval["recall"][:, 0, 0, -1]
        theirs = {"ap50": precision[0].mean(), "ap": precision.mean(), "recall50": recall[0], "ar": recall.mean()}
        for name, value in theirs.items():
            checked += 1
            worst = max(worst, abs(value - said[name]))
            if abs(value - said[name]) > 1e-9:
                print(f"object {number}: {name} is {value}, grip says {said[name]}")
    print(f"{checked} figures, the worst off by {worst:.1e}")
    sys.exit(worst > 1e-9 or checked == 0)


if __name__ == "__main__":
    main()
