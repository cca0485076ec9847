"""Captured pictures: two takes of one rig have the same fingerprint, and are still never mistaken for each other."""

from __future__ import annotations

import shutil
import threading
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.playback.capture_pictures import CapturedPictures, downsized
from app.playback.modes.hatching import DARK, LIGHT
from app.playback.picture_source import PictureSource
from engine.capture.capture import Capture, open_capture
from engine.images.rendition import Rendition
from tests.app.fakes import write_capture

WAIT_S = 300.0


@pytest.fixture
def takes(tmp_path: Path) -> tuple[Capture, Capture]:
    """The same cameras twice; the second take is black."""
    first = write_capture(tmp_path / "a", n_cameras=2, n_frames=2)
    second = Path(shutil.copytree(first, tmp_path / "b"))
    for index, path in enumerate(sorted(second.rglob("*.jpg"))):  # no two files alike, as in a real capture
        Image.fromarray(np.full((24, 32, 3), index, np.uint8)).save(path, quality=95 - index)
    return open_capture(first), open_capture(second)


def test_a_picture_says_what_it_is_of(takes: tuple[Capture, Capture]):
    pictures = CapturedPictures()
    assert pictures.picture(takes[0], 1, 1, 1, 400) is None
    assert pictures.viewing.wait_idle(WAIT_S)
    picture = pictures.picture(takes[0], 1, 1, 1, 400)
    assert picture is not None
    assert (picture.source, picture.size) == (PictureSource(camera_index=1, frame_index=1), (32, 24))
    last = pictures.picture(takes[0], 1, 1, 0, 400)
    assert last is not None
    assert (last.is_stale, last.source.frame_index) == (True, 1)
    pictures.close()


def test_a_picture_in_the_scenes_colours_is_another_one_than_as_it_was_taken(takes: tuple[Capture, Capture]):
    pictures, seen = CapturedPictures(), Rendition((1.25, 1.0, 0.8), (-0.2, 0.05))
    found = {}
    for rendition in (None, seen):
        assert pictures.picture(takes[0], 1, 1, 1, 400, rendition) is None or rendition is not None
        assert pictures.viewing.wait_idle(WAIT_S)
        found[rendition] = pictures.picture(takes[0], 1, 1, 1, 400, rendition)
    taken, evened = found[None], found[seen]
    assert taken is not None
    assert evened is not None
    assert (taken.source.has_scene_colors, evened.source.has_scene_colors) == (False, True)
    assert taken.key != evened.key
    assert np.array_equal(taken.image, takes[0].frame(1, 1))
    assert np.array_equal(evened.image, seen.to_scene(taken.image))
    assert evened.image[..., 0].mean() < taken.image[..., 0].mean() - 10
    again = pictures.picture(takes[0], 1, 1, 1, 400)
    assert again is not None
    assert (again.key, again.is_stale) == (taken.key, False)
    pictures.close()


def test_a_picture_of_another_take_is_never_shown(takes: tuple[Capture, Capture], monkeypatch: pytest.MonkeyPatch):
    first, second = takes
    assert first.fingerprint == second.fingerprint
    was_read, go_on = threading.Event(), threading.Event()
    read = Capture.frame

    def read_and_wait(capture: Capture, camera_index: int, frame_index: int) -> np.ndarray:
        image = read(capture, camera_index, frame_index)
        was_read.set()
        assert go_on.wait(WAIT_S)
        return image

    monkeypatch.setattr(Capture, "frame", read_and_wait)
    pictures = CapturedPictures()
    assert pictures.picture(first, 1, 0, 0, 400) is None
    assert was_read.wait(WAIT_S)
    pictures.clear()  # the second take is opened
    go_on.set()
    assert pictures.viewing.wait_idle(WAIT_S)
    assert pictures.picture(second, 2, 0, 0, 400) is None
    assert pictures.viewing.wait_idle(WAIT_S)
    picture = pictures.picture(second, 2, 0, 0, 400)
    assert picture is not None
    assert picture.image.max() < 8
    pictures.close()


def test_what_a_camera_does_not_see_is_hatched_except_in_thumbnails(
    takes: tuple[Capture, Capture], monkeypatch: pytest.MonkeyPatch
):
    is_valid = np.ones((24, 32), bool)
    is_valid[:, 20:] = False
    plain = takes[0].frame(1, 1)
    monkeypatch.setattr(Capture, "valid", lambda self, camera_index: is_valid)
    pictures = CapturedPictures()
    for max_width, worker in ((400, pictures.viewing), (20, pictures.thumbnails)):
        pictures.picture(takes[0], 1, 1, 1, max_width)
        assert worker.wait_idle(WAIT_S)
    shown, small = (pictures.picture(takes[0], 1, 1, 1, max_width) for max_width in (400, 20))
    assert shown is not None
    assert small is not None
    assert np.array_equal(shown.image[:, :20], plain[:, :20])
    assert set(np.unique(shown.image[:, 20:])) == {DARK, LIGHT}
    assert np.array_equal(small.image, downsized(plain, 20))
    pictures.close()
