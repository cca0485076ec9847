"""The section on quality over the clips: how much a clip loses against its reference clip, and why.

Colour is the part that the colour fit recovers, light the part that a fit of smooth local brightness recovers beyond
that; the rest is shape and texture, and grows with the distance in time. The section also shows the exposure of the
cameras, which is measured and removed before training.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.evaluation.headless import TrainedProject
from app.lab.report.charts import ChartLine, CurvePanel, draw_over_time
from app.lab.report.comparison import main_group
from app.lab.report.measured import GROUP_WORDS
from app.lab.report.page.parts import Figure, Section
from app.lab.report.page.tables import Table, TableColumn
from engine.clip_files.kept_drift import mean_change, read_drift

N_NAMED = 6
"""Cameras with a colour of their own in the chart of exposures: those that change most."""
_LINES = {"psnr": "raw colours", "psnr_fit": "after the colour fit", "psnr_light": "after the fit of colour and light"}


@dataclass(frozen=True, slots=True)
class ClipExposure:
    """The exposure that a clip file states next to its model.

    Attributes:
        reference_index: The clip it inherits from; its own index where it inherits nothing, or that is not there.
        frames: Capture frame indices.
        camera_names: Training cameras.
        drift: Their exposure against the reference clip; None where none changes. [C, M, 3]
    """

    reference_index: int
    frames: Sequence[int]
    camera_names: Sequence[str]
    drift: np.ndarray | None


def exposures_of(opened: TrainedProject, clip_indices: Sequence[int]) -> dict[int, ClipExposure]:
    """Exposures of trained clips, by index.

    Raises:
        ProjectError: A clip is damaged.
    """
    headers = {index: opened.header(index) for index in clip_indices}
    index_of = {header.fingerprint: index for index, header in headers.items()}
    return {
        index: ClipExposure(
            index_of.get(header.reference_fingerprint or "", index),
            range(header.start, header.start + header.n_frames),
            header.camera_names,
            read_drift(opened.project.clip_path(index)),
        )
        for index, header in headers.items()
    }


def over_clips_section(evaluation: dict[str, Any], exposures: Mapping[int, ClipExposure]) -> Section:
    """PSNR of every clip by three measures, its losses by cause, and the exposure of the cameras."""
    group = main_group(evaluation)
    means = {int(index): found[group] for index, found in evaluation["means"]["clips"].items()}
    rows = [_row(index, means, exposures[index]) for index in means]
    said = (
        f"Means over the {GROUP_WORDS[group].replace(' ', '-')} cameras. Losses are against the clip that a clip "
        "inherits from: colour is the part that a gain and an offset per channel recover, light the part that a smooth "
        "local factor recovers beyond that, and the rest is due to changes since. A negative loss is a gain. Exposure "
        "is how far the training cameras are from their exposure in the reference clip, on average; it was removed "
        "from the pictures that the clip was trained on."
    )
    chart = Figure(
        "psnr_over_clips",
        draw_over_time([_psnr_panel(means)], list(means), (), "clip"),
        "PSNR of each clip. Where the lines drift apart, colour or light has changed; where all fall, the rest.",
        f"Three curves of PSNR over clips {min(means)} to {max(means)}: " + ", ".join(_LINES.values()),
    )
    columns = (
        TableColumn("clip_index", "Clip"),
        TableColumn("n_away", "Clips from its reference"),
        TableColumn("exposure_percent", "Exposure", 2, unit="%"),
        *(TableColumn(name, f"PSNR, {words}", 2, unit="dB") for name, words in _LINES.items()),
        TableColumn("lost_color", "Lost by colour", 2, unit="dB"),
        TableColumn("lost_light", "Lost by light", 2, unit="dB"),
        TableColumn("lost_rest", "Lost by the rest", 2, unit="dB"),
    )
    table = Table("over_clips", "Loss of each clip against the clip it inherits from", columns, rows)
    return Section("over_clips", "Quality over clips", [said, chart, table, *_exposure_parts(exposures)])


def _psnr_panel(means: Mapping[int, Mapping[str, Any]]) -> CurvePanel:
    curves = [
        ChartLine(words, [found.get(name) for found in means.values()], is_main=name == "psnr")
        for name, words in _LINES.items()
    ]
    return CurvePanel("PSNR, dB", curves)


def _row(index: int, means: Mapping[int, Mapping[str, Any]], exposure: ClipExposure) -> dict[str, Any]:
    own, reference = means[index], means.get(exposure.reference_index)
    lost: dict[str, float | None] = dict.fromkeys(_LINES)
    if reference is not None and exposure.reference_index != index:
        lost = {
            name: None if own.get(name) is None or reference.get(name) is None else reference[name] - own[name]
            for name in _LINES
        }
    return {
        "clip_index": index,
        "n_away": abs(index - exposure.reference_index),
        "exposure_percent": 100.0 * mean_change(exposure.drift),
        **{name: own.get(name) for name in _LINES},
        "lost_color": _difference(lost["psnr"], lost["psnr_fit"]),
        "lost_light": _difference(lost["psnr_fit"], lost["psnr_light"]),
        "lost_rest": lost["psnr_light"],
    }


def _difference(before: float | None, after: float | None) -> float | None:
    return None if before is None or after is None else before - after


def _exposure_parts(exposures: Mapping[int, ClipExposure]) -> list[Any]:
    """The chart of all cameras over the frames, and its numbers in a file."""
    known = [exposures[index] for index in sorted(exposures)]
    if all(one.drift is None for one in known):
        return ["The clip files hold no change of any camera's exposure."]
    names = list(dict.fromkeys(name for one in known for name in one.camera_names))
    frames = [frame for one in known for frame in one.frames]
    percents = np.full((len(names), len(frames)), np.nan)
    at = 0
    for one in known:
        drift = one.drift
        rows = [names.index(name) for name in one.camera_names]
        span = slice(at, at + len(one.frames))
        percents[rows, span] = 0.0 if drift is None else 100.0 * np.expm1(np.log(drift).mean(2))
        at = span.stop
    largest = np.nanmax(np.abs(percents), axis=1)
    named = sorted(np.argsort(-largest, kind="stable")[:N_NAMED].tolist())
    others = [row for row in range(len(names)) if row not in named]
    curves = [
        ChartLine("other cameras" if i == 0 else "", _plain(percents[row]), is_faint=True)
        for i, row in enumerate(others)
    ]
    curves += [ChartLine(f"camera {names[row]}", _plain(percents[row])) for row in named]
    curves.append(ChartLine("median", _plain(np.nanmedian(percents, axis=0)), is_main=True))
    borders = [one.frames[0] for one in known[1:]]
    chart = Figure(
        "exposure",
        draw_over_time([CurvePanel("exposure, %", curves)], frames, borders, "frame"),
        "Exposure of each training camera against the reference clip, mean of the channels: measured before training "
        "and removed from the pictures.",
        f"Curves of the exposure of {len(names)} cameras over frames {frames[0]} to {frames[-1]}; the largest change "
        f"is {largest.max():.1f} percent.",
    )
    columns = [TableColumn("frame_index", "Frame"), *(TableColumn(f"camera_{name}", name, unit="%") for name in names)]
    table = Table(
        "exposure",
        "Exposure of each training camera, percent",
        columns,
        [
            {"frame_index": frame}
            | {f"camera_{name}": value for name, value in zip(names, _plain(percents[:, i]), strict=True)}
            for i, frame in enumerate(frames)
        ],
        is_shown=False,
    )
    return [chart, table]


def _plain(values: np.ndarray) -> list[float | None]:
    return [None if np.isnan(value) else float(value) for value in values]
