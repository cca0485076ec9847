"""How long may a capture be? The same generated capture by several ways to train it, figures over its length.

    python -m tests.benchmarks.bench_length out/length
    python -m tests.benchmarks.bench_length out/length --frames 30 --lengths 10,30 --set passes=1

The ways are variants of `clipgstream ablate`, trained and measured by the same code: clips of ten frames as the program
does, clips that share nothing, frame after frame, and one clip with one field for all frames, which gets as many steps
as all clips together. Whoever goes on from clip to clip is trained once, and its figures for N frames are those of its
first N. One field for N frames is a training of its own for every length. Backgrounds may come from frames after the
first N, as they do in a project.

Writes length.md (a table), length.json and length.png (curves over N) beside the captures and projects in the folder;
the same command goes on from what lies there. PSNR is the mean over held-out cameras and frames; flicker is the change
of the render from frame to frame on pixels that stand still, at borders of ten frames for every way, and the noise of
the capture on the same pixels is in the last column. Minutes are those of preparation and training and say something
only on a quiet machine. Memory is the most that a training process held.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.document.project_settings import ProjectSettings
from app.evaluation.evaluation import evaluate_project
from app.evaluation.headless import open_trained
from app.lab.ablation.running import Callbacks, project_folder, run_ablation
from app.lab.ablation.variants import FULL, Variant, chosen_variants
from app.lab.flicker import flicker_figures
from app.lab.report.charts import ChartLine, CurvePanel, draw_over_time
from app.project.opening.project_access import default_settings, open_project
from app.project.project_facts import read_facts
from app.training.process import ProcessWorker
from engine.capture.capture import Capture, open_capture
from engine.errors import EngineError
from engine.metrics.clips.summary import mean_of
from engine.storage.json_files import json_text
from engine.training.config import parse_overrides
from engine.training.presets import preset
from tests.benchmarks.bench_long_captures import write_missing
from tests.benchmarks.options import ending_on_bad_input, names
from tests.long_captures.scene import make_long_scene

METHODS = {
    "full": "clips of ten frames",
    "field-joint": "one field for all frames",
    "independent": "clips that share nothing",
    "frame-stream": "frame after frame",
}
"""Variant of the ablation to what it is called here."""
COLUMNS: dict[str, tuple[str, int]] = {
    "psnr": ("PSNR", 2),
    "psnr_moving": ("moving", 2),
    "psnr_rest": ("still", 2),
    "flicker_inside": ("flicker, 1/255", 3),
    "flicker_borders": ("at borders", 3),
    "minutes": ("minutes", 1),
    "memory_mb": ("memory MB", 0),
    "megabytes": ("MB on disk", 2),
    "noise": ("noise, 1/255", 2),
}
"""Figure to its heading and decimals."""
PANELS = ("psnr", "psnr_moving", "flicker_inside", "minutes", "memory_mb", "megabytes")
SETTINGS = ("gaussians_per_anchor=8", "passes=2")
"""On top of the preset toy."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What is known of one training.

    Attributes:
        rows: One per held-out camera and frame, EvalRow.as_dict.
        pairs: One per held-out camera and two neighbouring frames, PairRow.as_dict.
        clips: Last frame + 1, seconds, memory in MB and bytes of each clip.
    """

    rows: Sequence[dict[str, Any]]
    pairs: Sequence[dict[str, Any]]
    clips: Sequence[tuple[int, float | None, float | None, int]]

    def figures(self, n_frames: int, borders: Sequence[int]) -> dict[str, float | None]:
        """Of the first n_frames; see COLUMNS."""
        rows = [row for row in self.rows if row["frame_index"] < n_frames]
        pairs = [pair for pair in self.pairs if pair["frame_index"] < n_frames]
        clips = [clip for clip in self.clips if clip[0] <= n_frames]
        flicker = flicker_figures(pairs, borders)
        seconds = [clip[1] for clip in clips if clip[1] is not None]
        noise = mean_of([pair["truth_change_static"] for pair in pairs])
        return {
            **{name: mean_of([row[name] for row in rows]) for name in ("psnr", "psnr_moving", "psnr_rest")},
            **{name: flicker[name] for name in ("flicker_inside", "flicker_borders")},
            "minutes": sum(seconds) / 60 if len(seconds) == len(clips) else None,
            "memory_mb": max((clip[2] for clip in clips if clip[2] is not None), default=None),
            "megabytes": sum(clip[3] for clip in clips) / 1e6,
            "noise": None if noise is None else 255.0 * noise,
        }


def measure(place: Path) -> Measured:
    """Figures of a trained project, which were measured before by the ablation and are read here."""
    opened = open_trained(open_project(place, is_writable=False))
    document = evaluate_project(
        opened,
        clip_indices=opened.trained,
        cameras=opened.capture.camera_indices(opened.project.settings.holdout),
        metrics="quick",
        on_progress=lambda n_done, n_rows, row: None,
    )
    facts = {clip.clip_index: clip for clip in read_facts(place, place.name).clips}
    clips = []
    for index in opened.trained:
        memory_mb = opened.header(index).figures.memory_mb
        n_bytes = opened.project.clip_path(index).stat().st_size
        clips.append((opened.clips[index].stop, facts[index].wall_s, memory_mb, n_bytes))
    return Measured(document["rows"], document["seams"]["rows"], clips)


def train(folder: Path, capture: Capture, settings: ProjectSettings, variant: Variant, n_clips: int) -> Path:
    """The project of a variant over the first clips, trained and measured as `clipgstream ablate` does; first that of
    "full" where it takes over its reference clip.

    Raises:
        EngineError: It cannot be trained at this length.
    """
    print(f"{variant.name}, {n_clips * settings.clip_length} frames", file=sys.stderr)
    run_ablation(
        folder,
        capture,
        settings,
        variants=chosen_variants([variant.name]) if variant.family == FULL else [variant],
        n_clips=n_clips,
        seeds=[settings.seed],
        metrics="quick",
        launch=ProcessWorker,
        callbacks=Callbacks(
            on_variant=lambda *_: None,
            on_status=lambda _: None,
            on_event=lambda _: None,
            on_outcome=lambda outcome: print(
                f"  clip {outcome.clip_index}: {outcome.state}, {outcome.step} steps, {outcome.seconds:.0f} s",
                file=sys.stderr,
            ),
            on_row=lambda *_: None,
        ),
    )
    return project_folder(folder, variant.name, settings.seed)


def lines_of(
    method: Variant, lengths: Sequence[int], clip_length: int, trained: Callable[[int], Path]
) -> list[dict[str, Any]]:
    """Figures of one way at every number of frames that it was trained for, and between them where clips end.

    Args:
        lengths: Numbers of frames, rising; multiples of the clip length.
        trained: The project that covers so many frames; raises EngineError where that fails.
    Returns:
        Per number of frames: method, n_frames, is_own (trained for this length), figures, or `failure` in words.
    """
    borders = range(clip_length, lengths[-1], clip_length)
    is_whole = method.cut == "whole"
    lines: list[dict[str, Any]] = []
    for length in lengths if is_whole else lengths[-1:]:
        ends = [length] if is_whole else range(clip_length, length + 1, clip_length)
        try:
            measured = measure(trained(length))
        except EngineError as error:
            print(error, file=sys.stderr)
            lines.append({"method": method.name, "n_frames": length, "is_own": True, "failure": str(error)})
            continue
        own = [(end, is_whole or end == length) for end in ends]
        lines += [
            {"method": method.name, "n_frames": end, "is_own": is_own, **measured.figures(end, borders)}
            for end, is_own in own
        ]
    return lines


def table_text(lines: Sequence[dict[str, Any]], lengths: Sequence[int]) -> str:
    """The lines of the chosen lengths as a Markdown table."""
    headings = ["frames", "way", "trained for", *(heading for heading, _ in COLUMNS.values())]
    rows = [headings, ["---"] * len(headings)]
    for length in lengths:
        for line in lines:
            if line["n_frames"] == length:
                longest = max(other["n_frames"] for other in lines if other["method"] == line["method"])
                trained_for = length if line["is_own"] else longest
                cells = [str(length), METHODS[line["method"]], f"{trained_for} frames"]
                cells += [_cell(line.get(name), digits) for name, (_, digits) in COLUMNS.items()]
                rows.append(cells)
    failures = [
        f"{METHODS[line['method']]}, {line['n_frames']} frames: {line['failure']}"
        for line in lines
        if "failure" in line
    ]
    return "\n".join(["| " + " | ".join(row) + " |" for row in rows] + (["", *failures] if failures else []))


def _cell(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def chart(lines: Sequence[dict[str, Any]]) -> bytes:
    """Curves over the number of frames as a PNG."""
    ends = sorted({line["n_frames"] for line in lines})
    panels = []
    for name in PANELS:
        curves = []
        for method, words in METHODS.items():
            found = {line["n_frames"]: line.get(name) for line in lines if line["method"] == method}
            if found:
                curves.append(ChartLine(words, [found.get(end) for end in ends], is_main=method == "full"))
        panels.append(CurvePanel(COLUMNS[name][0], curves))
    return draw_over_time(panels, ends, (), "frames from the first")


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of the capture and the projects; what lies there is taken up")
    parser.add_argument("--methods", default=",".join(METHODS), help="variants, separated by commas")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--lengths", default="30,100,300", help="numbers of frames of the table and of single fields")
    parser.add_argument("--stream-frames", type=int, default=100, help="how far frame after frame goes at most")
    parser.add_argument("--independent-frames", type=int, default=100, help="how far clips that share nothing go")
    parser.add_argument("--clip-length", type=int, default=10)
    parser.add_argument("--set", nargs="*", default=[], help="key=value settings, beside those here")
    options = parser.parse_args()
    chosen = names(options.methods, list(METHODS), parser)
    lengths = sorted({int(part) for part in options.lengths.split(",")})
    if any(length % options.clip_length or not 0 < length <= options.frames for length in lengths):
        parser.error(f"lengths are multiples of {options.clip_length} and at most {options.frames}")
    scene = make_long_scene(n_frames=options.frames, clip_length=options.clip_length)
    write_missing(options.out / "captures", scene, ["none"])
    lines: list[dict[str, Any]] = []
    with ending_on_bad_input():
        capture = open_capture(options.out / "captures" / "none")
        overrides = preset("toy") | parse_overrides([*SETTINGS, *options.set])
        settings = default_settings(capture, clip_length=options.clip_length, overrides=overrides)
        for name in chosen:
            method = next(variant for variant in chosen_variants([name]) if variant.name == name)
            limit = {"frame-stream": options.stream_frames, "independent": options.independent_frames}.get(name)
            own = [length for length in lengths if limit is None or length <= limit] or lengths[:1]

            def trained(length: int, method: Variant = method) -> Path:
                folder = options.out / "projects" / (f"{length}" if method.cut == "whole" else "clips")
                return train(folder, capture, settings, method, length // options.clip_length)

            lines += lines_of(method, own, options.clip_length, trained)
            (options.out / "length.json").write_text(json_text(lines, indent=1) + "\n")
            (options.out / "length.md").write_text(table_text(lines, lengths) + "\n")
            (options.out / "length.png").write_bytes(chart(lines))
    print(table_text(lines, lengths))


if __name__ == "__main__":
    main()
