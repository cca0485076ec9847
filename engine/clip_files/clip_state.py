"""ClipState: a clip on disk and between processes: named arrays and a JSON header, nothing else.

One format for the saved clip, the live snapshot and, with the optimiser's arrays added, the checkpoint. Files are
safetensors; they appear under their final name only when complete. Source clips store what they own, not what they
inherit; `reference_fingerprint` ties them to the reference they were trained on.

A file holds its arrays as they are (snapshots, checkpoints) or compactly (finished clips, engine.clip_files.compact):
then each is a run of bytes under its own name, and the metadata say how it is read. Readers of states see no
difference.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from engine.camera.corrections import N_VALUES
from engine.clip_files.anchor_record import AnchorRecord, RecordError, read_records
from engine.clip_files.array_names import CORRECTIONS, LOG_DRIFT, VIGNETTING
from engine.clip_files.clip_header import ClipHeader, NewerSchema, header_text, parse_header
from engine.clip_files.coding import CodedArray, CodingError, decode_array
from engine.clip_files.stored_gaussians import read_stored
from engine.errors import ProjectError
from engine.storage.array_files import ArraysError, read_arrays, read_metadata, write_arrays
from engine.storage.json_files import JsonError, parse_object
from engine.storage.typed_json import EntryError

_MAX_LOG_DRIFT = 3.0
_MAX_VIGNETTING = 100.0
"""Gains of a camera beyond a factor of 20 are damage."""
_ENTRIES = ("header", "coding")
"""Texts of a file apart from its checksum."""


@dataclass(frozen=True, slots=True)
class ClipState:
    """Named arrays and a header. A value.

    Attributes:
        arrays: By name. Those of anchors are described by `anchors`; others are the decoder's, the field's, and the
            gains of the cameras.
        header: Everything else that the file holds, checked.
    """

    arrays: dict[str, np.ndarray]
    header: ClipHeader

    @property
    def anchors(self) -> dict[str, AnchorRecord]:
        """The clip's anchor records, by role. Raises RecordError where arrays do not fit together."""
        return read_records(self.arrays)

    @property
    def drift(self) -> np.ndarray | None:
        """Exposure of the training cameras against the reference clip's; None where none changes. [C, M, 3] float32

        Raises:
            ProjectError: The array does not fit the clip.
        """
        logs = self.arrays.get(LOG_DRIFT)
        if logs is None:
            return None
        shape = (len(self.header.camera_names), self.header.n_frames, 3)
        if logs.shape != shape or logs.dtype != np.float32 or not (np.abs(logs) < _MAX_LOG_DRIFT).all():
            raise ProjectError(
                f"The exposure of the cameras in clip {self.header.clip_index} is {logs.dtype} {list(logs.shape)}, "
                f"not float32 {list(shape)} within {_MAX_LOG_DRIFT}.",
                hint="Train this clip again.",
            )
        return np.exp(logs)

    @property
    def corrections(self) -> np.ndarray | None:
        """Of the training cameras, see engine.camera.corrections; None where they were not refined. [C, 7] float32

        Raises:
            ProjectError: The array does not fit the clip.
        """
        values = self.arrays.get(CORRECTIONS)
        if values is None:
            return None
        shape = (len(self.header.camera_names), N_VALUES)
        if values.shape != shape or values.dtype != np.float32 or not np.isfinite(values).all():
            raise ProjectError(
                f"The corrections of the cameras in clip {self.header.clip_index} are {values.dtype} "
                f"{list(values.shape)}, not float32 {list(shape)} and finite.",
                hint="Train this clip again.",
            )
        return values

    @property
    def vignetting(self) -> np.ndarray | None:
        """Of the training cameras, see engine.images.rendition; None where they have none. [C, 2] float32

        Raises:
            ProjectError: The array does not fit the clip.
        """
        values = self.arrays.get(VIGNETTING)
        if values is None:
            return None
        shape = (len(self.header.camera_names), 2)
        if values.shape != shape or values.dtype != np.float32 or not (np.abs(values) < _MAX_VIGNETTING).all():
            raise ProjectError(
                f"The vignetting of the cameras in clip {self.header.clip_index} is {values.dtype} "
                f"{list(values.shape)}, not float32 {list(shape)} within {_MAX_VIGNETTING}.",
                hint="Train this clip again.",
            )
        return values

    @property
    def is_reference(self) -> bool:
        """Whether other clips can inherit from this one."""
        return self.header.role == "reference"

    @property
    def fingerprint(self) -> str:
        """The fingerprint of the arrays as they are, see `fingerprint_of`."""
        return fingerprint_of(self.arrays)

    def stamped(self) -> ClipState:
        """With the fingerprint of its arrays in its header."""
        return ClipState(self.arrays, replace(self.header, fingerprint=self.fingerprint))


