"""Scenes of other programs as frames of Gaussians: a file over time, a file per frame in a folder, or one file."""

from __future__ import annotations

import itertools
import os
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Protocol

from msgspec import Meta, Struct

from engine.capture.files.frame_files import VIDEO_SUFFIXES, listed, natural_key
from engine.capture.files.frame_runs import runs_of
from engine.capture.files.places import place_in
from engine.capture.formats.imported import Quat, ScenePlace
from engine.capture.layout.format_checks import read_json_object
from engine.errors import CaptureError, ProjectError
from engine.export.formats.damaged import damaged
from engine.export.formats.table import read_file
from engine.export.sequences.sequence import SequenceReader
from engine.export.sequences.table import SEQUENCES
from engine.export.splats import Splats
from engine.importing.suffixes import FRAME_SUFFIXES, SEQUENCE_SUFFIXES, is_scene_file
from engine.storage.files import open_regular
from engine.storage.typed_json import EntryError, to_type

SIDECAR = "_export.json"
"""End of the name of the file that our own exports describe their frames in."""
MAX_FILE_BYTES = 2 << 30
"""Of a file that holds one frame."""
MAX_FILES = 100_000
_LAST_NUMBER = re.compile(r"(\d+)\D*$")
_LISTED = 3

Vector = tuple[float, float, float]


class SceneSource(Protocol):
    """An opened scene. Frames are read one at a time, in any order.

    Attributes:
        fps: Frames per second; None where nothing says so.
        up: Which way is up; None where nothing says so.
        place: Where an export of our own placed it; None where nothing says so.
    """

    fps: float | None
    up: Vector | None
    place: ScenePlace | None

    @property
    def n_frames(self) -> int:
        """At least one."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What is odd, or not kept, as sentences for the user."""
        ...

    def splats(self, frame: int) -> Splats:
        """All Gaussians of a frame that can be drawn. Raises ProjectError where it is damaged."""
        ...

    def close(self) -> None:
        """Let go of open files."""
        ...


class _Sidecar(Struct, frozen=True):
    """What an export of our own says about its files."""

    fps: Annotated[float, Meta(gt=0, lt=1e6)]
    up: Vector
    files: list[dict[str, Any]]
    scale: float = 1.0
    quat: Quat | None = None

    @property
    def place(self) -> ScenePlace | None:
        """Where the scene lies. Raises ValueError."""
        return None if self.quat is None else ScenePlace(self.quat, self.scale)


def is_scene(path: Path) -> bool:
    """Whether a path looks like a scene that can be imported; a folder with videos, or one that cannot be looked into,
    does not."""
    try:
        if not path.is_dir():
            return is_scene_file(path)
        return bool(_frame_names(path)) and not listed(path, VIDEO_SUFFIXES)
    except (OSError, ProjectError):
        return False


def open_scene(path: Path) -> SceneSource:
    """Open a scene.

    Args:
        path: A file over time, a file of one frame, or a folder with a file per frame.
    Raises:
        ProjectError: It is none of these, or cannot be used.
    """
    try:
        if path.is_dir():
            return _open_folder(path)
        if not path.exists():
            raise ProjectError("There is no such file or folder.", hint="Check the path.", path=path)
        for row in SEQUENCES.values():
            if path.suffix.lower() == row.suffix and row.suffix in SEQUENCE_SUFFIXES:
                return SequenceScene(row.open(path))
        if path.suffix.lower() in FRAME_SUFFIXES:
            return FrameFiles([path])
    except (OSError, CaptureError) as error:
        reason = getattr(error, "strerror", None) or getattr(error, "message", str(error))
        raise ProjectError(f"The scene cannot be read: {reason}", hint="Check its files.", path=path) from error
    known = ", ".join((*SEQUENCE_SUFFIXES, *FRAME_SUFFIXES))
    raise ProjectError(f"This is not a scene that can be imported; these are {known}.", path=path)


class SequenceScene:
    """A file over time. reader: It is closed with this, or where its first frame cannot be read."""

    def __init__(self, reader: SequenceReader) -> None:
        self._reader = reader
        self.fps: float | None = reader.timing.fps
        self.place: ScenePlace | None = None
        try:
            self.up: Vector | None = reader.splats(0).up
        except BaseException:
            reader.close()
            raise
        self._seen = _Seen()

    @property
    def n_frames(self) -> int:
        """Of the file."""
        return self._reader.timing.n_frames

    @property
    def notes(self) -> tuple[str, ...]:
        """See SceneSource."""
        sound = () if self._reader.timing.sound is None else ("Its sound is not kept.",)
        return (*self._reader.notes, *sound, *self._seen.notes())

    def splats(self, frame: int) -> Splats:
        """See SceneSource."""
        return self._seen.fit(self._reader.splats(frame))

    def close(self) -> None:
        """Let go of the file."""
        self._reader.close()


