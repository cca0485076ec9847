"""Every layout that is read, by name: how the shared scene is written in each."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from tests.engine.capture.layouts import written_colmap, written_colmap_frames, written_multipleview, written_n3dv
from tests.engine.capture.layouts.scene import make_scene
from tests.engine.capture.layouts.tables import TABLES, Write, written_by

_LLFF = partial(make_scene, lens="pinhole", is_centered=True, is_one_focal=True)

ALL: Mapping[str, Write] = {
    **TABLES,
    **{
        f"colmap-{lens}-{'binary' if is_binary else 'text'}": written_by(
            partial(written_colmap.write, lens=lens, is_binary=is_binary), partial(make_scene, lens=lens)
        )
        for lens in ("pinhole", "opencv4", "fisheye")
        for is_binary in (True, False)
    },
    "colmap_frames": written_by(
        partial(written_colmap_frames.write, lens="opencv4"), partial(make_scene, lens="opencv4")
    ),
    "multipleview": written_by(
        partial(written_multipleview.write, lens="pinhole"), partial(make_scene, lens="pinhole")
    ),
    "n3dv-videos": written_by(written_n3dv.write, _LLFF),
    "n3dv-images": written_by(partial(written_n3dv.write, frames="images"), _LLFF),
}