def fingerprint_of(arrays: Mapping[str, np.ndarray]) -> str:
    """Hash of named arrays, 16 hexadecimal digits: names what a source clip was trained against."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name}{array.dtype}{array.shape}".encode())
        digest.update(array.view(np.uint8).reshape(-1).data if array.size else b"")
    return digest.hexdigest()[:16]


def write_clip_state(path: Path | str, state: ClipState, *, is_durable: bool = False) -> None:
    """Write atomically: a complete file appears under `path`, or none.

    Args:
        is_durable: Whether it must outlive a power cut, see engine.storage.files.atomic_path.
    Raises:
        DiskError: The disk refused.
    """
    write_arrays(path, state.arrays, {"header": header_text(state.header)}, what="The clip", is_durable=is_durable)


def write_coded_arrays(
    path: Path | str, coded: dict[str, CodedArray], header: ClipHeader, *, is_durable: bool = False
) -> None:
    """Likewise, with every array in its compact form; `read_clip_state` gives the arrays that these decode to.

    Raises:
        DiskError: The disk refused.
    """
    specs = {name: array.spec for name, array in coded.items()}
    metadata = {"header": header_text(header), "coding": json.dumps(specs, separators=(",", ":"))}
    payloads = {name: array.payload for name, array in coded.items()}
    write_arrays(path, payloads, metadata, what="The clip", is_durable=is_durable)


def read_coded_arrays(path: Path | str) -> dict[str, CodedArray] | None:
    """The stored form of every array of a file that `read_clip_state` can read; None where it holds arrays as they are.

    Raises:
        ProjectError: The file is missing or damaged.
    """
    try:
        payloads, metadata = read_arrays(path, _ENTRIES)
        specs = parse_object(metadata["coding"]) if "coding" in metadata else None
    except _DAMAGE as error:
        raise DamagedClip(Path(path), reason_of(error)).error() from error
    if specs is None:
        return None
    return {name: CodedArray(payloads[name], specs[name], np.zeros(1)) for name in payloads}


def read_clip_state(path: Path | str, *, only: Collection[str] | None = None) -> ClipState:
    """Read a state written by `write_clip_state` or `write_coded_arrays`.

    Args:
        only: Names of the arrays to read, as far as they are there; all of them when None.
    Raises:
        ProjectError: The file is missing, damaged, or of a newer schema; says which, and why.
    """
    path = Path(path)
    try:
        arrays, metadata = read_arrays(path, _ENTRIES, only=only)
        header = _header_of(metadata)
        if "coding" in metadata:
            specs = parse_object(metadata["coding"])
            arrays = _decoded(arrays, specs if only is None else {n: specs[n] for n in only if n in specs})
        if only is None:
            read_records(arrays)
        if only is None and header.holds == "gaussians":
            read_stored(arrays, header.n_frames)
    except FileNotFoundError as error:
        raise ProjectError("The clip file does not exist.", hint="Train the clip first.", path=path) from error
    except NewerSchema as error:
        hint = "Use the version that wrote it or train the clip again."
        raise ProjectError(f"The clip file cannot be read: {error}.", hint=hint, path=path) from error
    except _DAMAGE as error:
        raise DamagedClip(path, reason_of(error)).error() from error
    return ClipState(arrays, header)


def _decoded(payloads: dict[str, np.ndarray], specs: dict[str, Any]) -> dict[str, np.ndarray]:
    """Arrays of a compact file.

    Raises:
        CodingError: An array is damaged, missing or not described; names it.
    """
    if specs.keys() != payloads.keys():
        raise CodingError("its arrays and their description differ")
    arrays = {}
    for name, payload in payloads.items():
        try:
            arrays[name] = decode_array(payload, specs[name])
        except CodingError as error:
            raise CodingError(f"{name}: {error}") from error
    return arrays


@dataclass(frozen=True, slots=True)
class DamagedClip:
    """The stand-in for a header that cannot be read. A value.

    Attributes:
        path: The file.
        reason: The fault, in words that fit into brackets.
    """

    path: Path
    reason: str

    def error(self) -> ProjectError:
        """The error to raise where the clip is needed."""
        return ProjectError(
            f"The clip file is damaged or not a clip file ({self.reason}).",
            hint="Restore it from a backup, or remove it and train the clip again.",
            path=self.path,
        )


def look_at_clip(path: Path) -> ClipHeader | DamagedClip | None:
    """Header of a clip, checkpoint or snapshot; None when there is no such file, the reason when it cannot be read.

    Damage of arrays shows when they are read: `read_clip_state`.
    """
    try:
        return _header_of(read_clip_metadata(path)[0])
    except FileNotFoundError:
        return None
    except _DAMAGE as error:
        return DamagedClip(path, reason_of(error))


def read_clip_header(path: Path) -> ClipHeader | None:
    """Header of a clip, checkpoint or snapshot without its arrays; None when there is none or it is damaged."""
    found = look_at_clip(path)
    return found if isinstance(found, ClipHeader) else None


def reason_of(error: BaseException) -> str:
    """Why a file cannot be used, in words that fit into brackets."""
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)


_DAMAGE = (OSError, ArraysError, JsonError, EntryError, CodingError, RecordError, NewerSchema)


def read_clip_metadata(path: Path) -> tuple[dict[str, str], dict[str, int]]:
    """Texts of a clip file, and the bytes that each of its arrays takes. Raises: see engine.storage.array_files."""
    return read_metadata(path, _ENTRIES)


def _header_of(metadata: Mapping[str, str]) -> ClipHeader:
    """The header among the texts of a file. Raises: see engine.clip_files.clip_header.parse_header."""
    if "header" not in metadata:
        raise EntryError("it has no header")
    return parse_header(metadata["header"])
