"""Cameras and images of a sparse model, read strictly from binary files or text. Nothing of COLMAP is needed for it.

Binary files are little endian: a count, then records one after the other. What is not needed, as the features of the
images, is skipped in the file and never loaded. Files that newer versions add (rigs, frames) repeat
the data here.
"""

from __future__ import annotations

import errno
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from engine.capture.colmap.camera_models import BY_NAME, MODELS, UNREAD_PARAMS
from engine.capture.files.places import MAX_NAME_BYTES
from engine.capture.layout.limits import MAX_CAMERA_ID
from engine.errors import CaptureError
from engine.storage.files import open_regular
from engine.text import shown

AGAIN = "Export the model again; it may be cut off."
MAX_IMAGES = 100_000
"""Images and cameras of a model that are read."""
MAX_LINE_BYTES = 64 << 20
"""Longest line of text: images.txt has all features of an image in one."""
MAX_WORDS_BYTES = 4096
"""Longest line that is looked into: a camera, an image, a point without its track."""
UNIT_TOLERANCE = 0.01
"""How far from 1 the length of a quaternion may be; it is then made 1."""


@dataclass(frozen=True, eq=False)
class ColmapCamera:
    """A camera as the file has it. params are as many as its model has; width and height are pixels."""

    model_id: int
    width: int
    height: int
    params: np.ndarray


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """An image as the file has it. world_to_camera [4, 4] is not checked."""

    name: str
    camera_id: int
    world_to_camera: np.ndarray


@dataclass(frozen=True, eq=False)
class ColmapModel:
    """Cameras by their number and images in the order of the file.

    Attributes:
        folder: Where the files lie.
        is_binary: Whether they are binary.
    """

    folder: Path
    is_binary: bool
    cameras: dict[int, ColmapCamera]
    images: list[ColmapImage]

    @property
    def images_file(self) -> Path:
        """The file with the poses, for messages."""
        return self.folder / ("images.bin" if self.is_binary else "images.txt")


def has_model(folder: Path) -> bool:
    """Whether cameras and images of a model are there, by their names."""
    return any(
        (folder / f"cameras{suffix}").is_file() and (folder / f"images{suffix}").is_file()
        for suffix in (".bin", ".txt")
    )


def read_model(folder: Path) -> ColmapModel:
    """Cameras and images in a folder, binary files before text.

    Raises:
        CaptureError: A file is missing, cannot be read, or is damaged.
    """
    is_binary = (folder / "cameras.bin").is_file() and (folder / "images.bin").is_file()
    suffix = ".bin" if is_binary else ".txt"
    cameras_file, images_file = folder / f"cameras{suffix}", folder / f"images{suffix}"
    with _opened(cameras_file) as file:
        cameras = _binary_cameras(file, cameras_file) if is_binary else _text_cameras(file, cameras_file)
    with _opened(images_file) as file:
        images = _binary_images(file, images_file) if is_binary else _text_images(file, images_file)
    return ColmapModel(folder, is_binary, cameras, images)


def damaged(path: Path, why: str) -> CaptureError:
    """The error for a file of a model that is not what it should be. why: part of a sentence."""
    return CaptureError(f"The file is damaged or not a COLMAP file: {why}.", hint=AGAIN, path=path)


def unreadable(path: Path, error: OSError) -> CaptureError:
    """The error for a file that the system does not let us read."""
    if error.errno == errno.ENOENT:
        return CaptureError("The file is missing.", hint="Put it back or export the model again.", path=path)
    return CaptureError(
        f"The file cannot be read ({error.strerror or error}).", hint="Check that you may read it.", path=path
    )


