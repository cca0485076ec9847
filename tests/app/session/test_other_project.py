"""Another project as the other side of the comparison: the same place and moment, and what becomes of bad ones."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.importing.import_scene import import_scene
from app.playback.modes.arrays import Picture
from app.playback.modes.view_modes import ShownAs
from app.session.projects.project_commands import OpenCapture
from app.session.projects.settings import Settings
from app.session.session import Session
from app.session.showing.look_commands import CompareProject, SetFrame
from app.status import CAPTURED, PROJECT
from engine.camera.rotations import quats_of
from engine.export.formats.table import FORMATS
from engine.export.world import world
from engine.storage.json_files import json_text
from tests.app.conftest import poll_until
from tests.engine.importing.frames import moving_frames

N_FRAMES, N_OTHER = 6, 4
SIZE = 48, 32
PLACED = world(np.array([0.0, -1.0, 0.0]), up="+z", scale=2.5)


def write_frames(folder: Path, n: int, *, is_placed: bool = False, has_sidecar: bool = False) -> Path:
    """A scene of files, turned and scaled as our own exports do."""
    folder.mkdir()
    for number, splats in enumerate(moving_frames(n)):
        with (folder / f"{number}.ply").open("wb") as file:
            FORMATS["ply"].write(PLACED.placed(splats) if is_placed else splats, file)
    if has_sidecar:
        said = {"fps": 30.0, "up": PLACED.up, "scale": PLACED.scale, "quat": quats_of(PLACED.rotation).tolist()}
        (folder / "dance_export.json").write_text(json_text({**said, "files": [{"part": "all"}]}))
    return folder


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    import_scene(write_frames(tmp_path / "dance", N_FRAMES), tmp_path / "open")
    made = Session(settings=Settings(tmp_path / "settings"), is_preloading=False)
    made.dispatch(OpenCapture(tmp_path / "open"))
    poll_until(made, lambda: made.opened is not None)
    yield made
    made.close()


def compare(session: Session, path: Path) -> None:
    session.dispatch(CompareProject(path))
    poll_until(session, lambda: not session.jobs)


def both(session: Session) -> tuple[Picture, Picture]:
    """The rendered picture and the other one, once they are there."""
    found: list[Picture] = []

    def are_there() -> bool:
        pictures = session.request_render(*SIZE), session.request_other(*SIZE)
        found[:] = [one for one in pictures if one is not None and not one.is_stale]
        return len(found) == 2

    poll_until(session, are_there)
    return found[0], found[1]


def difference(session: Session) -> float:
    rendered, other = both(session)
    assert rendered.image.std() > 10, "there is something to see"
    return float(np.abs(rendered.image.astype(float) - other.image).max())


def told(session: Session) -> list[str]:
    return [f"{notice.title}: {notice.detail}" for notice in session.notices]


def test_the_same_scene_elsewhere_coincides_at_every_frame(session: Session, tmp_path: Path) -> None:
    import_scene(write_frames(tmp_path / "again", N_FRAMES), tmp_path / "other")
    compare(session, tmp_path / "other")
    assert (session.overlays.compare, session.overlays.compare_with) == ("wipe", PROJECT)
    for frame in (0, N_FRAMES - 1):
        session.dispatch(SetFrame(frame))
        assert difference(session) <= 1
        assert both(session)[1].source.frame_index == frame


@pytest.mark.parametrize("is_open_placed", [False, True])
def test_an_export_of_ours_is_put_back_where_it_was(session: Session, tmp_path: Path, is_open_placed: bool) -> None:
    scene = write_frames(tmp_path / "turned", N_OTHER, is_placed=True, has_sidecar=True)
    import_scene(scene, tmp_path / "other")
    if is_open_placed:  # the other way round
        session.dispatch(OpenCapture(tmp_path / "other"))
        poll_until(session, lambda: session.capture is not None and session.capture.n_frames == N_OTHER)
    compare(session, tmp_path / ("open" if is_open_placed else "other"))
    assert difference(session) <= 2


def test_any_other_scene_lies_as_it_is(session: Session, tmp_path: Path) -> None:
    import_scene(write_frames(tmp_path / "turned", N_OTHER, is_placed=True), tmp_path / "other")
    compare(session, tmp_path / "other")
    assert difference(session) > 20


def test_a_shorter_one_shows_its_last_frame(session: Session, tmp_path: Path) -> None:
    import_scene(write_frames(tmp_path / "short", N_OTHER), tmp_path / "other")
    compare(session, tmp_path / "other")
    session.dispatch(SetFrame(N_FRAMES - 1))
    rendered, other = both(session)
    assert (rendered.source.frame_index, other.source.frame_index) == (N_FRAMES - 1, N_OTHER - 1)
    assert session.other_project is not None
    assert session.other_project.n_frames == N_OTHER


def test_a_scene_is_imported_to_be_compared(session: Session, tmp_path: Path) -> None:
    session.projects.opener.projects = tmp_path / "projects"
    compare(session, write_frames(tmp_path / "again", N_FRAMES))
    assert difference(session) <= 1
    assert [one.name.startswith("again-") for one in (tmp_path / "projects").iterdir()] == [True]


def test_frames_of_the_other_one_never_stand_in_for_the_open_one(session: Session, tmp_path: Path) -> None:
    import_scene(write_frames(tmp_path / "again", N_FRAMES), tmp_path / "other")
    compare(session, tmp_path / "other")
    both(session)
    moving, still = ShownAs(content="dynamic"), ShownAs(content="static")

    def is_decoded() -> bool:
        picture = session.other.picture(*SIZE, full_size=None, shown_as=moving, view_id="moving")
        return picture is not None and picture.source.shown_as == moving

    poll_until(session, is_decoded)
    shown = session.playback.frame(session.timeline, still)
    assert shown is not None
    assert isinstance(shown.gaussians.key, tuple)
    assert session.opened is not None
    assert shown.gaussians.key[0] == session.opened.generation


def test_bad_choices_are_refused_and_change_nothing(session: Session, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged"
    shutil.copytree(tmp_path / "open", damaged)
    (damaged / "project.json").write_text("{")
    lost = tmp_path / "lost"
    shutil.copytree(tmp_path / "open", lost)
    shutil.rmtree(lost / "scene")
    nothing = tmp_path / "nothing"
    nothing.mkdir()
    for path, cause in (
        (tmp_path / "open", "is the open one"),
        (nothing, "not a project"),
        (tmp_path / "gone", "not a project"),
        (lost, "no longer where it was"),
        (damaged, "damaged"),
    ):
        compare(session, path)
        assert cause in told(session)[-1], path
        assert "cannot be compared" in told(session)[-1]
    assert session.other_project is None
    assert session.overlays.compare_with == CAPTURED


def test_clips_that_are_damaged_or_moved_away_are_named(session: Session, tmp_path: Path) -> None:
    import_scene(write_frames(tmp_path / "again", N_FRAMES), tmp_path / "other")
    compare(session, tmp_path / "other")
    both(session)
    (clip,) = (tmp_path / "other" / "clips").iterdir()
    content = clip.read_bytes()
    clip.unlink()  # whoever reads the file has it mapped, and would die of a shorter one
    clip.write_bytes(content[:-100])
    poll_until(session, lambda: _missing(session) == "other cannot be shown")
    poll_until(session, lambda: any(str(clip) in notice.hint for notice in session.notices))
    shutil.move(tmp_path / "other", tmp_path / "away")
    poll_until(session, lambda: _missing(session) == "other has no clip of frame 0")
    assert session.request_render(*SIZE) is not None, "the open project is as it was"


def _missing(session: Session) -> str:
    session.request_other(*SIZE)
    assert session.other_project is not None
    return session.other_project.missing


def test_another_open_project_ends_the_comparison(session: Session, tmp_path: Path) -> None:
    import_scene(write_frames(tmp_path / "again", N_OTHER), tmp_path / "other")
    compare(session, tmp_path / "other")
    session.dispatch(OpenCapture(tmp_path / "other"))
    poll_until(session, lambda: session.capture is not None and session.capture.n_frames == N_OTHER)
    assert session.other_project is None
    assert session.request_other(*SIZE) is None
