"""Factories for tiny captures of both layouts, written without the ray caster so that they take milliseconds."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.lab.synthetic.rigs import make_rig
from app.lab.synthetic.writing import write_video

SIZE = (48, 32)
Document = dict[str, Any]


def picture(camera_index: int, frame_index: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    """A smooth picture that tells camera and frame apart. [H, W, 3] uint8"""
    width, height = size
    x = np.linspace(0, 1, width)[None, :]
    y = np.linspace(0, 1, height)[:, None]
    red = 40 + 160 * x + 0 * y
    green = 30 + 6 * frame_index + 60 * y + 0 * x
    blue = 30 + 40 * camera_index + 30 * x * y
    return np.stack([red, green, blue], axis=-1).round().astype(np.uint8)


@pytest.fixture
def pictures() -> Callable[..., np.ndarray]:
    """`picture`, for tests that compare against it."""
    return picture


@pytest.fixture
def make_sample(tmp_path: Path) -> Callable[..., Path]:
    """make_sample(n_cameras=3, n_frames=6, edit=..., n_frames_of={name: n}) -> folder in the sample layout."""

    def make(
        *,
        n_cameras: int = 3,
        n_frames: int = 6,
        edit: Callable[[Document], None] | None = None,
        n_frames_of: dict[str, int] | None = None,
    ) -> Path:
        folder = tmp_path / "sample"
        folder.mkdir()
        rig = make_rig(n_cameras, SIZE)
        cameras = []
        for i, name in enumerate(rig.names):
            n = (n_frames_of or {}).get(name, n_frames)
            write_video(folder / f"{name}.mp4", (picture(i, t) for t in range(n)), fps=30.0)
            camera = {"name": name, "file": f"{name}.mp4", "width": SIZE[0], "height": SIZE[1]}
            matrices = {"K": rig.Ks[i].tolist(), "world_to_camera": rig.world_to_camera[i].tolist()}
            cameras.append(camera | matrices)
        document = {"schema": 1, "fps": 30, "n_frames": n_frames, "cameras": cameras}
        if edit is not None:
            edit(document)
        (folder / "cameras.json").write_text(json.dumps(document))
        return folder

    return make


@pytest.fixture
def make_panoptic(tmp_path: Path) -> Callable[..., Path]:
    """make_panoptic(train_ids, test_ids, n_frames, edit=...) -> folder in the panoptic layout.

    `edit` gets both documents by file name and changes them in place.
    """

    def make(
        *,
        train_ids: tuple[int, ...] = (1, 10, 2),
        test_ids: tuple[int, ...] = (0,),
        n_frames: int = 3,
        edit: Callable[[dict[str, Document]], None] | None = None,
    ) -> Path:
        folder = tmp_path / "dome"
        rig = make_rig(11, SIZE)
        documents = {}
        for name, ids in (("train_meta.json", train_ids), ("test_meta.json", test_ids)):
            documents[name] = {
                "w": SIZE[0],
                "h": SIZE[1],
                "k": [[rig.Ks[i].tolist() for i in ids]] * n_frames,
                "w2c": [[rig.world_to_camera[i].tolist() for i in ids]] * n_frames,
                "fn": [[f"{i}/{t:06d}.jpg" for i in ids] for t in range(n_frames)],
                "cam_id": [list(ids)] * n_frames,
            }
            for i in ids:
                (folder / "ims" / str(i)).mkdir(parents=True)
                for t in range(n_frames):
                    Image.fromarray(picture(i, t)).save(folder / "ims" / str(i) / f"{t:06d}.jpg", quality=95)
        documents = json.loads(json.dumps(documents))  # rows are repeated above; edits must touch one row only
        if edit is not None:
            edit(documents)
        for name, document in documents.items():
            (folder / name).write_text(json.dumps(document))
        return folder

    return make
