"""Masks of the objects of a capture, camera by camera and frame by frame, and the folder that holds them.

In the folder: `objects.json` with the names, and CAMERA.npz with `labels` [F, H, W] uint8, 0 where there is no object.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.lab.synthetic.raycast import make_truth
from app.lab.synthetic.scene import SyntheticScene
from app.lab.synthetic.writing import write_json, write_scene
from tests.objects_truth.scene import EVALUATED, labels_of, object_names


@dataclass(frozen=True, slots=True)
class ObjectsTruth:
    """Where objects are seen.

    Attributes:
        objects: Their names.
        labels: By name of the camera: 1 + number of the object that a pixel's centre shows, else 0. [F, H, W] uint8
    """

    objects: tuple[str, ...]
    labels: dict[str, np.ndarray]

    def mask(self, camera: str, frame_index: int, name: str) -> np.ndarray:
        """Pixels that show an object. [H, W] bool. Raises ValueError for an unknown name."""
        return self.labels[camera][frame_index] == self.objects.index(name) + 1


def make_objects_truth(scene: SyntheticScene, camera_indices: tuple[int, ...] = EVALUATED) -> ObjectsTruth:
    """The truth of a generated scene in some of its cameras."""
    objects = object_names(scene)
    label_of = labels_of([part.name for part in scene.parts], objects)
    labels = {}
    for camera_index in camera_indices:
        frames = [make_truth(scene, camera_index, frame).part_indices for frame in range(scene.n_frames)]
        labels[scene.rig.names[camera_index]] = label_of[np.stack(frames)]
    return ObjectsTruth(objects, labels)


def write_truth(truth: ObjectsTruth, folder: Path) -> None:
    """Write it, replacing what was there under the same names."""
    folder.mkdir(parents=True, exist_ok=True)
    for camera, labels in truth.labels.items():
        np.savez_compressed(folder / f"{camera}.npz", labels=labels)
    write_json(folder / "objects.json", {"objects": list(truth.objects)})


def read_truth(folder: Path) -> ObjectsTruth:
    """Read what `write_truth` has written."""
    objects = json.loads((folder / "objects.json").read_text(encoding="utf-8"))["objects"]
    labels = {}
    for path in sorted(folder.glob("*.npz")):
        with np.load(path, allow_pickle=False) as arrays:
            labels[path.stem] = arrays["labels"]
    return ObjectsTruth(tuple(objects), labels)


def write_object_capture(capture: Path, truth_folder: Path, scene: SyntheticScene) -> ObjectsTruth:
    """Write a scene as a capture in the layout of the sample, and its truth beside it."""
    truth = make_objects_truth(scene)
    write_truth(truth, truth_folder)
    write_scene(capture, scene)
    return truth
