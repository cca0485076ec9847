"""Does OpenGL draw what the CPU rasterizer draws? Random views of every trained clip of a project, compared.

    python -m tests.benchmarks.bench_gl PROJECT [--views 20]

Views lie around the cameras of the capture: displaced by up to a tenth of the distance between cameras and turned by up
to ten degrees. Both draw the same decoded Gaussians, OpenGL in half floats as the window does, over black.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch

from app.background.kernels import use_threads
from app.evaluation.headless import open_trained
from app.playback.frame_decoder import ClipFiles, FrameRequest, decode_frame
from app.project.opening.project_access import open_project
from engine.doctor.refit import rotation_of
from engine.raster import Gaussians, rasterize
from tests.benchmarks.options import ending_on_bad_input
from tests.documents.table import table
from tests.ui.gl.pixels import read_color
from tests.ui.gl.scenes import FIELDS
from ui.gl.context import make_headless_context, renderer_name
from ui.gl.splat_renderer import SplatRenderer
from ui.gl.targets import Target

ALL_AT_ONCE = 1 << 62
OFF = 2 / 255


def view_near(pose: np.ndarray, reach: float, generator: np.random.Generator) -> np.ndarray:
    """A camera's pose, moved and turned at random. [4, 4]"""
    moved = pose.copy()
    axis = generator.normal(size=3)
    turn = rotation_of(np.radians(generator.uniform(0, 10)) * axis / np.linalg.norm(axis))
    moved[:3] = turn @ pose[:3]
    moved[:3, 3] += generator.uniform(-reach, reach, 3)
    return moved


def main() -> None:
    """Command line; see the module docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("project", type=Path)
    parser.add_argument("--views", type=int, default=20, help="of each clip")
    options = parser.parse_args()
    use_threads(None)
    rows = []
    with ending_on_bad_input(), make_headless_context() as ctx:
        opened = open_trained(open_project(options.project, is_writable=False))
        project, rig, files, generator = opened.project, opened.rig, ClipFiles(), np.random.default_rng(0)
        width, height = (int(length) for length in rig.image_sizes[0])
        target = Target(ctx, (width, height), precision="f2")
        splats = SplatRenderer(ctx, on_thread_above=ALL_AT_ONCE)
        reach = 0.1 * float(np.ptp(rig.centers, axis=0).mean())
        for clip_index in opened.trained:
            clip, levels, off = opened.clips[clip_index], [], []
            for _ in range(options.views):
                frame, camera = (int(generator.integers(n)) for n in (clip.n_frames, len(rig)))
                request = FrameRequest(
                    clip_index,
                    opened.header(clip_index).fingerprint,
                    clip.start + frame,
                    project.clip_path(clip_index),
                    0,
                    project.reference_path,
                    clip,
                )
                found = decode_frame(files.read(request, opened.backend), request).gaussians
                pose, near = view_near(rig.world_to_camera[camera], reach, generator), found.near_plane
                splats.upload(found)
                target.clear()
                splats.draw(target, pose, rig.Ks[camera], width, height, near)
                by_gl = read_color(target)[..., :3]
                arrays = Gaussians(**{name: torch.from_numpy(np.array(getattr(found, name))) for name in FIELDS})
                with torch.no_grad():
                    drawn = rasterize(
                        arrays,
                        torch.from_numpy(pose).float()[None],
                        torch.from_numpy(rig.Ks[camera]).float()[None],
                        width,
                        height,
                        near_plane=near,
                        backend=opened.backend,
                    )
                error = np.abs(by_gl - drawn.image[0].numpy())
                levels.append(-10 * np.log10(np.mean(error**2) + 1e-30))
                off.append(100 * float((error.max(axis=-1) > OFF).mean()))
            cells = (f"{min(levels):.1f}", f"{np.median(levels):.1f}", f"{max(off):.3f} %")
            rows.append((f"{project.folder.name}, clip {clip_index}", str(len(levels)), *cells))
        print(renderer_name(ctx))
        splats.release()
        target.release()
    print(table(("clip", "views", "PSNR at least, dB", "median", "pixels off by more than 2/255, at most"), rows))


if __name__ == "__main__":
    main()
