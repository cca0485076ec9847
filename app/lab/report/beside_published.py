"""The section that compares a project with figures that others published of the same data by the same protocol."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from app.lab.published import CAVEATS, N_FRAMES, Published, is_protocol, published_of, sequence_of
from app.lab.report.comparison import Compared
from app.lab.report.page.parts import Section
from app.lab.report.page.tables import Table, TableColumn

_COLUMNS = (
    TableColumn("method", "Method"),
    TableColumn("sequence", "Sequence"),
    TableColumn("n_frames", "Frames"),
    TableColumn("psnr", "PSNR, raw", 2, unit="dB"),
    TableColumn("ssim", "SSIM"),
    TableColumn("lpips", "LPIPS"),
    TableColumn("source", "Source"),
    TableColumn("caveat", "Note"),
)


def published_section(compared: Sequence[Compared], capture: Mapping[str, Any]) -> Section | None:
    """A table of published figures with the page's projects above them; None for other data or another protocol.

    Args:
        compared: The page's own project first.
        capture: Of the first, see engine.capture.capture_summary.describe.
    """
    first = compared[0].facts.settings
    sizes = {(camera["working_width"], camera["working_height"]) for camera in capture["cameras"]}
    if not is_protocol(capture["format"], first.holdout, sizes):
        return None
    sequence = sequence_of(Path(capture["path"]))
    alike = [one for one in compared if is_alike(one, compared[0])]
    rows = [*(_own(one, sequence) for one in alike), *(_printed(one) for one in published_of(sequence))]
    said = [CAVEATS]
    if sequence is None:
        said.append(
            "The name of the capture's folder says none of the sequences, so all of them are listed: compare with the "
            "one that was filmed."
        )
    return Section("published", "Next to published figures", [*said, Table("published", "Held out", _COLUMNS, rows)])


def is_alike(one: Compared, first: Compared) -> bool:
    """Whether figures of two projects are of the same capture, scale and held-out cameras."""
    own, other = one.facts.settings, first.facts.settings
    same_capture = own.fingerprint == other.fingerprint and own.scale == other.scale
    return same_capture and set(own.holdout) == set(other.holdout)


def _own(one: Compared, sequence: str | None) -> dict[str, Any]:
    n_frames = sum(clip.n_frames for clip in one.facts.clips)
    note = "" if n_frames == N_FRAMES else f"{n_frames} frames, not {N_FRAMES}: no claim to the published figure"
    return {
        "method": f"This project: {one.facts.name}",
        "sequence": sequence,
        "n_frames": n_frames,
        **{name: one.figure(name) for name in ("psnr", "ssim", "lpips")},
        "source": "measured here",
        "caveat": note,
    }


def _printed(one: Published) -> dict[str, Any]:
    figures = {"psnr": one.psnr, "ssim": one.ssim, "lpips": one.lpips}
    named = {"method": one.method, "sequence": one.sequence, "n_frames": one.n_frames}
    return named | figures | {"source": one.source, "caveat": one.caveat}
