"""The layouts whose cameras stand in a table (YAML, TOML, JSON), by name: how the shared scene is written in each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from tests.engine.capture.layouts import (
    written_capture_json,
    written_easyvolcap,
    written_immersive,
    written_metashape,
    written_panoptic,
    written_panoptic_studio,
    written_qualisys,
    written_realitycapture,
    written_sample,
    written_technicolor,
    written_toml,
    written_transforms,
    written_vicon,
)
from tests.engine.capture.layouts.scene import Scene, make_scene

Write = Callable[[Path], Scene]
"""Writes the shared scene into a folder and tells what a reader must make of it."""


def written_by(write: Callable[[Path, Scene], None], make: Callable[[], Scene]) -> Write:
    """One function of a writer and the scene that it can say."""

    def written(folder: Path) -> Scene:
        scene = make()
        write(folder, scene)
        return scene

    return written


_NUMBERED = ("cam_0", "cam_1", "cam_2", "cam_3")
_PLAIN = ("0", "1", "2", "3")

TABLES: Mapping[str, Write] = {
    **{
        f"capture_json-{lens}": written_by(written_capture_json.write, partial(make_scene, lens=lens))
        for lens in ("pinhole", "opencv5", "fisheye")
    },
    "sample": written_by(written_sample.write, partial(make_scene, lens="pinhole")),
    "panoptic": written_by(written_panoptic.write, partial(make_scene, lens="pinhole", names=_PLAIN)),
    **{
        f"easyvolcap-{lens}": written_by(written_easyvolcap.write, partial(make_scene, lens=lens))
        for lens in written_easyvolcap.LENSES
    },
    "easyvolcap-videos": written_by(
        partial(written_easyvolcap.write, has_videos=True, has_vectors=False), partial(make_scene, lens="opencv5")
    ),
    **{
        f"anipose-{lens}": written_by(written_toml.write, partial(make_scene, lens=lens))
        for lens in written_toml.LENSES
    },
    "caliscope": written_by(
        partial(written_toml.write, kind="caliscope"), partial(make_scene, lens="opencv5", names=_NUMBERED)
    ),
    **{
        f"transforms-{lens}": written_by(written_transforms.write, partial(make_scene, lens=lens))
        for lens in written_transforms.LENSES
    },
    "transforms-folders": written_by(
        partial(written_transforms.write, kind="folders"), partial(make_scene, lens="opencv4")
    ),
    "transforms-videos": written_by(
        partial(written_transforms.write, kind="videos"), partial(make_scene, lens="fisheye")
    ),
    "transforms-split": written_by(partial(written_transforms.write, split=True), partial(make_scene, lens="pinhole")),
    "immersive": written_by(
        written_immersive.write,
        lambda: written_immersive.simplified(
            make_scene(lens="fisheye2", names=("camera_0001", "camera_0002", "camera_0010"))
        ),
    ),
    **{
        f"panoptic_studio-{lens}": written_by(
            written_panoptic_studio.write, partial(make_scene, lens=lens, names=("00_01", "00_02", "00_10"))
        )
        for lens in written_panoptic_studio.LENSES
    },
    **{
        f"qualisys-{lens}": written_by(
            written_qualisys.write, partial(make_scene, lens=lens, names=written_qualisys.SERIALS)
        )
        for lens in written_qualisys.LENSES
    },
    "qualisys-cropped": written_by(
        partial(written_qualisys.write, left=16, top=8),
        partial(make_scene, lens="opencv5", names=written_qualisys.SERIALS),
    ),
    **{
        f"vicon-{kind}": written_by(
            partial(written_vicon.write, kind=kind), partial(written_vicon.make_corrected_scene, kind=kind)
        )
        for kind in written_vicon.KINDS
    },
    **{
        f"metashape-{lens}": written_by(written_metashape.write, partial(make_scene, lens=lens))
        for lens in written_metashape.LENSES
    },
    "metashape-plain": written_by(
        partial(written_metashape.write, is_plain=True), partial(make_scene, lens="pinhole", is_centered=True)
    ),
    **{
        f"realitycapture-{lens}": written_by(written_realitycapture.write, partial(make_scene, lens=lens))
        for lens in written_realitycapture.LENSES
    },
    "technicolor": written_by(
        written_technicolor.write, partial(make_scene, lens="pinhole", names=("00", "01", "02", "03"))
    ),
}
