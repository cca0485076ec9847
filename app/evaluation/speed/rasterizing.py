"""Laps of the CPU rasterizer, as eval and render make their pictures: what the camera cannot see is not decoded."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject
from app.evaluation.speed.laps import Lap, camera_of, frames_of


def rasterizing(n_threads: int) -> str:
    """What draws, in words."""
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
