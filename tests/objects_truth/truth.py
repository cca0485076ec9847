"""Masks of the objects of a capture, camera by camera and frame by frame, and the folder that holds them.

In the folder: `objects.json` with the names, and CAMERA.npz with `labels` and `behind`, see ObjectsTruth.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.lab.synthetic.raycast import make_truth
from app.lab.synthetic.scene import SyntheticScene
from app.lab.synthetic.writing import write_json, write_scene
from tests.objects_truth.scene import EVALUATED, labels_of, object_names


@dataclass(frozen=True, slots=True)
class ObjectsTruth:
    """Where objects are seen. A label is 1 + the number of an object, and 0 where there is none.

    Attributes:
        objects: Their names.
        labels: By name of the camera, what the centre of each pixel shows. [F, H, W] uint8
        behind: The same with one object taken away at a time. [O, F, H, W] uint8
    """

    objects: tuple[str, ...]
    labels: dict[str, np.ndarray]
    behind: dict[str, np.ndarray]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the masks, px."""
        height, width = next(iter(self.labels.values())).shape[1:]
        return width, height

    def label(self, name: str) -> int:
        """Of an object. Raises ValueError for an unknown name."""
        return self.objects.index(name) + 1


def make_objects_truth(scene: SyntheticScene, camera_indices: tuple[int, ...] = EVALUATED) -> ObjectsTruth:
    """The truth of a generated scene in some of its cameras."""
    objects = object_names(scene)
    labels, behind = {}, {}
    for camera_index in camera_indices:
        camera = scene.rig.names[camera_index]
        labels[camera] = _labels(scene, camera_index, objects)
        without = [
            _labels(replace(scene, parts=tuple(part for part in scene.parts if part.name.split(".")[0] != name)),
                    camera_index, objects)
            for name in objects
        ]  # fmt: skip
        behind[camera] = np.stack(without)
    return ObjectsTruth(objects, labels, behind)


def _labels(scene: SyntheticScene, camera_index: int, objects: tuple[str, ...]) -> np.ndarray:
    label_of = labels_of([part.name for part in scene.parts], objects)
    return label_of[np.stack([make_truth(scene, camera_index, frame).part_indices for frame in range(scene.n_frames)])]


def write_truth(truth: ObjectsTruth, folder: Path) -> None:
    """Write it, replacing files of the same names."""
    folder.mkdir(parents=True, exist_ok=True)
    for camera, labels in truth.labels.items():
        np.savez_compressed(folder / f"{camera}.npz", labels=labels, behind=truth.behind[camera])
    write_json(folder / "objects.json", {"objects": list(truth.objects)})


def read_truth(folder: Path) -> ObjectsTruth:
    """Read the files of `write_truth`."""
    objects = json.loads((folder / "objects.json").read_text(encoding="utf-8"))["objects"]
    labels, behind = {}, {}
    for path in sorted(folder.glob("*.npz")):
        with np.load(path, allow_pickle=False) as arrays:
            labels[path.stem], behind[path.stem] = arrays["labels"], arrays["behind"]
    return ObjectsTruth(tuple(objects), labels, behind)


def write_object_capture(capture: Path, truth_folder: Path, scene: SyntheticScene) -> ObjectsTruth:
    """Write a scene as a capture in the layout of the sample, and its truth next to it."""
    truth = make_objects_truth(scene)
    write_truth(truth, truth_folder)
    write_scene(capture, scene)
    return truth
