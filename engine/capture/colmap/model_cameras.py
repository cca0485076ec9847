"""The cameras of a rig from a sparse model: one per image, or one per folder of images where there are several."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

import numpy as np

from engine.camera.lens import Lens
from engine.capture.colmap.camera_models import calibration_of
from engine.capture.colmap.model_files import ColmapImage, ColmapModel, has_model, read_model
from engine.capture.files.frame_files import natural_key
from engine.capture.layout.format_checks import parse_size, shortened, size_problem
from engine.errors import CaptureError
from engine.text import shown

MODEL_FOLDERS = ("sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse", ".")
"""Where a model may lie in a capture, best place first."""
IMAGE_FOLDERS = ("images", "input", "frames", "rgb")
"""Folders that say nothing about a camera when they begin the name of an image."""
SAME_POSE = 1e-3
"""How far entries of a rotation, and of a place divided by the size of the rig, may differ for cameras that stand."""


@dataclass(frozen=True, eq=False)
class ModelCamera:
    """One camera of a rig as its sparse model has it.

    Attributes:
        name: Its folder of images, or its image without suffix.
        image_name: Of the image that its pose comes from.
        K: Pixel centres at +0.5. [3, 3]
        size: That K belongs to.
        world_to_camera: Not checked yet. [4, 4]
    """

    name: str
    image_name: str
    K: np.ndarray
    lens: Lens
    size: tuple[int, int]
    world_to_camera: np.ndarray

    def renamed(self, name: str) -> ModelCamera:
        """The same camera under another name."""
        return replace(self, name=name)


@dataclass(frozen=True, eq=False)
class ModelRig:
    """The cameras of a model in natural order of their names, where they come from, and what was odd about them."""

    said_in: Path
    cameras: list[ModelCamera] = field(default_factory=list)
    problems: list[CaptureError] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


def find_model(folder: Path, places: tuple[str, ...] = MODEL_FOLDERS) -> Path | None:
    """The first of these places in a folder that holds a model; None where there is none."""
    return next((folder / place for place in places if has_model(folder / place)), None)


def read_rig(model_folder: Path) -> ModelRig:
    """The cameras of the model in a folder.

    Raises:
        CaptureError: The files are missing or damaged. Faults of single cameras are among `problems`.
    """
    model = read_model(model_folder)
    rig = ModelRig(model.images_file)
    if not model.images:
        text = "The model has no images, and so no poses."
        rig.problems.append(CaptureError(text, hint="Calibrate again, with more images.", path=model.images_file))
    grouped, twice = _grouped(model.images)
    if twice:
        text = f"Several images have the same name but for their suffix: {shortened([shown(name) for name in twice])}."
        rig.problems.append(CaptureError(text, hint="Give each camera its own name.", path=model.images_file))
    for name in sorted(grouped, key=natural_key):
        images = sorted(grouped[name], key=lambda image: natural_key(image.name))
        try:
            rig.cameras.append(_camera(name, images[0], model))
        except CaptureError as error:
            text = f"Camera {shown(name)}: {error.message}"
            rig.problems.append(CaptureError(text, hint=error.hint, path=error.path or model.images_file))
    moving = _moving(grouped, rig.cameras)
    if moving:
        rig.warnings.append(
            f"Some cameras have several poses that differ: {shortened(moving)}. Their first ones are taken, because "
            "cameras have to stand still."
        )
    others = _other_models(model_folder)
    if others:
        rig.warnings.append(f"Other models next to {model_folder.name} are ignored: {others}.")
    return rig


def _grouped(images: list[ColmapImage]) -> tuple[dict[str, list[ColmapImage]], list[str]]:
    """Images by the name of their camera, the folder where there are several folders, else the file.

    Returns:
        Also the names that several files have which are cameras of their own, such as cam1.jpg and cam1.png.
    """
    parts = [_parts(image.name) for image in images]
    folders = {part[:-1] for part in parts}
    by_camera: dict[str, list[ColmapImage]] = {}
    is_last_enough = len({folder[-1:] for folder in folders}) == len(folders)
    twice: list[str] = []
    for image, part in zip(images, parts, strict=True):
        is_folder = len(folders) > 1 and bool(part[:-1])
        in_folder = part[-2] if is_folder and is_last_enough else "_".join(part[:-1])
        name = in_folder if is_folder else os.path.splitext(part[-1])[0]
        if name in by_camera and not is_folder:
            twice.append(name)
        by_camera.setdefault(name, []).append(image)
    return by_camera, list(dict.fromkeys(twice))


def _parts(image_name: str) -> tuple[str, ...]:
    """Folders and file of an image, without a folder that only says that images are in it."""
    parts = PurePosixPath(image_name.replace("\\", "/")).parts or (image_name,)
    while len(parts) > 1 and (parts[0].lower() in IMAGE_FOLDERS or parts[0] in (".", "/")):
        parts = parts[1:]
    return parts


def _camera(name: str, image: ColmapImage, model: ColmapModel) -> ModelCamera:
    cameras_file = model.images_file.with_name(model.images_file.name.replace("images", "cameras"))
    camera = model.cameras.get(image.camera_id)
    if camera is None:
        text = f"Its image {shown(image.name)} is of camera {image.camera_id}, which the model does not have."
        raise CaptureError(text, hint="Export the model again.", path=cameras_file)
    size = parse_size(camera.width, camera.height)
    if size is None:
        raise size_problem("Its size is", camera.width, camera.height, cameras_file)
    try:
        K, lens = calibration_of(camera.model_id, camera.params)
    except CaptureError as error:
        raise CaptureError(error.message, hint=error.hint, path=cameras_file) from error
    return ModelCamera(name, image.name, K, lens, size, image.world_to_camera)


def _moving(grouped: dict[str, list[ColmapImage]], cameras: list[ModelCamera]) -> list[str]:
    """Cameras whose images have different poses, with how many."""
    if not any(len(images) > 1 for images in grouped.values()):
        return []
    places = np.array([camera.world_to_camera[:3, 3] for camera in cameras]).reshape(-1, 3)
    with np.errstate(invalid="ignore", over="ignore"):
        size = float(np.abs(places).max(initial=0.0)) or 1.0
        tolerance = SAME_POSE * np.array([1.0, 1.0, 1.0, size])
        found = []
        for name in sorted(grouped, key=natural_key):
            poses = np.stack([image.world_to_camera[:3] for image in grouped[name]])
            if (np.ptp(poses, axis=0) > tolerance).any():
                found.append(f"{name} {len(poses)}")
    return found


def _other_models(model_folder: Path) -> str:
    if not model_folder.name.isdecimal():
        return ""
    try:
        with os.scandir(model_folder.parent) as entries:
            names = [entry.name for entry in entries if entry.name.isdecimal() and entry.name != model_folder.name]
        return shortened(sorted((name for name in names if has_model(model_folder.parent / name)), key=natural_key))
    except OSError:
        return ""
