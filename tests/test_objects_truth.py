"""Objects with known truth: what the scenes promise, and that the measuring finds perfect and bad picks to be so."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
import torch

from engine.backends.table import backend_called
from engine.capture.clip import Clip
from engine.clip_files.clip_header import FieldShape
from engine.editing.edit import Picked
from engine.editing.edited_clip import EditedClip
from engine.editing.selection.seen_from import SeenFrom
from engine.model.anchors import AnchorSet
from engine.model.clip_model import ClipModel
from engine.model.decoder import Decoder
from engine.model.field import SpatioTemporalField
from tests.engine.editing.edited_clips import names_of
from tests.objects_truth.correcting import correction
from tests.objects_truth.measuring import ClipFigures, clip_figures, shown
from tests.objects_truth.oracle import find_oracle, picked_rows
from tests.objects_truth.scene import CLIP_LENGTH, SCENARIOS, make_object_scene, object_names
from tests.objects_truth.selecting import lasso_seed
from tests.objects_truth.truth import ObjectsTruth, make_objects_truth, read_truth, write_truth
from tests.objects_truth.volumes import Volumes, read_volumes, truth_in_volumes

VOLUMES = Path(__file__).parent / "objects_truth" / "basketball_boxes.json"
CLIP = Clip(clip_index=2, start=10, n_frames=3, clip_length=3)
VIEW = SeenFrom(np.eye(4), np.array([[40.0, 0.0, 24.0], [0.0, 40.0, 16.0], [0.0, 0.0, 1.0]]), 48, 32)
TWO = Volumes(
    ("left", "right"),
    [{"left": {"center": [-0.8, 0, 3], "radius": 0.7}, "right": {"boxes": [[[0.1, -1, 2], [1.5, 1, 4]]]}}] * 13,
)
"""Two balls before the camera, in frames 0 to 12."""


@pytest.fixture(scope="module")
def balls() -> EditedClip:
    """Two dense balls of Gaussians that move, and a static wall behind them."""
    generator = torch.Generator().manual_seed(1)

    def ball(x: float, n: int) -> torch.Tensor:
        directions = torch.randn(n, 3, generator=generator)
        return torch.tensor([x, 0.0, 3.0]) + 0.4 * directions / directions.norm(dim=1, keepdim=True)

    wall = torch.rand(400, 3, generator=generator) * torch.tensor([6.0, 5.0, 0.0]) + torch.tensor([-3.0, -2.5, 6.0])
    points = {"static": wall, "moving": ball(-0.8, 300), "residual": ball(0.8, 300)}
    sets = {}
    for role, places in points.items():
        presence = None if role == "static" else torch.ones(len(places), CLIP.n_frames, dtype=torch.bool)
        gray = torch.full((len(places), 3), 0.5)
        sets[role] = AnchorSet.from_cloud(places, gray, spacing=0.1, feature_dim=8, presence=presence)
        if role != "residual":
            sets[role] = sets[role].subset(torch.ones(len(places), dtype=torch.bool), is_trainable=False)
    shape = FieldShape(CLIP.n_frames, (4, 7), 512, 4, 16, 6, (-3.0, -3.0, 0.0), 8.0)
    model = ClipModel(
        sets=sets,
        decoder=Decoder(static_dim=8, dynamic_dim=6, gaussians_per_anchor=3, hidden=16, generator=generator),
        field=SpatioTemporalField(shape, generator),
        clip_length=CLIP.clip_length,
        n_frames=CLIP.n_frames,
        backend=backend_called("cpu"),
    ).requires_grad_(requires_grad=False)
    return EditedClip(model, CLIP, names_of(model))


@pytest.fixture(scope="module")
def truth(balls: EditedClip) -> ObjectsTruth:
    """The masks of the two balls."""
    return truth_in_volumes([balls], {"cam": VIEW}, TWO)


def of_role(balls: EditedClip, *roles: str) -> np.ndarray:
    """Which Gaussians are of some roles, by index. [n] bool"""
    return np.array([one.role in roles for one in balls.rows.sets], bool)[balls.rows.set_of]


def figures(balls: EditedClip, truth: ObjectsTruth, is_chosen: np.ndarray, name: str = "left") -> ClipFigures:
    return clip_figures(balls, {"cam": VIEW}, truth, name, Picked(picked_rows(balls, is_chosen)))


def test_the_right_gaussians_are_found_to_be_right(balls: EditedClip, truth: ObjectsTruth) -> None:
    assert min(np.count_nonzero(truth.labels["cam"][10] == label) for label in (1, 2)) > 50
    for name, role in (("left", "moving"), ("right", "residual")):
        perfect = figures(balls, truth, of_role(balls, role), name)
        assert (perfect.iou, perfect.lowest, perfect.left, perfect.lost) == (1.0, 1.0, 0.0, 0.0)


def test_the_wrong_gaussians_are_found_to_be_wrong(balls: EditedClip, truth: ObjectsTruth) -> None:
    other = figures(balls, truth, of_role(balls, "residual"))
    assert (other.iou, other.left, other.lost) == (0.0, 1.0, 1.0)
    both = figures(balls, truth, of_role(balls, "moving", "residual"))
    assert both.iou is not None
    assert 0.4 < both.iou < 0.6
    assert (both.left, both.lost) == (0.0, 1.0)
    none = figures(balls, truth, of_role(balls))
    assert (none.iou, none.left, none.lost) == (0.0, 1.0, 0.0)


def test_a_clip_without_the_object_has_no_iou(balls: EditedClip, truth: ObjectsTruth) -> None:
    nowhere = ObjectsTruth(("left", "right", "absent"), truth.labels, {"cam": np.zeros((3, 13, 32, 48), np.uint8)})
    missed = figures(balls, nowhere, of_role(balls, "moving"), "absent")
    assert (missed.iou, missed.lowest, missed.left, missed.n_true) == (None, None, None, 0)
    assert missed.n_drawn > 50


def test_the_oracle_finds_what_the_masks_show(balls: EditedClip, truth: ObjectsTruth) -> None:
    oracle = find_oracle(balls, {"cam": VIEW}, truth, "left")
    assert not oracle.is_object[of_role(balls, "static", "residual")].any()
    assert oracle.weights["moving"] > 0.7 > 0.3 > oracle.weights["static"]
    found = figures(balls, truth, oracle.is_object)
    assert found.iou is not None
    assert found.iou > 0.97
    assert found.left is not None
    assert found.left < 0.02
    whole = balls.decode(0.0)
    index = balls.rows.indices_of(whole.rows)
    assert shown(whole, VIEW, oracle.is_object[index]).max() <= 1.0 + 1e-6


def test_a_lasso_selects_the_near_side_of_its_object(balls: EditedClip, truth: ObjectsTruth) -> None:
    seed = lasso_seed(balls, {"cam": VIEW}, truth, "right", 10)
    is_chosen = balls.rows.is_picked(Picked(seed.added))
    assert not is_chosen[of_role(balls, "moving")].any()
    ball = of_role(balls, "residual")
    assert 0.2 < is_chosen[ball].mean() < 0.9


def test_volumes_of_the_real_capture_are_complete() -> None:
    volumes = read_volumes(VOLUMES)
    assert volumes.objects == ("thrower", "catcher", "ball")
    assert len(volumes.frames) == 40
    for frame_index, frame in enumerate(volumes.frames):
        assert volumes.labels(frame_index, np.array([frame["ball"]["center"]])) == 3
        for name in ("thrower", "catcher"):
            boxes = np.array(frame[name]["boxes"])
            assert boxes.shape == (2, 2, 3)
            assert (boxes[:, 0] < boxes[:, 1]).all()


def test_truth_of_a_scene_is_written_and_read(tmp_path: Path) -> None:
    pytest.importorskip("open3d", reason="the ray caster needs Open3D and its system libraries", exc_type=ImportError)
    scene = make_object_scene("throwing", size=(40, 30))
    write_truth(made := make_objects_truth(scene, (3,)), tmp_path)
    read = read_truth(tmp_path)
    assert read.objects == made.objects == object_names(scene) == ("person_a", "person_b", "ball")
    np.testing.assert_array_equal(read.labels["cam03"], made.labels["cam03"])
    np.testing.assert_array_equal(read.behind["cam03"], made.behind["cam03"])
    assert read.size == (40, 30)
    labels = read.labels["cam03"]
    assert {1, 2} <= set(np.unique(labels[0]))
    assert (labels == read.label("ball")).any()
    for label in (1, 2, 3):  # an object that is taken away changes its own pixels only
        gone = read.behind["cam03"][label - 1]
        assert not (gone == label).any()
        np.testing.assert_array_equal(gone[labels != label], labels[labels != label])


def test_scenes_keep_their_promises() -> None:
    poses = {name: {part.name: part.pose for part in make_object_scene(name).parts} for name in SCENARIOS}
    leaving = poses["leaving"]["person_a.trunk"]
    away = [leaving(frame) is None for frame in range(60)]
    assert all(away[3 * CLIP_LENGTH : 4 * CLIP_LENGTH])
    assert not away[0]
    assert not away[59]
    for limb in ("trunk", "arm_left", "arm_right", "leg_left", "leg_right"):
        still = poses["pausing"][f"person_a.{limb}"]
        clip = [still(frame) for frame in range(2 * CLIP_LENGTH, 3 * CLIP_LENGTH)]
        assert clip[0] is not None
        assert all(pose is not None and np.array_equal(pose, clip[0]) for pose in clip)
    closest = min(
        float(np.linalg.norm(a[:2, 3] - b[:2, 3]))
        for frame in range(40)
        if (a := poses["touching"]["person_a.trunk"](frame)) is not None
        and (b := poses["touching"]["person_b.trunk"](frame)) is not None
    )
    assert closest < 2 * (0.215 + 0.055)  # of both, from the middle to the outside of an arm
    ball = [pose for frame in range(40) if (pose := poses["throwing"]["ball"](frame)) is not None]
    ways = [float(np.linalg.norm(b[:3, 3] - a[:3, 3])) for a, b in itertools.pairwise(ball)]
    assert len(ball) == 40
    assert 0.1 < max(ways) < 0.35
    with pytest.raises(ValueError, match="no scene called"):
        make_object_scene("dancing")


def test_a_correction_adds_what_is_missing(balls: EditedClip, truth: ObjectsTruth) -> None:
    seed = correction(balls, {"cam": VIEW}, truth, "left", Picked(()))
    assert not seed.removed
    assert seed == lasso_seed(balls, {"cam": VIEW}, truth, "left", seed.frame_index)


def test_a_correction_removes_what_is_too_much(balls: EditedClip, truth: ObjectsTruth) -> None:
    both = Picked(picked_rows(balls, of_role(balls, "moving", "residual")))
    seed = correction(balls, {"cam": VIEW}, truth, "left", both)
    assert not seed.added
    is_removed = balls.rows.is_picked(Picked(seed.removed))
    assert is_removed[of_role(balls, "residual")].mean() > 0.3
    assert not is_removed[of_role(balls, "moving")].any()
