"""The cameras of a folder of plain videos: one video, or one folder of images, per camera. No calibration is read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from engine.capture.files.folder_contents import folder_contents
from engine.capture.files.frame_files import IMAGE_SUFFIXES, VIDEO_SUFFIXES, folders_in, listed
from engine.capture.files.media import read_image_header, read_video_header
from engine.capture.files.places import place_in
from engine.capture.frames import FrameSource, ImageFrames, VideoFrames
from engine.capture.layout.format_checks import raise_problems
from engine.errors import CaptureError

MIN_CAMERAS = 3
"""Two cameras see a scene, but focal lengths and what lies far apart cannot be distinguished from two alone."""
UNSTATED_FPS = 30.0
"""Taken for images, and for videos that state no rate."""


@dataclass(frozen=True, slots=True)
class PlainVideo:
    """One camera before it is calibrated.

    Attributes:
        name: Of its file or folder, without suffix.
        source: Its frames.
        size: Width and height.
        fps: Frames per second as stated; 0 where nothing is.
    """

    name: str
    source: FrameSource
    size: tuple[int, int]
    fps: float


def find_videos(folder: Path, *, follow_links: bool = False, least: int = MIN_CAMERAS) -> list[PlainVideo]:
    """The cameras of a folder in natural order: its video files, or folders of images where it has no videos.

    Args:
        folder: Of the videos.
        follow_links: Whether links in it may lead out of it.
        least: Cameras that are needed.
    Raises:
        CaptureError: The folder cannot be read, or has fewer cameras, or files are damaged, or lie
            elsewhere; lists every problem found.
    """
    if not folder.is_dir():
        what = "This is a file; name the folder of the videos." if folder.exists() else "There is no such folder."
        raise CaptureError(what, hint="Check the path.", path=folder)
    try:
        videos = [folder / name for name in listed(folder, VIDEO_SUFFIXES)]
        folders = {} if videos else _image_folders(folder)
    except OSError as error:
        raise CaptureError(
            f"The folder cannot be read ({error.strerror}).", hint="Check that you may read it.", path=folder
        ) from error
    found: list[PlainVideo] = []
    problems: list[CaptureError] = []
    for path in videos or folders:
        try:
            for file in (path, *folders.get(path, ())):
                place_in(folder, str(file.relative_to(folder)), follow_links=follow_links, named_in=folder)
            found.append(_video(path) if videos else _images(path, folders[path]))
        except CaptureError as error:
            problems.append(error)
    names = [video.name for video in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        text = f"Several files are called {', '.join(twice)}, apart from their suffix."
        problems.append(CaptureError(text, hint="Keep one file per camera.", path=folder))
    raise_problems(problems, folder)
    if len(found) < least:
        words = "1 camera was" if len(found) == 1 else f"{len(found)} cameras were"
        raise CaptureError(
            f"{words} found; at least {least} are needed. In it: {folder_contents(folder)}.",
            hint="Put one video file per camera into one folder, or one folder of images per camera.",
            path=folder,
        )
    return found


def common_length(videos: list[PlainVideo]) -> int:
    """Frames that all cameras have."""
    return min(video.source.n_frames for video in videos)


def common_rate(videos: list[PlainVideo]) -> float:
    """Frames per second of most cameras; UNSTATED_FPS where none states it."""
    rates = sorted(video.fps for video in videos if video.fps > 0)
    return rates[len(rates) // 2] if rates else UNSTATED_FPS


def _video(path: Path) -> PlainVideo:
    header = read_video_header(path)
    return PlainVideo(path.stem, VideoFrames(path, header.n_frames), header.size, header.rate)


def _image_folders(folder: Path) -> dict[Path, list[Path]]:
    """Folders with their images in natural order; folders without images are left out."""
    inside = [folder / name for name in folders_in(folder)]
    found = {path: [path / name for name in listed(path, IMAGE_SUFFIXES)] for path in inside}
    return {path: images for path, images in found.items() if images}


def _images(path: Path, files: list[Path]) -> PlainVideo:
    return PlainVideo(path.name, ImageFrames(path, files), read_image_header(files[0]).size, 0.0)
