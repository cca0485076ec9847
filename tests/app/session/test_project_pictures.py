"""Small pictures of projects: made off the window's thread, read again, never a failure."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.playback.frame_decoder import ShownFrame
from app.playback.modes.arrays import AnchorArrays, GaussianArrays, Picture
from app.playback.render import RenderRequest
from app.playback.views.orbit_view import OrbitView
from app.project import project_picture
from app.project.opening.opened_project import OpenedProject
from app.project.project_picture import SIZE, fitted, picture_path, read_picture, write_picture
from app.session.projects import project_pictures
from app.session.projects.project_pictures import ProjectPictures
from tests.app.conftest import DEADLINE_S


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(project_picture, "cache_dir", lambda: tmp_path / "cache")


def poll(pictures: ProjectPictures, is_done: Callable[[], bool]) -> None:
    until_s = time.monotonic() + DEADLINE_S
    while not is_done():
        assert time.monotonic() < until_s
        pictures.poll()
        time.sleep(0.01)


def test_what_was_written_is_read_again_in_one_shape(tmp_path: Path) -> None:
    image = np.zeros((300, 400, 3), np.uint8)
    image[:, 200:] = 200
    write_picture(tmp_path, image)
    found = read_picture(tmp_path)
    assert found is not None
    assert found.shape == (SIZE[1], SIZE[0], 3)
    assert found[90, 10].max() < 30
    assert found[90, 310].min() > 170
    assert read_picture(tmp_path / "other") is None
    assert [path.suffix for path in picture_path(tmp_path).parent.iterdir()] == [".jpg"], "nothing half-written is left"


@pytest.mark.parametrize("shape", [(10, 1000), (1000, 10), (1, 1), (180, 320)])
def test_pictures_of_any_shape_are_cut_to_one(shape: tuple[int, int]) -> None:
    assert fitted(np.zeros((*shape, 3), np.uint8)).shape == (SIZE[1], SIZE[0], 3)


@pytest.mark.parametrize("content", [b"", b"not a picture", b"\xff\xd8\xff\xe0" + b"\x00" * 400])
def test_a_damaged_picture_counts_as_none(tmp_path: Path, content: bytes) -> None:
    path = picture_path(tmp_path)
    path.parent.mkdir(parents=True)
    path.write_bytes(content)
    assert read_picture(tmp_path) is None


def test_a_project_gets_what_the_first_camera_took_and_later_what_was_looked_at(
    make_opened: Callable[..., OpenedProject], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[RenderRequest] = []

    def draw(request: RenderRequest, backend: object) -> Picture:  # the rasterizer has tests of its own
        asked.append(request)
        look = request.look
        return Picture(np.full((look.height, look.width, 3), (200, 30, 30), np.uint8), "red")

    monkeypatch.setattr(project_pictures, "prepare_drawing", lambda: None)
    monkeypatch.setattr(project_pictures, "is_cache_warm", lambda: True)
    monkeypatch.setattr(project_pictures, "render", draw)
    monkeypatch.setattr(project_pictures, "CLOSE_S", DEADLINE_S)
    opened = make_opened("a")
    folder = opened.project.folder.resolve()
    pictures = ProjectPictures()
    pictures.keep(opened, None, OrbitView(opened.rig))
    poll(pictures, lambda: picture_path(folder).is_file())
    first = read_picture(folder)
    pictures.keep(opened, _one_gaussian(), OrbitView(opened.rig))
    pictures.close()  # waits for it
    second = read_picture(folder)
    assert first is not None
    assert second is not None
    assert (first != second).any()
    assert second[:, :, 0].min() > second[:, :, 2].max() + 60, "what is looked at was drawn"
    np.testing.assert_array_equal(asked[0].look.world_to_camera, OrbitView(opened.rig).world_to_camera())
    assert (asked[0].look.width, asked[0].look.height) == SIZE
    reader = ProjectPictures()
    reader.read((folder, folder / "gone"))
    poll(reader, lambda: reader.revision > 0)
    assert list(reader.found) == [folder]
    np.testing.assert_array_equal(reader.found[folder].image, second)
    reader.close()


def test_a_cache_that_cannot_be_written_costs_the_picture_only(
    make_opened: Callable[..., OpenedProject], tmp_path: Path
) -> None:
    (tmp_path / "cache").write_text("a file where the folder should be")
    opened = make_opened("a")
    pictures = ProjectPictures()
    pictures.keep(opened, None, OrbitView(opened.rig))
    poll(pictures, lambda: not pictures._jobs.statuses)
    pictures.close()
    assert read_picture(opened.project.folder) is None


def _one_gaussian() -> ShownFrame:
    nothing = np.zeros((0, 3), np.float32)
    gaussians = GaussianArrays(
        means=np.zeros((1, 3), np.float32),
        quats=np.array([[1, 0, 0, 0]], np.float32),
        scales=np.full((1, 3), 0.8, np.float32),
        opacities=np.full(1, 0.99, np.float32),
        colors=np.array([[1.0, 0.1, 0.1]], np.float32),
        key="red",
    )
    return ShownFrame(gaussians, AnchorArrays(nothing, nothing, key="none"))
