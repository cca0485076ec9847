"""Finding the frames of a camera by its name, for layouts whose tables name cameras but no files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from engine.capture.files.frame_files import VIDEO_SUFFIXES, Files, folders_in, frames_in_folder, listed, plain_name
from engine.capture.files.places import place_in
from engine.capture.files.recording_names import by_order, by_pattern, by_serial, folder_names
from engine.capture.layout.format_checks import shortened
from engine.errors import CaptureError
from engine.text import shown


class FrameSearch:
    """The contents of the folders where a layout keeps its frames, listed once for all cameras.

    Args:
        folder: The capture folder.
        directories: Below it, in the order in which they are looked through; "" is the folder itself.
        follow_links: Whether files may lie outside of the folder.
        named_in: The file that names the cameras, for messages.
    """

    def __init__(self, folder: Path, directories: Sequence[str], *, follow_links: bool, named_in: Path) -> None:
        self._folder, self._follow_links, self._named_in = folder, follow_links, named_in
        self._directories = tuple(directories)
        self._places: list[tuple[str, str, bool]] = []  # name without suffix, place below the folder, is a video
        self._taken: set[str] = set()  # plain names of places that belong to a camera
        for directory in directories:
            inside = folder / directory if directory else folder
            try:
                if directory:
                    place_in(folder, directory, follow_links=follow_links, named_in=named_in)
                names = listed(inside, VIDEO_SUFFIXES) if inside.is_dir() else []
                below = folders_in(inside) if inside.is_dir() else []
            except OSError:  # not readable: then nothing of it is there
                continue
            prefix = f"{directory}/" if directory else ""
            self._places += [(name, prefix + name, False) for name in below if prefix + name not in self._directories]
            self._places += [(os.path.splitext(name)[0], prefix + name, True) for name in names]

    def find(self, names: Sequence[str]) -> Files | None:
        """Frames of the camera that goes by these names, the likeliest first; None where there are none.

        A name fits as it is written; where none does, also when only case, separators and leading zeros differ and no
        other place fits too.

        Raises:
            CaptureError: Several fit equally well, a folder is empty, or a link leads out of the folder.
        """
        for name in names:
            for known, place, is_video in self._places:
                if known == name:
                    self._taken.add(plain_name(known))
                    return self._at(place, is_video=is_video)
        for name in names:
            alike = [found for found in self._places if plain_name(found[0]) == plain_name(name)]
            if len({known for known, _, _ in alike}) > 1:
                several = shortened([place for _, place, _ in alike])
                hint = f"Name one of them {shown(name)}."
                raise CaptureError(f"Its frames may be {several}.", hint=hint, path=self._named_in)
            if alike:
                self._taken.add(plain_name(name))
                return self._at(alike[0][1], is_video=alike[0][2])
        return None

    def files(self, names: Sequence[str]) -> Files:
        """Likewise; also raises where there are none, and says what there is."""
        found = self.find(names)
        if found is not None:
            return found
        where = " or ".join(f"{directory}/" if directory else "the folder" for directory in self._directories)
        there = shortened([place for _, place, _ in self._places])
        raise CaptureError(
            f"No video or folder of images is called {shown(names[0])} in {where}.",
            hint=f"Name frames as the calibration names cameras; found are {there}." if there else "Add its frames.",
            path=self._named_in,
        )

    def has(self, names: Sequence[str]) -> bool:
        """Whether something is called by one of these names, up to case, separators and leading zeros."""
        plain = {plain_name(name) for name in names}
        return any(plain_name(known) in plain for known, _, _ in self._places)

    def assigned(self, cameras: Mapping[str, Sequence[str]]) -> tuple[dict[str, Path], str]:
        """Videos of cameras where none is called as its camera: by serial numbers, by what all names share, by order.

        Args:
            cameras: The names that each camera goes by.
        Returns:
            Videos by camera, nothing where something goes by a name of a camera; and a sentence that says how they
            were found, "" where nobody could doubt it.
        Raises:
            CaptureError: Videos of several recordings fit, or a link leads out of the folder.
        """
        videos = [place for _, place, is_video in self._places if is_video]
        if not videos or any(self.has(names) for names in cameras.values()):
            return {}, ""
        short = {(folder_names(name) or [name])[0]: name for name in cameras}
        if found := by_serial(list(cameras), videos):
            note = ""
        elif found := {short[name]: video for name, video in by_pattern(list(short), videos).items()}:
            note = "Videos are matched by similar names"
        else:
            found = dict(by_order(list(cameras), videos))
            note = "No video is named after its camera; they are taken in name order, as Pose2Sim does"
        pairs = shortened([f"{name} is {video}" for name, video in found.items()])
        self._taken.update(plain_name(os.path.splitext(os.path.basename(video))[0]) for video in found.values())
        options = {"follow_links": self._follow_links, "named_in": self._named_in}
        paths = {name: place_in(self._folder, video, **options) for name, video in found.items()}
        return paths, f"{note}: {pairs}." if found and note else ""

    def left_over(self) -> list[str]:
        """A sentence about videos that belong to none of the cameras asked for so far; none where all do."""
        videos = [place for known, place, is_video in self._places if is_video and plain_name(known) not in self._taken]
        return [f"Videos of which the calibration has no camera are left out: {shortened(videos)}."] if videos else []

    def masks(self, names: Sequence[str], frames: Files) -> tuple[Files | None, str]:
        """Masks that fit the frames of a camera: a video, or for each image one of the same name.

        Returns:
            None where there are none, and what is wrong with them, "" where nothing is.
        """
        try:
            found = self.find(names)
        except CaptureError as error:
            return None, error.message[0].lower() + error.message[1:].rstrip(".")
        if found is None:
            return None, ""
        if isinstance(found, Path) or isinstance(frames, Path):
            return found, ""
        by_name = {path.stem: path for path in found}
        lacking = [path.stem for path in frames if path.stem not in by_name]
        if lacking:
            return None, f"no mask for {len(lacking)} of {len(frames)} frames, such as {shown(lacking[0])}"
        return [by_name[path.stem] for path in frames], ""

    def _at(self, place: str, *, is_video: bool) -> Files:
        options = {"follow_links": self._follow_links, "named_in": self._named_in}
        return (
            place_in(self._folder, place, **options) if is_video else frames_in_folder(self._folder, place, **options)
        )
