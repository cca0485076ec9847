"""What `clipgstream inspect` says of a capture before it looks at pixels."""

from __future__ import annotations

from typing import Any

from engine.capture.capture import FORMATS
from engine.text import printable

LAYOUTS = {reader.FORMAT: reader.LAYOUT for reader in FORMATS}


def capture_lines(found: dict[str, Any]) -> list[str]:
    """Layout, frames, cameras with their lenses, and what is odd. found: See `engine.capture.capture_summary`."""
    lines = [
        f"{printable(found['path'])}: {found['n_cameras']} cameras, {found['n_frames']} frames at {found['fps']:g} per "
        f"second ({found['duration_s']:.1f} s); {LAYOUTS[found['format']]}"
    ]
    for camera in found["cameras"]:
        held_out = "  suggested as hold-out" if camera["is_default_holdout"] else ""
        lens = "" if camera["lens"] == "pinhole" else f"  {camera['lens']} lens"
        lines.append(
            f"  {printable(camera['name']):>8}  {camera['width']}x{camera['height']}  view {camera['fov_x_deg']:.0f} x "
            f"{camera['fov_y_deg']:.0f} degrees{lens}{held_out}"
        )
    lines.append(f"The cameras are up to {found['rig_extent']:.3g} scene units apart. {_missing(found)}")
    return [*lines, *(printable(f"Note: {warning}") for warning in found["warnings"])]


def _missing(found: dict[str, Any]) -> str:
    n_masked = sum(camera["has_masks"] for camera in found["cameras"])
    there = [f"masks for {n_masked} cameras"] if n_masked else []
    there += ["a point cloud"] if found["has_points"] else []
    absent = ([] if n_masked else ["masks"]) + ([] if found["has_points"] else ["point cloud"])
    came = f"Poses and lenses are there{''.join(f', {what}' for what in there)}"
    return f"{came}; no {' and no '.join(absent)}, which are not needed." if absent else f"{came}."
