"""Renders frames of a project as the window does and says how long that takes; a program of its own, without a window.

`python -m ui.frame_rate PROJECT` prints one line, see app.evaluation.speed.window_drawing. Frames are decoded like
those of the playback, all Gaussians of the clip; sorting, which a window leaves to a thread, is waited for.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import moderngl

from app.background.kernels import use_threads
from app.evaluation.headless import TrainedProject, open_trained
from app.evaluation.speed.laps import Lap, camera_of, enough, frames_of
from app.evaluation.speed.window_drawing import WindowLaps, said_by
from app.playback.frame_decoder import ClipFiles, FrameRequest, decode_frame
from app.project.opening.project_access import open_project
from engine.errors import EngineError
from engine.kernels.cache import use_kernel_cache
from ui.gl.context import ContextError, is_software, make_headless_context, renderer_name
from ui.gl.splat_renderer import SplatRenderer
from ui.gl.targets import Target

MANY = 1 << 62
"""No set of Gaussians has more rows, so none waits for the sorter's thread."""


def drawn_laps(
    opened: TrainedProject, ctx: moderngl.Context, clock: Callable[[], float] = time.perf_counter
) -> Iterator[Lap]:
    """Render the frames of `frames_of`; yields the laps that count.

    Args:
        ctx: Current.
    Raises:
        ProjectError: A clip is damaged.
    """
    camera, rig, files = camera_of(opened), opened.rig, ClipFiles()
    width, height = (int(length) for length in rig.image_sizes[camera])
    target = Target(ctx, (width, height), precision="f1" if is_software(ctx) else "f2")
    splats = SplatRenderer(ctx, on_thread_above=MANY)
    try:
        for clip_index, frames in frames_of(opened).items():
            requests = [_request(opened, clip_index, frame) for frame in frames]
            loaded = files.read(requests[0], opened.backend)
            for number, request in enumerate(requests):
                start = clock()
                gaussians = decode_frame(loaded, request).gaussians
                middle = clock()
                splats.upload(replace(gaussians, key=None))  # without a name it is packed, whatever came before
                target.clear()
                splats.draw(target, rig.world_to_camera[camera], rig.Ks[camera], width, height, gaussians.near_plane)
                target.resolve().read()
                end = clock()
                if number:
                    yield Lap(middle - start, end - middle, len(splats))
    finally:
        splats.release()
        target.release()


def _request(opened: TrainedProject, clip_index: int, frame: int) -> FrameRequest:
    project = opened.project
    return FrameRequest(
        clip_index,
        opened.header(clip_index).fingerprint,
        frame,
        project.clip_path(clip_index),
        0,
        project.reference_path,
        opened.clips[clip_index],
    )


def _context() -> moderngl.Context:
    """One without a window, however the system makes that."""
    if sys.platform.startswith("linux"):
        return make_headless_context()
    return moderngl.create_standalone_context(require=330)


def main(folder: Path) -> WindowLaps:
    """Measure a project; says why where that cannot be done."""
    use_kernel_cache()
    use_threads(None)
    try:
        ctx = _context()
    except Exception as error:  # noqa: BLE001 - drivers raise anything
        return WindowLaps([], "", str(error) if isinstance(error, ContextError) else f"no OpenGL 3.3 ({error})")
    try:
        opened = open_trained(open_project(folder, is_writable=False))
        return WindowLaps(list(enough(drawn_laps(opened, ctx))), renderer_name(ctx))
    except EngineError as error:
        return WindowLaps([], "", error.message)
    finally:
        ctx.release()


if __name__ == "__main__":
    sys.stdout.write(said_by(main(Path(sys.argv[1]))) + "\n")
