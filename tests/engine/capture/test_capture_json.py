"""capture.json: every entry does what it says, whatever was written can be read, and corrections hold."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engine.capture.capture import open_capture
from engine.capture.writers.capture_json import Corrections, capture_document, write_capture_json, write_corrections
from engine.errors import CaptureError

MakeCapture = Callable[..., Path]


@pytest.fixture
def described(make_sample: MakeCapture) -> Path:
    """A capture that has a capture.json beside its videos."""
    folder = make_sample(n_cameras=3, n_frames=6)
    write_capture_json(folder, capture_document(open_capture(folder).layout, folder))
    return folder


def edited(folder: Path, edit: Callable[[dict[str, Any]], None]) -> Path:
    path = folder / "capture.json"
    document = json.loads(path.read_text())
    edit(document)
    path.write_text(json.dumps(document))
    return folder


def test_what_was_written_reads_as_the_same_cameras_and_frames(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=6)
    before = open_capture(folder)
    write_capture_json(folder, capture_document(before.layout, folder))
    after = open_capture(folder)
    assert after.format == "capture.json"
    assert np.array_equal(after.rig.Ks, before.rig.Ks)
    assert np.array_equal(after.rig.world_to_camera, before.rig.world_to_camera)
    assert np.array_equal(after.frame(1, 3), before.frame(1, 3))


def test_images_by_pattern_sort_as_people_count(make_panoptic: MakeCapture) -> None:
    folder = make_panoptic(n_frames=3)
    before = open_capture(folder)
    document = capture_document(before.layout, folder)
    for camera in document["cameras"]:
        camera["images"] = f"ims/{camera['name']}/*.jpg"
    for name in ("0", "1", "2", "10"):
        for t in range(3):
            (folder / "ims" / name / f"{t:06d}.jpg").rename(folder / "ims" / name / f"{9 + t}.jpg")
    write_capture_json(folder, document)
    after = open_capture(folder)
    assert [path.name for path in after.layout.cameras[0].source.files] == ["9.jpg", "10.jpg", "11.jpg"]  # type: ignore[attr-defined]


def test_offsets_exclusion_and_holdout_are_corrections(described: Path) -> None:
    before = open_capture(described)
    names = before.rig.names
    write_corrections(
        before.layout,
        described,
        Corrections(is_excluded={names[0]: True}, offset_frames={names[1]: 2.0}, holdout=[names[2]]),
    )
    after = open_capture(described)
    assert after.rig.names == names[1:]
    assert after.n_frames == 4
    assert np.array_equal(after.frame(0, 0), before.frame(1, 2))
    assert np.array_equal(after.frame(1, 0), before.frame(2, 0))
    assert after.default_holdout == (names[2],)
    write_corrections(after.layout, described, Corrections(is_excluded={names[0]: False}))
    assert open_capture(described).rig.names == names


def test_integer_pixel_centers_world_scale_and_up(described: Path) -> None:
    before = open_capture(described)
    up = [0.0, -1.0, 0.0]
    edited(described, lambda document: document.update(pixel_center=0, world_scale=2.0, up=up))
    after = open_capture(described)
    assert np.allclose(after.rig.Ks[:, :2, 2], before.rig.Ks[:, :2, 2] + 0.5)
    point = np.array([0.3, -0.2, 0.9])
    turned = 2.0 * np.array([0.3, 0.9, 0.2])  # -y becomes +z: a quarter turn about x
    for old, new in zip(before.rig.world_to_camera, after.rig.world_to_camera, strict=True):
        seen, seen_now = old[:3, :3] @ point + old[:3, 3], new[:3, :3] @ turned + new[:3, 3]
        assert np.allclose(seen_now, 2.0 * seen)


def test_a_lens_is_undistorted_and_part_of_the_fingerprint(described: Path) -> None:
    before = open_capture(described)

    def bend(document: dict[str, Any]) -> None:
        document["cameras"][0]["lens"] = {"model": "opencv", "params": [0.3]}

    after = open_capture(edited(described, bend))
    assert after.fingerprint != before.fingerprint
    assert not np.array_equal(after.frame(0, 0), before.frame(0, 0))
    assert np.array_equal(after.frame(1, 0), before.frame(1, 0))
    valid = after.valid(0)
    assert valid is not None
    assert 0.5 < valid.mean() < 1.0
    assert after.valid(1) is None


def test_the_view_of_a_fisheye_is_a_correction(described: Path) -> None:
    def bend(document: dict[str, Any]) -> None:
        for camera in document["cameras"]:
            camera["lens"] = {"model": "fisheye", "params": [0.01]}

    edited(described, bend)
    before = open_capture(described)
    write_corrections(before.layout, described, Corrections(fisheye_fov_deg=40.0))
    after = open_capture(described)
    width = after.picture_size[0]
    for wide, narrow in zip(before.rig.Ks, after.rig.Ks, strict=True):
        half = max(narrow[0, 2], width - narrow[0, 2])
        assert np.degrees(np.arctan(half / narrow[0, 0])) == pytest.approx(20.0, abs=1e-9)
        assert narrow[0, 0] > 1.1 * wide[0, 0]
    assert after.valid(0) is None


def test_cameras_of_different_sizes_share_one_picture_size(
    described: Path, pictures: Callable[..., np.ndarray]
) -> None:
    from app.lab.synthetic.writing import write_video

    write_video(described / "cam01.mp4", (pictures(1, t, (48, 48)) for t in range(6)), fps=30.0)
    edited(described, lambda document: document["cameras"][1].update(width=48, height=48))
    capture = open_capture(described)
    assert capture.rig.image_sizes.tolist() == [[48, 48]] * 3
    valid = capture.valid(0)
    assert valid is not None
    assert valid[:32].all()
    assert not valid[32:].any()
    assert capture.valid(1) is None
    assert (capture.frame(0, 0)[32:] == 0).all()


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda d: d.update(cameras=[]), "no cameras"),
        (lambda d: d.update(schema=2), "schema 2"),
        (lambda d: d.update(colour="red"), "colour"),
        (lambda d: d["cameras"][1].update(video="../x.mp4"), "not inside its folder"),
        (lambda d: d["cameras"][1].update(images="a/*.png"), "both video and images"),
        (lambda d: d["cameras"][1].update(K=[[1, 2], [3, 4]]), "no 3x3 K"),
        (lambda d: d["cameras"][1].update(lens={"model": "pinhole", "params": [1]}), "pinhole has 0"),
        (lambda d: d["cameras"][1].update(lens={"model": "magic"}), "lens"),
        (lambda d: d["cameras"][1].update(offset_frames=100), "No frame is common"),
        (lambda d: d["cameras"][1].update(name="cam00"), 'called "cam00"'),
        (lambda d: d["cameras"][1].update(frames=[0, 6]), "go beyond the 6"),
        (lambda d: d["cameras"][1].update(frames=[]), "go beyond the 6"),
        (lambda d: d["cameras"][1].update(frames=[10**30]), "frames"),
        (lambda d: d.update(holdout=["nobody"]), "nobody"),
        (lambda d: d.update(up=[0, 0, 0]), "not a direction"),
        (lambda d: d["cameras"][1].pop("video"), "neither video nor images"),
    ],
)
def test_what_is_wrong_is_said(described: Path, edit: Callable[[dict[str, Any]], None], said: str) -> None:
    with pytest.raises(CaptureError) as caught:
        open_capture(edited(described, edit))
    assert said in str(caught.value)


def test_all_problems_come_at_once(described: Path) -> None:
    def spoil(document: dict[str, Any]) -> None:
        document["cameras"][0]["K"] = 3
        document["cameras"][1]["video"] = "gone.mp4"
        document["cameras"][2]["world_to_camera"][0][0] = float("nan")

    with pytest.raises(CaptureError) as caught:
        open_capture(edited(described, spoil))
    assert len(caught.value.problems) == 3


def test_corrections_of_unknown_cameras_are_refused(described: Path) -> None:
    with pytest.raises(CaptureError, match="no camera called nobody"):
        write_corrections(open_capture(described).layout, described, Corrections(is_excluded={"nobody": True}))
