"""The readers of captures in the order they are tried, and why none of them knows a folder."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from engine.capture.files.folder_contents import MAX_LOOKED_AT, folder_contents
from engine.capture.files.foreign_calibrations import foreign_calibrations
from engine.capture.formats import (
    capture_json,
    colmap,
    colmap_frames,
    easyvolcap,
    immersive,
    imported,
    metashape,
    multipleview,
    n3dv,
    panoptic,
    panoptic_studio,
    qualisys,
    realitycapture,
    sample,
    technicolor,
    toml_cameras,
    transforms_json,
    vicon,
)
from engine.capture.layout.format_result import Layout, Probe
from engine.capture.pixels.user_masks import with_masks
from engine.errors import CaptureError

FORMATS = (
    capture_json,
    sample,
    imported,
    panoptic,
    panoptic_studio,
    easyvolcap,
    toml_cameras,
    immersive,
    technicolor,
    transforms_json,
    multipleview,
    n3dv,
    colmap_frames,
    colmap,
    qualisys,
    vicon,
    metashape,
    realitycapture,
)
"""Readers in the order they are tried. Each has FORMAT, LAYOUT, probe(folder) and read(folder, follow_links=...)."""


def read_layout(folder: Path, *, follow_links: bool) -> Layout:
    """The result of the first reader that knows the folder's layout.

    Raises:
        CaptureError: No reader knows it, or the one that does finds problems.
    """
    if not folder.exists():
        raise CaptureError("There is no such folder.", hint="Check the path.", path=folder)
    if not folder.is_dir():
        raise CaptureError(
            "This is a file; a capture is a folder.", hint=f"Open {folder.absolute().parent} instead.", path=folder
        )
    probes = [(reader, reader.probe(folder)) for reader in FORMATS]
    for reader, probe in probes:
        if probe.is_match:
            layout = reader.read(folder, follow_links=follow_links)
            if layout.is_growing:
                return layout  # masks are made of what is complete
            return with_masks(layout, folder, follow_links=follow_links)
    raise _not_a_capture(folder, [probe for _, probe in probes])


def is_capture(folder: Path) -> bool:
    """Whether some reader knows the layout of a folder. Raises OSError where it cannot be looked into."""
    return any(reader.probe(folder).is_match for reader in FORMATS)


def _not_a_capture(folder: Path, probes: Sequence[Probe]) -> CaptureError:
    """The error with the folder's contents, the layouts that can be read, and the remedy."""
    with os.scandir(folder) as entries:
        inside = sorted(entry.name for entry in islice(entries, MAX_LOOKED_AT) if _is_capture(entry))
    close = [probe for probe in probes if probe.seen]
    calibrations = [] if inside else foreign_calibrations(folder)
    if close or calibrations:
        seen = [f"there is {probe.seen}, but {probe.lacks}" for probe in close]
        found = "; ".join(seen + [text for text, _ in calibrations])
        hints = [probe.hint for probe in close] + [f"{what[0].upper()}{what[1:]}." for _, what in calibrations]
        hint = " Or: ".join(dict.fromkeys(hint for hint in hints if hint))
    else:
        found, hint = "no known layout was recognised", ""
    if inside:
        hint = f"Open {inside[0]} inside it, which is a capture."
    elif not hint:
        hint = (
            "docs/capture_formats.md lists the layouts that are read. Videos of cameras without calibration: "
            "clipgstream calibrate FOLDER. Anything else: write capture.json."
        )
    return CaptureError(
        f"This folder is not a capture ({found}). In it: {folder_contents(folder)}.", hint=hint, path=folder
    )


def _is_capture(entry: os.DirEntry[str]) -> bool:
    try:
        return entry.is_dir() and is_capture(Path(entry.path))
    except OSError:  # a link to itself, a folder that may not be looked into
        return False
