"""Compared projects of made-up figures, without files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from app.lab.report.comparison import Compared
from app.lab.report.paper_figures.pictured import Pictured
from app.project.project_facts import ClipFacts, ProjectFacts
from engine.metrics.clips.seams import PairRow, summarize

HELD_OUT = ("a", "b")


def clip(index: int, start: int, n_frames: int, *, role: str = "source", seconds: float | None = 6.0) -> ClipFacts:
    return ClipFacts(
        index, start, n_frames, "reference" if index == 0 else role, 10, f"f{index}", {"anchors": 1_000_000}, {},
        None if seconds is None else 0.0, seconds,
    )  # fmt: skip


def compared(
    name: str,
    clips: Sequence[ClipFacts],
    *,
    psnr: Mapping[tuple[str, int], float] | None = None,
    excess: Mapping[tuple[str, int], float | None] | None = None,
    cameras: Sequence[str] = (*HELD_OUT, "c"),
    settings: Any = None,
) -> Compared:
    """A project whose pictures have 20 dB and whose pairs an excess of 0.01 where nothing else is said."""
    rows, pairs = [], []
    for camera in cameras:
        is_held_out = camera in HELD_OUT
        for one in clips:
            for frame in range(one.start, one.start + one.n_frames):
                value = (psnr or {}).get((camera, frame), 20.0)
                rows.append(
                    {"camera": camera, "frame_index": frame, "clip_index": one.clip_index, "is_held_out": is_held_out}
                    | {"psnr": value, "moving_share": (frame % 4) / 10}
                )
                if frame == 0:
                    continue
                value = (excess or {}).get((camera, frame), 0.01)
                is_border = frame == one.start
                pairs.append(
                    PairRow(
                        frame, one.clip_index, camera, is_held_out, is_border, 0.02, 0.05, 0.01, 0.05, value, 0.0, 0.9
                    )
                )
    seams = {"rows": [pair.as_dict() for pair in pairs], **summarize(pairs)}
    means = {"held_out": {"psnr": 20.0}, "trained_on": {}}
    project = cast("Any", type("P", (), {"settings": settings})())
    return Compared(ProjectFacts(name, project, list(clips)), {"rows": rows, "seams": seams, "means": means})


def pictured(*projects: Compared) -> list[Pictured]:
    return [Pictured(one, cast("Any", None)) for one in projects]