def pose_of(quaternion: np.ndarray, translation: np.ndarray) -> np.ndarray:
    """World to camera [4, 4] of a quaternion w x y z, made unit where it almost is, and a translation.

    One that is far from unit keeps its length, and what comes of it fails the check of poses.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        length = float(np.sqrt((quaternion**2).sum()))
        w, x, y, z = quaternion / length if abs(length - 1.0) <= UNIT_TOLERANCE else quaternion
        pose = np.eye(4)
        pose[:3, :3] = [
            [w * w + x * x - y * y - z * z, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), w * w - x * x + y * y - z * z, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), w * w - x * x - y * y + z * z],
        ]
    pose[:3, 3] = translation
    return pose


class BinaryReader:
    """Records of a binary file, each no further than its end."""

    def __init__(self, file: BinaryIO, path: Path) -> None:
        self._file, self._path = file, path
        self._left = os.fstat(file.fileno()).st_size

    def count(self, least_bytes: int, what: str) -> int:
        """How many records follow, each of `least_bytes` or more. Raises CaptureError where they do not fit."""
        (n,) = self.record("<Q")
        if n * least_bytes > self._left:
            raise damaged(self._path, f"it announces {n} {what}, but only {self._left} bytes follow")
        return n

    def record(self, layout: str) -> tuple:
        """Values of a struct. Raises CaptureError where the file ends before."""
        return struct.unpack(layout, self.take(struct.calcsize(layout)))

    def take(self, n_bytes: int) -> bytes:
        """The next bytes. Raises CaptureError where the file ends before."""
        self._use(n_bytes)
        data = self._file.read(n_bytes)
        if len(data) != n_bytes:
            raise damaged(self._path, "it ends too early")
        return data

    def skip(self, n_bytes: int) -> None:
        """Leave bytes out. Raises CaptureError where the file ends before."""
        self._use(n_bytes)
        self._file.seek(n_bytes, os.SEEK_CUR)

    def text(self) -> str:
        """Text up to a zero byte. Raises CaptureError where it is too long or not UTF-8."""
        start = self._file.tell()
        data = self._file.read(min(MAX_NAME_BYTES + 1, self._left))
        end = data.find(b"\0")
        if end < 0:
            raise damaged(self._path, "a name does not end")
        self._file.seek(start + end + 1)
        self._use(end + 1)
        return _decoded(data[:end], self._path)

    def end(self) -> None:
        """Raises CaptureError where anything is left."""
        if self._left:
            raise damaged(self._path, f"{self._left} bytes are left over")

    def _use(self, n_bytes: int) -> None:
        if n_bytes > self._left:
            raise damaged(self._path, "it ends too early")
        self._left -= n_bytes


def lines_of(file: BinaryIO, path: Path) -> Iterator[bytes]:
    """Lines of a text file without comments; those of images.txt may be empty.

    Raises:
        CaptureError: A line is too long.
    """
    while line := file.readline(MAX_LINE_BYTES + 1):
        if len(line) > MAX_LINE_BYTES:
            raise damaged(path, "a line is too long")
        if not line.startswith(b"#"):
            yield line


def numbers(words: list[str], path: Path) -> np.ndarray:
    """Words as numbers [N]. Raises CaptureError where one is not a number."""
    try:
        return np.array([float(word) for word in words])
    except ValueError as error:
        raise damaged(path, f"{shown(' '.join(words))} are not numbers") from error


def whole(word: str, path: Path) -> int:
    """A word as a whole number. Raises CaptureError where it is not one."""
    if not word.isascii() or not word.isdigit() or len(word) > 10 or int(word) > MAX_CAMERA_ID:
        raise damaged(path, f"{shown(word)} is not a number of a camera or a size")
    return int(word)


def _opened(path: Path) -> BinaryIO:
    try:
        return open_regular(path)
    except OSError as error:
        raise unreadable(path, error) from error


def _decoded(data: bytes, path: Path) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise damaged(path, "a name is not UTF-8") from error


def _checked_camera(cameras: dict[int, ColmapCamera], camera_id: int, camera: ColmapCamera, path: Path) -> None:
    if camera_id in cameras:
        raise damaged(path, f"camera {camera_id} occurs twice")
    if not (0 < camera.width <= 1 << 30 and 0 < camera.height <= 1 << 30):
        raise damaged(path, f"camera {camera_id} has {camera.width} x {camera.height} pixels")
    cameras[camera_id] = camera


def _binary_cameras(file: BinaryIO, path: Path) -> dict[int, ColmapCamera]:
    reader = BinaryReader(file, path)
    n_cameras = reader.count(24 + 16, "cameras")
    _check_number(n_cameras, path)
    cameras: dict[int, ColmapCamera] = {}
    for _ in range(n_cameras):
        camera_id, model_id, width, height = reader.record("<IiQQ")
        n_params = MODELS[model_id].n_params if model_id in MODELS else UNREAD_PARAMS.get(model_id)
        if n_params is None:
            raise damaged(path, f"camera {camera_id} has the unknown model number {model_id}")
        params = np.array(reader.record(f"<{n_params}d"))
        _checked_camera(cameras, camera_id, ColmapCamera(model_id, width, height, params), path)
    reader.end()
    return cameras


def _text_cameras(file: BinaryIO, path: Path) -> dict[int, ColmapCamera]:
    cameras: dict[int, ColmapCamera] = {}
    for line in lines_of(file, path):
        words = _words(line, path, 40)
        if not words:
            continue
        if len(words) < 5:
            raise damaged(path, f"{shown(' '.join(words))} is not a camera")
        camera_id, name = whole(words[0], path), words[1]
        if name not in BY_NAME:
            raise damaged(path, f"camera {camera_id} has the unknown model {shown(name)}")
        model_id, params = BY_NAME[name], numbers(words[4:], path)
        n_params = MODELS[model_id].n_params if model_id in MODELS else UNREAD_PARAMS[model_id]
        if len(params) != n_params:
            raise damaged(path, f"camera {camera_id} has {len(params)} parameters, {name} has {n_params}")
        camera = ColmapCamera(model_id, whole(words[2], path), whole(words[3], path), params)
        _checked_camera(cameras, camera_id, camera, path)
        _check_number(len(cameras), path)
    return cameras


def _check_number(n: int, path: Path) -> None:
    if n > MAX_IMAGES:
        raise CaptureError(f"It has {n} entries, at most {MAX_IMAGES} are read.", hint=AGAIN, path=path)


def _binary_images(file: BinaryIO, path: Path) -> list[ColmapImage]:
    reader = BinaryReader(file, path)
    n_images = reader.count(4 + 56 + 4 + 1 + 8, "images")
    _check_number(n_images, path)
    images = []
    for _ in range(n_images):
        _, *values, camera_id = reader.record("<I7dI")
        name = reader.text()
        reader.skip(24 * reader.count(24, "features"))
        images.append(ColmapImage(name, camera_id, pose_of(np.array(values[:4]), np.array(values[4:]))))
    reader.end()
    return images


def _text_images(file: BinaryIO, path: Path) -> list[ColmapImage]:
    images = []
    lines = lines_of(file, path)
    for line in lines:
        words = _words(line, path, 10)
        if not words:
            continue
        if len(words) < 10:
            raise damaged(path, f"{shown(' '.join(words))} is not an image")
        values = numbers(words[1:8], path)
        images.append(ColmapImage(words[9], whole(words[8], path), pose_of(values[:4], values[4:])))
        _check_number(len(images), path)
        next(lines, b"")  # its features, which may be none
    return images


def _words(line: bytes, path: Path, at_most: int) -> list[str]:
    """The words of a line, the last one with what follows it: names may have spaces."""
    if len(line) > MAX_WORDS_BYTES:
        raise damaged(path, "a line is too long")
    return _decoded(line, path).strip().split(None, at_most - 1)
