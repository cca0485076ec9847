"""The Python API: a project opened, trained, edited, rendered and exported by a program."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace as replace_struct
from PIL import Image

import clipgstream
from app.document.changes.edit_words import n_picked
from app.document.changes.note_changes import put_marker
from app.project.opening.project_access import create_project, default_settings, open_project
from app.project.project import Project
from app.scripting.scripted_project import ScriptedProject, open_scripted
from engine.capture.capture import open_capture
from engine.editing.actions import Delete, Expose, Hide
from engine.editing.edit import Picked, PickedRows, Scope, Sphere
from engine.editing.picks import pack_rows
from engine.errors import CaptureError, ProjectError, TrainingError
from tests.app.conftest import inline
from tests.app.fakes import N_ANCHORS, N_STEPS, make_fake
from tests.app.residuals.conftest import make_project

BALL = Sphere((0.0, 0.0, 0.0), 1.0)


@pytest.fixture
def untrained(tmp_path: Path, capture_folder: Path) -> Path:
    """A project in clips of three frames."""
    create_project(tmp_path / "p", default_settings(open_capture(capture_folder), clip_length=3)).close()
    return tmp_path / "p"


@pytest.fixture
def trained(tmp_path: Path) -> Path:
    return make_project(tmp_path)


def opened(folder: Path, make_training=make_fake, **options) -> ScriptedProject:
    return open_scripted(folder, launch=partial(inline, make_training=make_training), **options)


def test_clips_are_trained_one_after_the_other(untrained):
    told = []
    with opened(untrained) as project:
        assert [(clip.start, clip.stop) for clip in project.clips] == [(0, 3), (3, 6)]
        with pytest.raises(ProjectError, match="needs the reference clip 0, which is not trained"):
            project.train_clip(1)
        assert project.train_clip(0, on_progress=told.append).state == "trained"
        assert project.train_clip(0).state == "skipped"
        assert project.train_clip(1).step == N_STEPS
        assert project.trained_clips == [0, 1]
        again = project.train_clip(1, is_again=True, settings={"joint_steps": 3})
        assert (again.state, again.step) == ("trained", 3)
        with pytest.raises(ProjectError, match="All clips of a project share"):
            project.train_clip(1, is_again=True, settings={"gate": "off"})
        with pytest.raises(ProjectError, match="There is no clip 2; clips are 0 to 1"):
            project.train_clip(2)
    assert max(status.step for status in told) > 0
    open_project(untrained).close()  # the lock is free


def test_what_fails_is_an_error_and_the_project_stays_usable(untrained):
    with opened(untrained) as project:
        with pytest.raises(TrainingError, match="loss became nan"):
            project.train_clip(0, settings={"static_steps": 2})
        assert project.train_clip(0, is_again=True, settings={"joint_steps": 4}).state == "trained"


def test_who_has_seen_enough_stops_a_training(untrained):
    class Enough(Exception):
        pass

    def tell(status) -> None:
        if status.step >= 2:
            raise Enough

    with opened(untrained) as project:
        with pytest.raises(Enough):
            project.train_clip(0, on_progress=tell)
        assert project.trained_clips == []
        assert project.train_clip(0).state == "trained"


def test_edits_are_steps_that_can_be_taken_back(trained):
    with opened(trained) as project:
        assert project.undo() == ""
        first = project.apply_edit(Delete(), BALL, scope=Scope(0, 2), name="the lamp")
        second = project.apply_edit("expose", stops=0.5)
        third = project.apply_edit("isolate", BALL, scope=project.scope_of_clip(1))
        assert [edit.edit_id for edit in project.edits] == [1, 2, 3] == [e.edit_id for e in (first, second, third)]
        assert second.action == Expose(0.5)
        assert (third.action, third.is_inverted, third.scope) == (Hide(), True, Scope(3, 6))
        project.switch_edit(1, is_on=False)
        project.move_edit(3, 0)
        project.remove_edit(2)
        assert [(edit.edit_id, edit.is_on) for edit in project.edits] == [(3, True), (1, False)]
        assert project.undo() == "remove edit: expose everything by +0.5 EV"
        assert project.undo() == "reorder edit: crop to sphere of radius 1"
        assert [edit.edit_id for edit in project.edits] == [1, 2, 3]
        assert project.redo() == "reorder edit: crop to sphere of radius 1"
        project.replace_edit(replace_scope(first))
        kept = project.document
    assert open_project(trained, is_writable=False).document == kept


def replace_scope(edit):
    from msgspec import structs

    return structs.replace(edit, scope=Scope(4))


def test_what_cannot_be_an_edit(trained):
    with opened(trained) as project:
        flat: Any = (1.0, 2.0)
        wrong: Any = (
            (("explode",), {}, "no edit 'explode'. Edits are hide"),
            (("expose",), {}, "no stops"),
            (("expose",), {"stops": 99.0}, "stops is 99.0; it has to be a number between -16 and 16"),
            (("expose",), {"stops": "much"}, "not a number"),
            (("hide",), {"stops": 1.0}, "not known"),
            ((Delete(),), {"stops": 1.0}, "Delete is given together with 'stops'"),
            ((Delete(), Sphere(flat, 1.0)), {}, "is not valid"),
            ((Delete(), 3), {}, "is not valid"),
        )
        for arguments, values, message in wrong:
            with pytest.raises(ProjectError, match=message):
                project.apply_edit(*arguments, **values)
        with pytest.raises(ProjectError, match="no edit 7"):
            project.remove_edit(7)
        assert project.edits == ()


def test_the_document_is_changed_by_functions_and_by_plain_data(trained):
    with opened(trained) as project:
        project.change(put_marker(project.document, 2, "he jumps"), "mark a frame")
        project.put({"labels": [{"kind": "clip", "name": "0", "text": "first"}]})
        assert [marker.text for marker in project.document.markers] == ["he jumps"]
        assert project.undo() == "change labels"
        for entries, message in (
            ({"lables": []}, "lables"),
            ({"markers": [{"frame_index": -1, "text": ""}]}, "frame_index is -1"),
            ({"settings": {}}, "settings has no capture"),
        ):
            with pytest.raises(ProjectError, match=message):
                project.put(entries)
        fixed = replace(project.document, settings=replace(project.document.settings, clip_length=2))
        with pytest.raises(ProjectError, match="fixed once one is finished"):
            project.change(fixed, "change the clip length")


def test_reading_only(trained):
    with opened(trained) as writing:
        with pytest.raises(ProjectError, match="open"):
            opened(trained)
        with opened(trained, read_only=True) as project:
            assert project.trained_clips == [0, 1]
            assert not project.is_writable
            for forbidden in (
                lambda: project.apply_edit("delete", BALL),
                lambda: project.train_clip(0),
                lambda: project.change(project.document, "x"),
            ):
                with pytest.raises(ProjectError, match="read-only") as caught:
                    forbidden()
                assert caught.value.hint == "It was opened read-only. Open it for writing to change something."
        assert writing.is_writable
    with pytest.raises(ProjectError, match="closed"):
        writing.apply_edit("delete", BALL)
    writing.close()


def test_edits_that_act_in_some_frames_only_say_so(trained):
    told: list[str] = []
    with opened(trained) as project:
        own = project.open_trained().header(1).origin
        picked = Picked((PickedRows(1, own, "residual", pack_rows(np.arange(3))),))
        with pytest.raises(ProjectError, match=r"can never act \(frames 0-2\): the selection exists in frames 3-5"):
            project.apply_edit("delete", picked, scope=project.scope_of_clip(0))
        with pytest.raises(ProjectError, match=r"can never act \(from 6 on\): the capture has frames 0-5"):
            project.apply_edit("delete", BALL, scope=Scope(6))
        assert project.edits == ()
        with pytest.warns(UserWarning, match="Acts in frames 3-5 only"):
            edit = project.apply_edit("delete", picked)
        assert project.reaches[edit.edit_id].acts == ((3, 6),)
        project.replace_edit(replace_struct(edit, scope=Scope(0, 2)), on_note=told.append)
        assert told == ["The edit can never act (frames 0-1): the selection exists in frames 3-5 only."]
    Path(project.document.settings.capture).rename(trained.parent / "gone")
    with opened(trained) as project:  # which is nothing to an edit
        project.apply_edit("delete", picked, scope=Scope(0, 2))
        assert project.reaches[2].acts == ()


def test_pictures_and_files(trained, tmp_path):
    told = []
    with opened(trained, read_only=True) as project:
        done = project.render(tmp_path / "pictures", camera="1", frames=range(2, 5), on_progress=told.append)
        assert (done.n_files, done.path) == (3, tmp_path / "pictures")
        files = project.export(tmp_path / "o", format="spz", frames=range(1, 6, 2), axes="rub")
        assert files.n_files == 4
        table = project.export(tmp_path / "t.csv", format="metrics-csv")
        assert table.n_files == 1
        with pytest.raises(ProjectError, match="already taken"):
            project.export(tmp_path / "o")
        with pytest.raises(ProjectError, match="frames without gaps"):
            project.render(tmp_path / "x", camera="1", frames=range(0, 6, 2))
        with pytest.raises(ProjectError, match="no option 'colour'"):
            project.render(tmp_path / "x", camera="1", colour="red")
        with pytest.raises(ProjectError, match="'ply' is not a format"):
            project.render(tmp_path / "x", camera="1", format="ply")
    assert told[-1].n_done == told[-1].n_all == 3
    assert np.asarray(Image.open(sorted((tmp_path / "pictures").iterdir())[0])).shape == (32, 48, 3)
    assert not (tmp_path / "x").exists()


def test_an_export_ends_where_it_is_not_wanted_any_more(trained, tmp_path):
    def tell(progress) -> None:
        raise KeyError("enough")

    with opened(trained, read_only=True) as project, pytest.raises(KeyError):
        project.export(tmp_path / "o", on_progress=tell)
    assert not (tmp_path / "o").exists()


def test_the_functions_take_a_folder_or_an_open_project(trained, tmp_path):
    edit = clipgstream.apply_edit(trained, "delete", BALL)
    with clipgstream.open_project(trained) as project:
        clipgstream.apply_edit(project, Delete(), BALL)
        assert [found.edit_id for found in project.edits] == [edit.edit_id, edit.edit_id + 1]
        assert clipgstream.undo(project) == "delete sphere of radius 1"
        assert clipgstream.redo(project) == "delete sphere of radius 1"
        clipgstream.change(project, put_marker(project.document, 1), "mark")
    assert clipgstream.render(trained, tmp_path / "a", camera="1", frames=range(1)).n_files == 1
    assert clipgstream.export(trained, tmp_path / "b", format="splat", frames=range(1)).n_files == 2
    assert clipgstream.train_clip(trained, 0).state == "skipped"
    assert set(clipgstream.__all__) <= set(dir(clipgstream))


def test_what_does_not_open(tmp_path, trained):
    with pytest.raises(ProjectError, match="no such folder"):
        clipgstream.open_project(tmp_path / "nothing")
    with open_scripted(trained) as project:
        moved = replace(project.document.settings, capture=str(tmp_path / "gone"))
        plain: Project = project._project
        plain.happen(clipgstream_changed(project, moved))
        with pytest.raises(CaptureError):
            _ = project.clips


def clipgstream_changed(project: ScriptedProject, settings):
    from app.document.history import Changed

    return Changed("move the capture", replace(project.document, settings=settings))


@pytest.mark.slow
def test_a_training_whose_process_dies(untrained):
    with open_scripted(untrained, launch=_crashing) as project:
        with pytest.raises(TrainingError, match="ended by signal 9"):
            project.train_clip(0)
        assert project.trained_clips == []


def _crashing(job, project):
    from app.training.process import ProcessWorker

    return ProcessWorker(job, project, "tests.app.fakes:make_crashing")


def test_gaussians_are_picked_by_place_and_attribute(trained):
    with opened(trained) as project:
        everything = project.select()
        n_all = n_picked(everything)
        ball = project.select(volume=Sphere((0.0, 0.0, 0.0), 0.5))
        rest = project.select(volume=Sphere((0.0, 0.0, 0.0), 0.5), is_inverted=True)
        assert 0 < n_picked(ball) < n_all
        assert n_picked(ball) + n_picked(rest) == n_all
        assert n_picked(project.select("opacity>=0 and motion=static")) == n_all
        assert n_picked(project.select("clip=1", frame_index=4)) == N_ANCHORS
        assert project.select("birth=born, clip>0", frame_index=4) == project.select("clip=1", frame_index=4)
        edit = project.apply_edit("delete", ball)
        assert project.select() == rest  # as edits have left them
        project.switch_edit(edit.edit_id, is_on=False)
        for where, frame_index, message in (
            ("opacity<0", 0, "Nothing is selected in frame 0"),
            ("opacity", 0, "The condition 'opacity' is not valid. Write opacity<0.05; attributes are opacity, size"),
            ("error>3", 0, "There is no attribute 'error' to select by"),
            ("size=large", 0, "'large' is not a value of size. Write a number."),
            ("motion=fast", 0, "Write a number or one of static, moving."),
            ("size>nan", 0, "not a value of size"),
            ("", 9, "There is no frame 9; the capture has frames 0 to 5."),
        ):
            with pytest.raises(ProjectError) as error:
                project.select(where, frame_index=frame_index)
            assert message in str(error.value)


def test_what_is_deleted_goes_for_good(trained):
    with opened(trained) as project:
        with pytest.raises(ProjectError):
            project.apply_permanently()
        project.apply_edit("delete", Sphere((0.0, 0.0, 0.0), 0.5))
        assert project.apply_permanently() == (0, 1)
        n_left = n_picked(project.select())
        assert project.edits == ()
        project.restore_version(0, 1)
        assert n_picked(project.select()) > n_left
        with pytest.raises(ProjectError, match="no version 9"):
            project.restore_version(0, 9)


@pytest.mark.slow
def test_what_cannot_be_mended(trained):
    with opened(trained) as project:
        wrong: Any = ({}, {"boundary": 1, "frames": range(3)}, {"frames": range(0, 6, 2)})
        for arguments in wrong:
            with pytest.raises(ProjectError, match="Name what to mend"):
                project.mend(**arguments)
        with pytest.raises(ProjectError):
            project.mend(boundary=7)


def test_what_was_behind_is_filled_and_undone(trained, run):
    with opened(trained) as project:
        edit = project.apply_edit("delete", Sphere((0.0, 0.0, 0.0), 0.5))
        before, told = project.document, []
        figures = project.fill(edit.edit_id, lambda done, total: told.append(done / total))
        assert told[-1] == 1.0
        assert project.edits[0].fill is not None
        filled = project.document
        assert project.undo() == "fill behind: delete sphere of radius 0.5"
        assert project.document == before
        project.redo()
        assert project.document == filled
        with pytest.raises(ProjectError, match="There is no edit 9"):
            project.fill(9)
    with opened(trained, read_only=True) as project:
        assert project.document == filled, "as it was kept"
    code, out, err = run("edit", trained, "--fill", edit.edit_id)
    assert code == 0
    assert f"{figures.n_gaussians} Gaussians" in err
    assert "fill" in out
