"""Frames per second of a trained project, kept in it: measured once per machine and version of its clips.

The file lies next to those of figures (PROJECT/evaluations/frame_rates.json), separate from them: figures are the same
in every run, times are not.
"""

from __future__ import annotations

import importlib.metadata
import logging
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.evaluation.kept_figures import EVALUATIONS
from app.evaluation.speed.laps import Lap, RenderRate, camera_of, enough, frames_of, rate_of
from app.evaluation.speed.window_drawing import WindowLaps, drawn_laps
from engine.storage.json_files import JsonError, read_checked_json, write_checked_json
from engine.storage.typed_json import to_type

logger = logging.getLogger(__name__)

RATES_SCHEMA = 1
RATES_FILE = "frame_rates.json"
DEFINITION = (
    "FPS: pictures of one camera per second, one after another, at the size of the capture: the median over frames of "
    "decoding a frame and drawing it, until the picture is in main memory. Drawing alone: of frames that are decoded "
    "already. GL is the path of the window: pack, sort, draw, read back."
)


@dataclass(frozen=True, slots=True)
class FrameRates:
    """How fast a project is rendered on this machine.

    Attributes:
        camera: Name of the camera whose pictures were rendered.
        width, height: Of the pictures, px.
        cpu: By the CPU rasterizer; None where its times could not be measured.
        gl: By the window's OpenGL; None where there is none.
        why_no_gl: Why, in words; empty where there is one.
    """

    camera: str
    width: int
    height: int
    cpu: RenderRate | None
    gl: RenderRate | None
    why_no_gl: str = ""

    @property
    def size(self) -> str:
        """Size of the pictures, in words."""
        return f"{self.width} x {self.height}"

    def figures(self) -> dict[str, float | None]:
        """Single numbers for tables: FIGURES."""
        found = {"fps_cpu": self.cpu and self.cpu.fps, "fps_gl": self.gl and self.gl.fps}
        return found | {"n_gaussians": None if self.cpu is None else float(self.cpu.n_gaussians)}

    def words(self) -> str:
        """One sentence for a terminal."""
        said = [f"{self.size} px, camera {self.camera}"]
        for rate in (self.cpu, self.gl):
            if rate is not None:
                said.append(
                    f"{rate.fps:.1f} FPS by {rate.drawn_by} ({rate.fps_drawing:.1f} for drawing alone, "
                    f"{rate.n_gaussians:,} Gaussians)"
                )
        if self.gl is None:
            said.append(f"none by OpenGL: {self.why_no_gl}")
        return f"Rendering {'; '.join(said)}"


FIGURES = ("fps_cpu", "fps_gl", "n_gaussians")
RatesOf = Callable[[TrainedProject], FrameRates | None]
"""Measures a project; None where that is not wanted."""


def frame_rates(
    opened: TrainedProject,
    *,
    clock: Callable[[], float] = time.perf_counter,
    draw: Callable[[Path], WindowLaps] = drawn_laps,
) -> FrameRates:
    """Measure, or reuse rates measured on this machine; takes some seconds. Missing OpenGL rates are tried again.

    Args:
        clock: Seconds.
        draw: Laps of the window's OpenGL.
    Raises:
        ProjectError: A clip is damaged.
    """
    key = _key(opened)
    kept = _read(opened, key)
    if kept is not None and kept.gl is not None:
        return kept
    rig, camera = opened.capture.rig, camera_of(opened)
    width, height = (int(length) for length in rig.image_sizes[camera])
    cpu = kept.cpu if kept is not None else None
    if cpu is None:
        cpu = rate_of(list(enough(rasterized_laps(opened, clock))), rasterizing(key["n_threads"]))
    drawn = draw(opened.project.folder)
    gl = rate_of(drawn.laps, f"OpenGL, {drawn.renderer}")
    why_no_gl = "" if gl is not None else drawn.reason or "nothing was drawn"
    rates = FrameRates(rig.names[camera], width, height, cpu, gl, why_no_gl)
    try:
        write_checked_json(_path(opened), {"key": key, "rates": asdict(rates)})
    except OSError as error:
        logger.warning("frame rates are not kept (%s) - %s", error.strerror or error, _path(opened))
    return rates


def kept_rates(opened: TrainedProject) -> FrameRates | None:
    """Rates measured on this machine of these versions of the clips; None without any.

    Raises:
        ProjectError: A clip is damaged.
    """
    return _read(opened, _key(opened))


def _path(opened: TrainedProject) -> Path:
    return opened.project.folder / EVALUATIONS / RATES_FILE


def _key(opened: TrainedProject) -> dict[str, Any]:
    """Everything that the rates depend on, as far as it is known beforehand."""
    from llvmlite import binding

    frames = frames_of(opened)
    return {
        "schema": RATES_SCHEMA,
        "frames": {str(clip_index): chosen for clip_index, chosen in frames.items()},
        "clips": [opened.header(clip_index).fingerprint for clip_index in frames],
        "reference": opened.reference and opened.reference.header.fingerprint,
        "scale": opened.capture.scale,
        "camera": opened.capture.rig.names[camera_of(opened)],
        "processor": f"{platform.machine()} {binding.get_host_cpu_name()}",
        "n_threads": use_threads(None),
        "system": platform.system(),
        "versions": {name: importlib.metadata.version(name) for name in ("numba", "torch", "moderngl")},
    }


def _read(opened: TrainedProject, key: dict[str, Any]) -> FrameRates | None:
    try:
        content = read_checked_json(_path(opened))
        return to_type(content["rates"], FrameRates) if content.get("key") == key else None
    except (OSError, JsonError, KeyError, TypeError, ValueError):
        return None


def rasterizing(n_threads: int) -> str:
    """The renderer, in words."""
    return f"CPU rasterizer, {n_threads} thread{'' if n_threads == 1 else 's'}"


def rasterized_laps(opened: TrainedProject, clock: Callable[[], float]) -> Iterator[Lap]:
    """Render on all cores; yields the laps that count.

    Raises:
        ProjectError: A clip is damaged.
    """
    use_threads(None)
    import torch

    from engine.model.clip_view import render_gaussians, visible_rows
    from engine.model.host_array import host_array

    camera = camera_of(opened)
    for clip_index, frames in frames_of(opened).items():
        trained = opened.load(clip_index)
        view = trained.view(opened.capture.rig, camera)
        for number, frame in enumerate(frames):
            with torch.no_grad():
                start = clock()
                clip_time = trained.clip.clip_time(frame)
                rows = visible_rows(trained.model, view, clip_time, reach=trained.reach)
                gaussians = trained.model.decode(clip_time, rows)
                middle = clock()
                host_array(render_gaussians(gaussians, view, backend=trained.model.backend).image[0])
                end = clock()
            if number:
                yield Lap(middle - start, end - middle, len(gaussians.means))
