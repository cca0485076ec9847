"""The section on static and dynamic features: each alone, next to the full render and the capture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from app.lab.report.paper_figures.drawing import draw_picture_rows
from app.lab.report.paper_figures.pictured import Pictured, of_main_group
from engine.images.psnr import psnr

if TYPE_CHECKING:
    from engine.metrics.clips.features_apart import Features

_TITLE = "Static and dynamic features"
_WAYS: dict[Features, str] = {"both": "full render", "static": "f_s only", "dynamic": "f_d only"}


def features_section(own: Pictured) -> Section:
    """Pictures of the page's own project: one of the reference clip and one of the last clip that inherits."""
    rows: list[tuple[str, list]] = []
    table: list[dict[str, Any]] = []
    for row in chosen_pictures(own):
        camera, frame, clip = row["camera"], row["frame_index"], row["clip_index"]
        pairs = {way: own.pictures.pair(clip, frame, camera, way) for way in _WAYS}
        truth = pairs["both"][0]
        levels = {way: psnr(render, truth / 255.0) for way, (_, render) in pairs.items()}
        shown = [(truth, f"camera {camera}, frame {frame}")]
        shown += [(render, f"{levels[way]:.2f} dB") for way, (_, render) in pairs.items()]
        rows.append((f"clip {clip}", shown))
        table.append({"clip_index": clip, "camera": camera, "frame_index": frame, **levels})
    if not rows:
        return Section("features_apart", _TITLE, ["No picture was measured, so none is shown."])
    caption = (
        "f_s only: the field's features are zero; f_d only: those of the anchors are. Positions, colours of the cloud, "
        "sizes, presence and decoder stay. Above the reference clip, below the last clip that inherits from it, each "
        "in the frame and the camera with most moving pixels among the cameras that are measured."
    )
    names = ", ".join(("truth", *_WAYS.values()))
    figure = Figure(
        "features_apart",
        draw_picture_rows(["truth", *_WAYS.values()], rows),
        caption,
        f"Rows of four pictures: {names}. {caption}",
    )
    columns = (
        TableColumn("clip_index", "Clip"),
        TableColumn("camera", "Camera"),
        TableColumn("frame_index", "Frame"),
        *(TableColumn(way, f"PSNR, {words}", 2, unit="dB") for way, words in _WAYS.items()),
    )
    return Section(
        "features_apart",
        _TITLE,
        [figure, Table("features_apart", "PSNR of the pictures above", columns, table)],
    )


def chosen_pictures(own: Pictured) -> Sequence[dict[str, Any]]:
    """Rows of the evaluation: of the reference clip, and of the last clip that inherits where there is one."""
    clips = own.compared.facts.clips
    reference = next((clip for clip in clips if clip.role == "reference"), clips[0])
    later = [clip for clip in clips if clip.role == "source"][-1:]
    rows = of_main_group(own.compared, own.compared.evaluation["rows"])
    found = []
    for clip in dict.fromkeys(one.clip_index for one in (reference, *later)):
        of_clip = [row for row in rows if row["clip_index"] == clip]
        if of_clip:
            found.append(max(of_clip, key=lambda row: row["moving_share"] or 0.0))
    return found
