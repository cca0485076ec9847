"""Points that come with a capture: true ones are told from those of another world; single wrong ones are left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from app.lab.synthetic.raycast import SceneCamera, make_truth
from app.lab.synthetic.scene import make_scene
from engine.camera.projection import unproject
from engine.camera.rig import CameraRig
from engine.capture.layout.format_result import Layout
from engine.capture.points import CapturePoints
from engine.capture.writers.point_files import write_ply
from engine.cloud.stereo import static_cloud as clouds
from engine.cloud.stereo.given_points import true_points


@dataclass(frozen=True, eq=False)
class Room:
    """Pictures of the generated scene, and points on its surfaces. [P, 3]"""

    images: np.ndarray
    is_stable: np.ndarray
    rig: CameraRig
    points: np.ndarray


@pytest.fixture(scope="module")
def room() -> Room:
    scene = make_scene(size=(160, 120), n_cameras=14, n_frames=1, clip_length=1)
    images = np.stack([SceneCamera(scene, row, supersampling=1).image(0) for row in range(14)])
    generator = np.random.default_rng(0)
    points = []
    for row in range(0, 14, 3):
        depths = make_truth(scene, row, 0).depths.astype(np.float64)
        places = unproject(depths, scene.rig.Ks[row], scene.rig.world_to_camera[row])
        places = places[np.isfinite(places).all(axis=-1)]
        points.append(places[generator.choice(len(places), 250, replace=False)])
    return Room(images, np.ones(images.shape[:3], bool), scene.rig, np.concatenate(points))


@pytest.mark.slow
def test_points_on_surfaces_are_used(room: Room) -> None:
    found = true_points(room.points, room.images, room.is_stable, room.rig)
    assert found.is_used
    assert found.share > 0.25
    assert len(found.points) > 300


@pytest.mark.parametrize(
    "spoil",
    [
        lambda points: 1.25 * points,
        lambda points: points @ np.diag([1.0, -1.0, -1.0]),
        lambda points: points + np.array([0.0, 0.0, 0.7]),
        lambda points: np.random.default_rng(1).uniform(-2, 2, points.shape),
        lambda points: np.zeros((0, 3)),
        lambda points: points[:20],
        lambda points: points + 1e6,
    ],
)
def test_points_of_another_world_are_not(room: Room, spoil: Callable[[np.ndarray], np.ndarray]) -> None:
    found = true_points(spoil(room.points), room.images, room.is_stable, room.rig)
    assert not found.is_used
    assert found.points.shape == (0, 3)


def test_wrong_points_among_true_ones_are_left_out(room: Room) -> None:
    wrong = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3)) + np.array([0, 0, 1.2])
    found = true_points(np.concatenate([room.points, wrong]), room.images, room.is_stable, room.rig)
    assert found.is_used
    is_wrong = (found.points[:, None] == wrong[None]).all(-1).any(1)
    assert is_wrong.mean() < 0.1


def test_what_cannot_be_trusted_is_not_looked_at(room: Room) -> None:
    found = true_points(room.points, room.images, np.zeros_like(room.is_stable), room.rig)
    assert found.n_seen == 0
    assert not found.is_used


def test_the_preparation_uses_them_and_says_so(
    room: Room, tmp_path: Path, made_layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    from engine.cloud.stereo.sparse import SparsePoints
    from engine.training.config import TrainConfig
    from engine.training.preparation import cloud_preparation
    from engine.training.preparation.cloud_preparation import Backgrounds

    seen: list[np.ndarray | None] = []

    def remember(*_: object, sparse_points: np.ndarray | None, **__: object) -> clouds.StaticCloud:
        seen.append(sparse_points)
        raise InterruptedError

    monkeypatch.setattr(cloud_preparation, "triangulate", lambda *_, **__: SparsePoints.none())
    monkeypatch.setattr(cloud_preparation, "build_static_cloud", remember)
    said: list[str] = []
    for name, points in (("true.ply", 0.5 * room.points), ("false.ply", room.points), ("damaged.ply", None)):
        if points is None:
            (tmp_path / name).write_bytes(b"ply")
        else:
            write_ply(tmp_path / name, CapturePoints(points, None))
        layout = replace(made_layout, points=tmp_path / name, points_to_world=np.diag([2.0, 2.0, 2.0, 1.0]))
        with pytest.raises(InterruptedError):
            cloud_preparation.static_cloud(
                Backgrounds(room.images, room.is_stable),
                room.rig,
                None,
                TrainConfig(),
                lambda progress: said.append(getattr(progress, "message", "")),
                layout=layout,
            )
    told = [line for line in said if "The capture's point cloud" in line]
    assert len(told) == 3
    assert "is used" in told[0]
    assert "is not used" in told[1]
    assert "not a PLY file" in told[2] or "damaged" in told[2]
    assert seen[0] is not None
    assert len(seen[0]) > 300
    assert seen[1:] == [None, None]


@pytest.fixture
def made_layout() -> Layout:
    """A layout of which only the points are looked at."""
    return Layout(format="made", cameras=(), n_frames=1, fps=30.0)
