"""Where the frames of cameras lie: images of a folder or a pattern in natural order, videos by the name of a camera."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from engine.capture.files.places import place_in
from engine.errors import CaptureError
from engine.text import shown

IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp")
VIDEO_SUFFIXES = (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm", ".mts", ".ts", ".mpg", ".mxf")
INNER_FOLDERS = ("images", "")
"""Where in the folder of a camera its images lie."""
Files = Path | Sequence[Path]
"""A video, or one image per frame."""
MAX_DIGITS = 300
"""Of a number in a name: no file name has longer ones, and Python refuses to count so far."""
_NUMBER = re.compile(r"(\d+)")
_SEPARATORS = re.compile(r"[\s_.\-]+")
_ZEROS = re.compile(r"(?<!\d)0+(?=\d)")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Key that sorts names as people count: cam2 before cam10."""
    parts = _NUMBER.split(name)
    return tuple((1, int(part[:MAX_DIGITS]), part) if row % 2 else (0, 0, part) for row, part in enumerate(parts))


def listed(folder: Path, suffixes: Sequence[str]) -> list[str]:
    """Names of files in a folder that end so, whatever their case, in natural order; hidden ones are left out.

    Raises:
        OSError: The folder cannot be read.
    """
    with os.scandir(folder) as entries:
        names = [entry.name for entry in entries if not entry.name.startswith(".")]
    return sorted((name for name in names if os.path.splitext(name)[1].lower() in suffixes), key=natural_key)


def folders_in(folder: Path) -> list[str]:
    """Names of folders in a folder, in natural order; hidden ones are left out. Raises OSError."""
    with os.scandir(folder) as entries:
        names = [entry.name for entry in entries if not entry.name.startswith(".") and _is_folder(entry)]
    return sorted(names, key=natural_key)


def image_files(folder: Path, files: str | Sequence[str], *, follow_links: bool, named_in: Path) -> list[Path]:
    """Image files that a capture names: a list, or a pattern whose last part has stars.

    Args:
        folder: The capture folder.
        files: "images/cam00/*.png", or names relative to the folder.
        follow_links, named_in: See `place_in`.
    Raises:
        CaptureError: Nothing matches, or a name leads out of the folder.
    """
    if not isinstance(files, str):
        return [place_in(folder, name, follow_links=follow_links, named_in=named_in) for name in files]
    directory, _, pattern = files.rpartition("/")
    hint = "Name a folder of images with a pattern, such as images/cam00/*.png."
    if not pattern or "*" in directory:
        raise CaptureError(f"{shown(files)} is not a pattern of file names.", hint=hint, path=named_in)
    inside = folder if not directory else place_in(folder, directory, follow_links=follow_links, named_in=named_in)
    try:
        names = [name for name in listed(inside, IMAGE_SUFFIXES) if fnmatchcase(name, pattern)]
    except OSError as error:
        text = f"The folder of {shown(files)} cannot be read ({error.strerror})."
        raise CaptureError(text, hint="Check that it is there and that you may read it.", path=inside) from error
    if not names:
        raise CaptureError(f"No image matches {shown(files)}.", hint=hint, path=inside)
    return images_in(folder, directory, names, follow_links=follow_links, named_in=named_in)


def images_in(folder: Path, directory: str, names: Sequence[str], *, follow_links: bool, named_in: Path) -> list[Path]:
    """Paths of files in one folder below the capture's, of which only links are looked at one by one.

    Raises:
        CaptureError: A link leads out of the capture folder.
    """
    inside = folder / directory if directory else folder
    if not follow_links:
        place_in(folder, f"{directory}/{names[0]}" if directory else names[0], follow_links=False, named_in=named_in)
        with os.scandir(inside) as entries:
            links = {entry.name for entry in entries if entry.is_symlink()}
        for name in names:
            if name in links:
                place_in(folder, f"{directory}/{name}" if directory else name, follow_links=False, named_in=named_in)
    return [inside / name for name in names]


def frames_in_folder(folder: Path, directory: str, *, follow_links: bool, named_in: Path) -> Files:
    """Frames of one camera: the images in its folder or in "images" inside it, or its only video.

    Args:
        folder: Of the capture.
        directory: Of the camera, relative to it.
        follow_links, named_in: See `place_in`.
    Raises:
        CaptureError: There are none, images of several kinds, or several videos.
    """
    where = place_in(folder, directory, follow_links=follow_links, named_in=named_in)
    videos: list[str] = []
    try:
        for inner in INNER_FOLDERS:
            inside = f"{directory}/{inner}" if inner else directory
            if not (folder / inside).is_dir():
                continue
            names = listed(folder / inside, IMAGE_SUFFIXES)
            if names:
                check_one_kind(names, folder / inside)
                return images_in(folder, inside, names, follow_links=follow_links, named_in=named_in)
            videos = videos or [f"{inside}/{name}" for name in listed(folder / inside, VIDEO_SUFFIXES)]
    except OSError as error:
        text = f"Its folder cannot be read ({error.strerror})."
        raise CaptureError(text, hint="Check that you may read it.", path=where) from error
    if len(videos) == 1:
        return place_in(folder, videos[0], follow_links=follow_links, named_in=named_in)
    text = f"Its folder has {len(videos)} videos." if videos else "Its folder has no images and no video."
    raise CaptureError(text, hint="Put one video or the images of all frames there.", path=where)


def check_one_kind(names: Sequence[str], folder: Path) -> None:
    """Raise CaptureError where images of a folder have different suffixes: which of them are the frames?"""
    kinds = Counter(os.path.splitext(name)[1].lower() for name in names)
    if len(kinds) > 1:
        counts = " and ".join(f"{n} {kind}" for kind, n in kinds.most_common())
        hint = "Keep the frames there and take the others out."
        raise CaptureError(f"The folder has {counts} images.", hint=hint, path=folder)


def plain_name(name: str) -> str:
    """A key that is the same for names that people would call the same, as cam1 and Cam_001."""
    return _ZEROS.sub("", _SEPARATORS.sub("", name).casefold())


def _is_folder(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir()
    except OSError:  # a link to itself
        return False
