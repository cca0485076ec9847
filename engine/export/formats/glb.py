"""A binary glTF with KHR_gaussian_splatting: floats as they are, and points in the same colours for other programs.

In glTF y is up, so the node is turned until what is up in the scene is; the numbers themselves stay as they are.
"""

from __future__ import annotations

import json
import struct
from typing import Any, BinaryIO

import numpy as np

from engine.camera.rotations import quats_of
from engine.errors import ProjectError
from engine.export.formats.damaged import damaged
from engine.export.packing import as_levels
from engine.export.splats import Splats, colors_of
from engine.export.world import rotation_between
from engine.images.srgb import linear_of

EXTENSION = "KHR_gaussian_splatting"
_MAGIC, _VERSION, _JSON, _BIN = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
_FLOAT, _BYTE, _ARRAY_BUFFER, _POINTS = 5126, 5121, 34962, 0
_Y_UP = (0.0, 1.0, 0.0)
_MAX_JSON_BYTES = 1 << 20
_MOST_BYTES = (1 << 32) - _MAX_JSON_BYTES - 64
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


def write(splats: Splats, file: BinaryIO) -> tuple[str, ...]:
    """One node with one mesh of points; an empty scene where there are no Gaussians, as glTF has no empty mesh.

    Raises:
        ProjectError: More than 4 GiB.
    """
    columns = _columns(splats) if len(splats) else {}
    document = _document(splats, columns)
    if sum(column.nbytes for column in columns.values()) > _MOST_BYTES:
        raise ProjectError(
            f"{len(splats):,} Gaussians are more than a .glb holds.", hint="Export a part, or choose another format."
        )
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    data = b"".join(np.ascontiguousarray(column).tobytes() for column in columns.values())
    chunks = struct.pack("<II", len(text), _JSON) + text
    if data:
        chunks += struct.pack("<II", len(data), _BIN)
    file.write(struct.pack("<III", _MAGIC, _VERSION, 12 + len(chunks) + len(data)))
    file.write(chunks)
    file.write(data)
    return ()


def read(file: BinaryIO) -> Splats:
    """Read a file of `write`, as it lies before the node is turned. Raises ProjectError where it is something else."""
    head = file.read(20)
    if len(head) < 20:
        raise damaged("it ends too early")
    magic, version, _, n_json, kind = struct.unpack("<IIIII", head)
    if (magic, version, kind) != (_MAGIC, _VERSION, _JSON) or n_json > _MAX_JSON_BYTES:
        raise damaged("it is not a binary glTF")
    try:
        document = json.loads(file.read(n_json))
        if "meshes" not in document:
            return Splats.from_arrays(*(np.zeros(0) for _ in range(5)))
        file.read(8)
        data = file.read()
        attributes = document["meshes"][0]["primitives"][0]["attributes"]
        means = _column(document, data, attributes["POSITION"])
        xyzw, scales, opacities, f_dc = (
            _column(document, data, attributes[f"{EXTENSION}:{name}"])
            for name in ("ROTATION", "SCALE", "OPACITY", "SH_DEGREE_0_COEF_0")
        )
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise damaged(f"it has no Gaussians ({type(error).__name__})") from error
    return Splats(
        means=means, quats=xyzw[:, [3, 0, 1, 2]], scales=scales, opacities=opacities[:, 0], colors=colors_of(f_dc)
    )


def _columns(splats: Splats) -> dict[str, np.ndarray]:
    """Attributes, each of rows of a multiple of four bytes. [N, ...]"""
    rgba = np.concatenate([np.nan_to_num(linear_of(splats.colors)), splats.opacities[:, None]], axis=1)
    return {
        "POSITION": splats.means.astype("<f4"),
        f"{EXTENSION}:ROTATION": splats.quats[:, [1, 2, 3, 0]].astype("<f4"),
        f"{EXTENSION}:SCALE": splats.scales.astype("<f4"),
        f"{EXTENSION}:OPACITY": splats.opacities.astype("<f4")[:, None],
        f"{EXTENSION}:SH_DEGREE_0_COEF_0": splats.f_dc.astype("<f4"),
        "COLOR_0": as_levels(rgba).astype(np.uint8),
    }


def _document(splats: Splats, columns: dict[str, np.ndarray]) -> dict[str, Any]:
    rotation = quats_of(rotation_between(np.array(splats.up), np.array(_Y_UP)))
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "ClipGStream Studio"},
        "scene": 0,
        "scenes": [{}],
    }
    if not columns:
        return document
    views, accessors, at = [], [], 0
    for name, column in columns.items():
        views.append({"buffer": 0, "byteOffset": at, "byteLength": column.nbytes, "target": _ARRAY_BUFFER})
        at += column.nbytes
        is_byte = column.dtype == np.uint8
        accessor: dict[str, Any] = {
            "bufferView": len(accessors),
            "componentType": _BYTE if is_byte else _FLOAT,
            "count": len(column),
            "type": _KINDS[column.shape[1]],
        }
        if is_byte:
            accessor["normalized"] = True
        if name == "POSITION":
            accessor |= {"min": column.min(0).tolist(), "max": column.max(0).tolist()}
        accessors.append(accessor)
    primitive = {
        "attributes": {name: index for index, name in enumerate(columns)},
        "mode": _POINTS,
        "extensions": {EXTENSION: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}},
    }
    return document | {
        "extensionsUsed": [EXTENSION],
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Gaussians", "rotation": [float(rotation[i]) for i in (1, 2, 3, 0)], "mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "buffers": [{"byteLength": at}],
        "bufferViews": views,
        "accessors": accessors,
    }


def _column(document: dict[str, Any], data: bytes, index: int) -> np.ndarray:
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    width = next(width for width, kind in _KINDS.items() if kind == accessor["type"])
    if accessor["componentType"] != _FLOAT:
        raise ValueError("not floats")
    return np.frombuffer(data, "<f4", accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