class FrameFiles:
    """A file per frame."""

    def __init__(
        self,
        files: Sequence[Path],
        *,
        fps: float | None = None,
        up: Vector | None = None,
        place: ScenePlace | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        self.files, self.fps, self.up, self.place = tuple(files), fps, up, place
        self._notes, self._seen = tuple(notes), _Seen()

    @property
    def n_frames(self) -> int:
        """Number of files."""
        return len(self.files)

    @property
    def notes(self) -> tuple[str, ...]:
        """See SceneSource."""
        return (*self._notes, *self._seen.notes())

    def splats(self, frame: int) -> Splats:
        """See SceneSource."""
        path = self.files[frame]
        try:
            with open_regular(path) as file:
                n_bytes = os.fstat(file.fileno()).st_size
                if n_bytes > MAX_FILE_BYTES:
                    raise damaged(f"it has {n_bytes / 1e9:.1f} GB, at most {MAX_FILE_BYTES / 1e9:.1f} are read")
                return self._seen.fit(_read(path, file))
        except ProjectError as error:
            raise ProjectError(error.message, hint=error.hint, path=path) from error
        except OSError as error:
            reason = error.strerror or str(error)
            raise ProjectError(f"The file cannot be read ({reason}).", hint="Check the file.", path=path) from error

    def close(self) -> None:
        """Nothing is held open."""


class _Seen:
    """What the frames that were read had to leave out."""

    def __init__(self) -> None:
        self._sh_degree = self._n_dropped = 0

    def fit(self, splats: Splats) -> Splats:
        """The Gaussians that can be drawn."""
        fit = Splats.from_arrays(splats.means, splats.quats, splats.scales, splats.opacities, splats.colors)
        self._sh_degree = max(self._sh_degree, splats.sh_degree)
        self._n_dropped += splats.n_dropped + fit.n_dropped
        return fit

    def notes(self) -> tuple[str, ...]:
        """As sentences."""
        said = []
        if self._sh_degree:
            said.append(
                f"Colours that change with the viewing direction (degree {self._sh_degree}) are not kept, only those "
                "of degree 0."
            )
        if self._n_dropped:
            said.append(f"{self._n_dropped:,} Gaussians that cannot be drawn were left out.")
        return tuple(said)


def _read(path: Path, file: Any) -> Splats:
    return read_file(path.suffix.lower(), file)


def _frame_names(folder: Path) -> list[str]:
    """Names of files of one frame in a folder, in natural order. Raises OSError."""
    names = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.lower().endswith(FRAME_SUFFIXES) and not entry.name.startswith("."):
                names.append(entry.name)
            if len(names) > MAX_FILES:
                raise ProjectError(f"The folder holds more than {MAX_FILES:,} frames.", path=folder)
    return sorted(names, key=natural_key)


def _open_folder(folder: Path) -> FrameFiles:
    names = _frame_names(folder)
    if not names:
        known = ", ".join(FRAME_SUFFIXES)
        raise ProjectError(
            "No frame of Gaussians was found in this folder.", hint=f"Frames are files of {known}.", path=folder
        )
    kinds = Counter(Path(name).suffix.lower() for name in names)
    if len(kinds) > 1:
        found = " and ".join(f"{n} {kind}" for kind, n in kinds.items())
        raise ProjectError(
            f"The folder holds {found} files.", hint="Put one kind into a folder of its own.", path=folder
        )
    files = [place_in(folder, name, follow_links=False, named_in=folder) for name in names]
    sidecar = _sidecar(folder)
    if sidecar is None:
        return FrameFiles(files, notes=_gaps(names))
    parts = {str(one.get("part")) for one in sidecar.files}
    if parts != {"all"}:
        raise ProjectError(
            "This export holds parts of a scene in files of their own.",
            hint="Export the whole scene to import it.",
            path=folder,
        )
    step = _step(names)  # every so many frames were exported
    notes = [] if step > 1 else _gaps(names)
    return FrameFiles(files, fps=sidecar.fps / step, up=sidecar.up, place=sidecar.place, notes=notes)


def _sidecar(folder: Path) -> _Sidecar | None:
    with os.scandir(folder) as entries:
        names = sorted(entry.name for entry in entries if entry.name.endswith(SIDECAR))
    if len(names) != 1:
        return None
    path = place_in(folder, names[0], follow_links=False, named_in=folder)
    try:
        found = to_type(read_json_object(path), _Sidecar)
        _ = found.place
        return found
    except (EntryError, ValueError) as error:
        raise ProjectError(
            f"The description of the export is damaged ({error}).", hint="Remove it.", path=path
        ) from error


def _numbers(names: Sequence[str]) -> list[int]:
    """The numbers among the names of files, in order."""
    found = [_LAST_NUMBER.search(Path(name).stem) for name in names]
    return sorted({int(match[1][:18]) for match in found if match})


def _step(names: Sequence[str]) -> int:
    """From each number among the files to the next one; 1 where that differs."""
    numbers = _numbers(names)
    steps = {b - a for a, b in itertools.pairwise(numbers)}
    return steps.pop() if len(steps) == 1 and len(numbers) == len(names) else 1


def _gaps(names: Sequence[str]) -> list[str]:
    """A sentence about numbers that are missing among the files."""
    numbers = _numbers(names)
    if len(numbers) < len(names) or numbers[-1] - numbers[0] == len(numbers) - 1:
        return []
    runs = runs_of(numbers)
    missing = [
        f"{a.stop}" if b.start - a.stop == 1 else f"{a.stop} to {b.start - 1}" for a, b in itertools.pairwise(runs)
    ]
    shown = ", ".join(missing[:_LISTED]) + (f" and {len(missing) - _LISTED} more" if len(missing) > _LISTED else "")
    return [f"Numbers are missing among the files ({shown}); the frames follow each other without a pause."]
