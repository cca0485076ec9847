"""Masks of what moves that came with a capture: found beside any layout, undistorted with the picture, or refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.lab.synthetic.writing import write_video
from engine.capture.capture import open_capture
from engine.capture.writers.capture_json import Corrections, capture_document, write_capture_json, write_corrections
from engine.errors import CaptureError

MakeCapture = Callable[..., Path]


def write_masks(folder: Path, camera: str, *, n_frames: int, size: tuple[int, int]) -> np.ndarray:
    """A bar of white that goes to the right, one column a frame. [T, H, W] bool"""
    (folder / "masks" / camera).mkdir(parents=True)
    width, height = size
    masks = np.zeros((n_frames, height, width), bool)
    for frame in range(n_frames):
        masks[frame, height // 4 : height // 2, 4 + 2 * frame : 12 + 2 * frame] = True
        image = Image.fromarray(masks[frame].astype(np.uint8) * 255)
        image.save(folder / "masks" / camera / f"{frame + 8}.png")  # 10 comes after 9
    return masks


@pytest.mark.parametrize("layout", ["make_sample", "make_panoptic"])
def test_masks_beside_any_layout_are_found_and_said(layout: str, request: pytest.FixtureRequest) -> None:
    folder = request.getfixturevalue(layout)(n_frames=4)
    before = open_capture(folder)
    name, size = before.rig.names[1], before.picture_size
    masks = write_masks(folder, name, n_frames=4, size=size)
    capture = open_capture(folder)
    assert capture.has_masks == tuple(other == name for other in before.rig.names)
    assert capture.moving_mask(0, 2) is None
    for frame in range(4):
        found = capture.moving_mask(1, frame)
        assert found is not None
        assert np.array_equal(found, masks[frame])
    assert any("motion masks for 1 of" in said and name in said for said in capture.warnings)


def test_a_video_of_masks_and_smaller_masks(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=4)
    width, height = open_capture(folder).picture_size
    (folder / "masks").mkdir()
    white = np.zeros((height // 2, width // 2, 3), np.uint8)
    white[:, : width // 4] = 255
    write_video(folder / "masks" / "cam00.mp4", [white] * 4, fps=30.0)
    mask = open_capture(folder).moving_mask(0, 3)
    assert mask is not None
    assert mask.shape == (height, width)
    assert mask[:, : width // 2 - 1].all()
    assert not mask[:, width // 2 + 1 :].any()


@pytest.mark.slow
def test_masks_go_where_the_lens_puts_the_picture(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=4)
    size = open_capture(folder).picture_size
    write_masks(folder, "cam00", n_frames=4, size=size)
    document = capture_document(open_capture(folder).layout, folder)
    document["cameras"][0]["lens"] = {"model": "opencv", "params": [0.3]}
    write_capture_json(folder, document)
    capture = open_capture(folder)
    mask, valid = capture.moving_mask(0, 1), capture.valid(0)
    assert mask is not None
    assert valid is not None
    assert mask.any()
    assert not mask[~valid].any()
    optics = capture.store.optics[0]
    stored = next(iter(capture.store.masks[0].read([1])))  # type: ignore[union-attr]
    assert np.array_equal(mask, optics.picture(stored)[..., 0] > 127)


def test_masks_follow_the_offset_of_their_camera(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=6)
    masks = write_masks(folder, "cam01", n_frames=6, size=open_capture(folder).picture_size)
    write_corrections(open_capture(folder).layout, folder, Corrections(offset_frames={"cam01": 2.0}))
    capture = open_capture(folder)
    assert capture.n_frames == 4
    found = capture.moving_mask(1, 0)
    assert found is not None
    assert np.array_equal(found, masks[2])


def test_masks_are_counted_from_the_first_frame_that_is_worked_on(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=6)
    masks = write_masks(folder, "cam01", n_frames=6, size=open_capture(folder).picture_size)
    found = open_capture(folder, frames=(2, 5)).moving_mask(1, 1)
    assert found is not None
    assert np.array_equal(found, masks[3])


def test_masks_that_do_not_fit_are_left_out_and_said(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=4)
    width, height = open_capture(folder).picture_size
    write_masks(folder, "cam00", n_frames=3, size=(width, height))
    write_masks(folder, "cam01", n_frames=4, size=(width, width))
    (folder / "masks" / "cam02").mkdir()
    (folder / "masks" / "cam02" / "0.png").write_bytes(b"not an image")
    capture = open_capture(folder)
    assert capture.has_masks == (False, False, False)
    said = "\n".join(capture.warnings)
    assert 'camera "cam00" are not used: there are 3 of them for 4 frames' in said
    assert f'camera "cam01" are not used: they are {width}x{width}' in said
    assert 'camera "cam02" are not used' in said


def test_a_folder_of_masks_for_nobody_is_said(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=4)
    (folder / "masks" / "camera0").mkdir(parents=True)
    assert any("has no masks for any camera" in said for said in open_capture(folder).warnings)


def test_masks_outside_of_the_capture_are_not_followed(make_sample: MakeCapture, tmp_path: Path) -> None:
    folder = make_sample(n_cameras=3, n_frames=4)
    outside = tmp_path / "outside"
    write_masks(outside, "cam00", n_frames=4, size=open_capture(folder).picture_size)
    (folder / "masks").symlink_to(outside / "masks")
    assert not any(open_capture(folder).has_masks)
    assert open_capture(folder, follow_links=True).has_masks[0]


def test_named_masks_must_be_enough(make_sample: MakeCapture) -> None:
    folder = make_sample(n_cameras=3, n_frames=4)
    write_masks(folder, "cam00", n_frames=3, size=open_capture(folder).picture_size)
    write_corrections(open_capture(folder).layout, folder, Corrections(masks={"cam00": "masks/cam00/*.png"}))
    with pytest.raises(CaptureError, match='"cam00" has 3 masks for 4 frames'):
        open_capture(folder)
