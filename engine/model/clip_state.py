"""ClipState: a clip on disk and between processes: named arrays and a JSON header, nothing else.

One format for the saved clip, the live snapshot and, with the optimiser's arrays added, the checkpoint. Files are
safetensors; they appear under their final name only when complete. Source clips store what they own, not what they
inherit; `reference_fingerprint` ties them to the reference they were trained on.

A file holds its arrays as they are (snapshots, checkpoints) or compactly (finished clips, engine.model.compact): then
each is a run of bytes under its own name, and the metadata say how it is read. Readers of states see no difference.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError, safe_open

from engine.errors import ProjectError
from engine.files import write_arrays
from engine.model.coding import CodedArray, CodingError, decode_array

SCHEMA = 2
_READABLE = (1, SCHEMA)
"""Schema 1 knew no compact form; its files are read like any other that holds its arrays as they are."""


@dataclass(frozen=True, slots=True)
class ClipState:
    """Named arrays and a header. A value.

    Header keys: schema, role ("reference" or "source"), clip_index, clip_length, n_frames, start, step, n_steps,
    seed, config (difference from defaults), camera_names (of the gains), near_plane, spacing, moving_spacing,
    n_anchors (per set), n_alive (most moving anchors in one frame), fingerprint, reference_fingerprint,
    field (FieldShape or None); a kept clip adds metrics.
    """

    arrays: dict[str, np.ndarray]
    header: dict[str, Any]

    @property
    def is_reference(self) -> bool:
        """Whether other clips can inherit from this one."""
        return self.header["role"] == "reference"

    @property
    def fingerprint(self) -> str:
        """Hash of the arrays, 16 hexadecimal digits: names what a source clip was trained against."""
        digest = hashlib.sha256()
        for name in sorted(self.arrays):
            array = np.ascontiguousarray(self.arrays[name])
            digest.update(f"{name}{array.dtype}{array.shape}".encode())
            digest.update(array.view(np.uint8).reshape(-1).data if array.size else b"")
        return digest.hexdigest()[:16]


def write_clip_state(path: Path | str, state: ClipState) -> None:
    """Write atomically: a complete file appears under `path`, or none.

    Raises:
        DiskError: The disk refused.
    """
    write_arrays(path, state.arrays, {"header": json.dumps(state.header)}, what="The clip")


def write_coded_arrays(path: Path | str, coded: dict[str, CodedArray], header: dict[str, Any]) -> None:
    """Likewise, with every array in its compact form; `read_clip_state` gives the arrays that these decode to.

    Raises:
        DiskError: The disk refused.
    """
    specs = {name: array.spec for name, array in coded.items()}
    metadata = {"header": json.dumps(header), "coding": json.dumps(specs, separators=(",", ":"))}
    write_arrays(path, {name: array.payload for name, array in coded.items()}, metadata, what="The clip")


def read_clip_state(path: Path | str) -> ClipState:
    """Read a state written by `write_clip_state` or `write_coded_arrays`.

    Raises:
        ProjectError: The file is missing, damaged, or of a newer schema.
    """
    path = Path(path)
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata() or {}
            header = json.loads(metadata["header"])
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
        if "coding" in metadata:
            arrays = _decoded(arrays, json.loads(metadata["coding"]))
    except FileNotFoundError as error:
        raise ProjectError("The clip file does not exist.", hint="Train the clip first.", path=path) from error
    except (OSError, SafetensorError, KeyError, ValueError) as error:
        raise ProjectError(
            f"The clip file is damaged or no clip file ({error}).",
            hint="Train the clip again.",
            path=path,
        ) from error
    if header.get("schema") not in _READABLE:
        raise ProjectError(
            f"The clip file has schema {header.get('schema')}, this version reads 1 to {SCHEMA}.",
            hint="Use the version that wrote it or train the clip again.",
            path=path,
        )
    return ClipState(arrays, header)


def _decoded(payloads: dict[str, np.ndarray], specs: dict[str, Any]) -> dict[str, np.ndarray]:
    """Arrays of a compact file.

    Raises:
        CodingError: An array is damaged, missing or not described; names it.
    """
    if not isinstance(specs, dict) or specs.keys() != payloads.keys():
        raise CodingError("its arrays and their description differ")
    arrays = {}
    for name, payload in payloads.items():
        try:
            arrays[name] = decode_array(payload, specs[name])
        except CodingError as error:
            raise CodingError(f"{name}: {error}") from error
    return arrays


def read_clip_header(path: Path) -> dict[str, Any] | None:
    """Header of a clip, checkpoint or snapshot without its arrays; None when there is none or it is damaged."""
    try:
        with safe_open(path, framework="numpy") as file:
            header = json.loads((file.metadata() or {})["header"])
    except (OSError, SafetensorError, KeyError, ValueError):
        return None
    return header if isinstance(header, dict) else None
