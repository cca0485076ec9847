"""Exports as one file over time: they look like the scene, say what is lost, and leave nothing behind."""

from __future__ import annotations

import io
import sys
import wave
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.changes.world_changes import set_scale
from app.evaluation.headless import TrainedProject, open_trained
from app.export.expected_rows import expected_rows
from app.export.export_choices import ExportChoices
from app.export.export_progress import ExportProgress
from app.export.gaussians import read_back
from app.export.jobs.answers import Answers
from app.export.jobs.sequence import SequenceJob
from app.export.picked_frames import PickedFrames
from app.export.scene_frames import SceneFrames
from app.export.sequences import sequence_job, take_sound
from app.export.sequences.scene_stretches import SceneStretches
from app.export.sequences.sequence_job import estimate, run
from app.export.take import TakeFrame, take_frames
from app.project.opening.project_access import open_project
from engine.children.kind import Unwanted
from engine.clip_files.array_names import CORRECTIONS
from engine.clip_files.clip_state import write_clip_state
from engine.errors import CaptureError, DiskError, ProjectError
from engine.export.sequences.sequence import SequenceTiming
from engine.export.sequences.table import SEQUENCES
from engine.export.splats import Splats
from engine.export.world import FileWorld
from engine.model.clip_view import View, render_gaussians
from engine.raster.gaussians import Gaussians
from engine.setting import settings_of
from engine.timing.timing import SourceMoment
from tests.app.export.test_export_choices import CONTEXT
from tests.app.stored_project import copy_stored
from tests.engine.export.made_sequence import FPS, N_FRAMES, MadeSequence
from tests.engine.synchronisation.made_recordings import write_sound_video
from tests.faults.full_disk import can_mount, full_disk


def quiet(progress: ExportProgress) -> None:
    """Nothing is told."""


@pytest.fixture
def stored(tmp_path: Path) -> TrainedProject:
    """A real training, in which things move: frames 0 to 5."""
    return open_trained(open_project(copy_stored(tmp_path / "stored"), is_writable=False))


@pytest.mark.slow
@pytest.mark.parametrize("name", SEQUENCES)
def test_every_format_holds_all_frames_and_looks_like_them(opened: TrainedProject, tmp_path: Path, name: str):
    kind = SEQUENCES[name]
    out = tmp_path / f"scene{kind.suffix}"
    expected = estimate(opened, SequenceJob(out, name))
    assert set(kind.limits) <= set(expected.lines)
    result = run(opened, SequenceJob(out, name, PickedFrames.of(range(1, 6, 2)), up="+z", scale=2.0), quiet)
    assert result.psnr_db is not None
    assert result.psnr_db >= kind.min_psnr_db
    assert (result.path, result.n_files, result.n_bytes) == (out, 1, out.stat().st_size)
    assert list(tmp_path.glob("*scene*")) == [out]
    with closing(kind.open(out)) as reader:
        assert reader.timing.n_frames == 3
        assert reader.timing.fps == opened.capture.fps / 2
        live, found = SceneFrames(opened).gaussians(3), reader.splats(1)
        size = np.ptp(live.means.numpy(), axis=0).max()
        assert np.ptp(found.means, axis=0).max() > 1.2 * size
    assert any("+z is up, 2 units" in line for line in result.lines)


def test_frames_come_as_stretches_with_ids(stored: TrainedProject):
    scene = SceneFrames(stored)
    told: list[int] = []
    stretches = SceneStretches(scene, take_frames(scene, None, has_timing=True), FileWorld(), told.append)
    parts = [(one.first_frame, one.n_frames) for one in stretches]
    assert parts == [(0, 3), (3, 3)]
    for one in stretches:
        for frame in range(one.first_frame, one.first_frame + one.n_frames):
            moving = one.moving(frame)
            assert len(np.unique(moving.ids)) == len(moving.ids) == len(moving.splats)
            assert len(moving.splats) + len(one.still) == len(Splats.of(scene.gaussians(frame)))
    assert told == list(range(6))


def test_moments_that_fade_are_both_there_and_light_that_changes_moves(
    stored: TrainedProject, monkeypatch: pytest.MonkeyPatch
):
    scene = SceneFrames(stored)
    fading = [
        TakeFrame(0, (SourceMoment(4),)),
        TakeFrame(1, (SourceMoment(4, 0.75), SourceMoment(5, 0.25))),
    ]
    (one,) = SceneStretches(scene, fading, FileWorld(), quiet_number)
    alone, both = one.moving(0), one.moving(1)
    assert len(both.splats) > len(alone.splats)
    assert len(np.unique(both.ids)) == len(both.ids)
    assert np.isin(alone.ids, both.ids).all()

    whole = len(one.still)
    gaussians = scene.gaussians

    def lit(frame: float, part: str = "all") -> Any:
        found = gaussians(frame, part)  # type: ignore[arg-type]
        if part == "static":
            found.colors[:7] = 0.1 * frame
        return found

    monkeypatch.setattr(scene, "gaussians", lit)
    frames = [TakeFrame(frame, (SourceMoment(frame),)) for frame in range(3)]
    (one,) = SceneStretches(scene, frames, FileWorld(), quiet_number)
    assert len(one.still) == whole - 7
    moving = one.moving(2)
    assert (moving.ids < 0).sum() == 7
    np.testing.assert_allclose(moving.splats.colors[moving.ids < 0], 0.2)


def quiet_number(n_done: int) -> None:
    """Nothing is told."""


def test_wrong_wishes_are_refused_and_nothing_is_written(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    wrong = (
        (SequenceJob(tmp_path / "a.ply"), "has to end in .4dgs"),
        (SequenceJob(tmp_path / "a.4dgs", frames=PickedFrames.of(range(90, 91))), "There is no frame 90"),
        (SequenceJob(tmp_path / "a.usdc", "usd", sound="0"), "USD cannot hold sound"),
        (SequenceJob(opened.project.folder / "a.4dgs"), "inside the project"),
    )
    for job, words in wrong:
        with pytest.raises(ProjectError, match=words):
            run(opened, job, quiet)
    with pytest.raises(CaptureError, match="its frames are image files"):
        run(opened, SequenceJob(tmp_path / "a.4dgs", sound=opened.capture.rig.names[0]), quiet)
    monkeypatch.setitem(sys.modules, "pxr.Tf", None)
    with pytest.raises(ProjectError, match="usd-core"):
        estimate(opened, SequenceJob(tmp_path / "a.usdc", "usd"))
    assert list(tmp_path.glob("a*")) == []


def test_what_ends_early_or_is_not_valid_leaves_nothing(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def stop(progress: ExportProgress) -> None:
        if progress.n_done == 3:
            raise Unwanted

    out = tmp_path / "a.4dgs"
    with pytest.raises(Unwanted):
        run(opened, SequenceJob(out), stop)
    kind = SEQUENCES["4dgs"]._replace(problems=lambda path: ("it is upside down",))
    monkeypatch.setitem(sequence_job.SEQUENCES, "4dgs", kind)
    with pytest.raises(ProjectError, match="not valid: it is upside down"):
        run(opened, SequenceJob(out), quiet)
    assert list(tmp_path.glob("*4dgs*")) == []


@pytest.mark.slow
def test_a_file_that_looks_wrong_is_said(opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sequence_job.SEQUENCES, "4dgs", SEQUENCES["4dgs"]._replace(min_psnr_db=200.0))
    lines = run(opened, SequenceJob(tmp_path / "a.4dgs"), quiet).lines
    assert sum(line.startswith("Warning: of 5 frames") for line in lines) == 1


@pytest.mark.skipif(not can_mount(), reason="needs to mount a file system")
@pytest.mark.parametrize("name", SEQUENCES)
def test_a_full_disk_is_said(opened: TrainedProject, tmp_path: Path, name: str):
    (tmp_path / "disk").mkdir()
    with full_disk(tmp_path / "disk", 20_000) as disk:

        def fill(progress: ExportProgress) -> None:
            with suppress(OSError), (disk / "other").open("ab", buffering=0) as file:
                while progress.n_done == 0 and file.write(bytes(1 << 12)):
                    pass

        with pytest.raises(DiskError, match="No space left on device"):
            run(opened, SequenceJob(disk / f"a{SEQUENCES[name].suffix}", name), fill)
        assert [path.name for path in disk.iterdir()] == ["other"]


@pytest.mark.skipif(not can_mount(), reason="needs to mount a file system")
def test_a_file_needs_no_more_room_while_it_is_written(tmp_path: Path):
    write, timing, path = SEQUENCES["4dgs"].write, SequenceTiming(N_FRAMES, FPS), tmp_path / "made.4dgs"
    write(MadeSequence().stretches(), timing, path)
    (tmp_path / "disk").mkdir()
    with full_disk(tmp_path / "disk", path.stat().st_size * 5 // 4000) as disk:
        write(MadeSequence().stretches(), timing, disk / path.name)
        assert (disk / path.name).read_bytes() == path.read_bytes()


def test_files_say_how_long_their_unit_is(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    writable = open_project(project)
    writable.change(set_scale(writable.document, 0.25), "set the scale")
    writable.close()
    opened = open_trained(open_project(project, is_writable=False))
    told: list[float | None] = []

    def write(stretches: Any, timing: SequenceTiming, path: Path) -> tuple[str, ...]:
        told.append(timing.meters_per_unit)
        raise Unwanted

    monkeypatch.setitem(sequence_job.SEQUENCES, "4dgs", SEQUENCES["4dgs"]._replace(write=write))
    for scale in (None, 100.0):
        with pytest.raises(Unwanted):
            run(opened, SequenceJob(tmp_path / "a.4dgs", scale=scale), quiet)
    assert told == [1.0, 0.0025]


def test_help_and_window_say_which_way_is_up_in_each_format():
    said = settings_of(SequenceJob)["up"].usual
    for name, kind in SEQUENCES.items():
        assert (kind.up is not None) == (name in said.split(" in ")[-1].split(", "))
        choices = ExportChoices(kind="sequence").with_answer("format", name)
        (up,) = [one for one in Answers(CONTEXT, choices).questions if one.name == "up"]
        assert up.values[0][0] == up.chosen(choices) == ""
        assert ("+y" in up.values[0][1]) == (kind.up == "+y")


def test_refined_cameras_are_corrected_once(opened: TrainedProject, monkeypatch: pytest.MonkeyPatch):
    state = opened.reference
    assert state is not None
    values = np.tile(
        np.array([0.01, -0.02, 0.03, 0.1, 0.2, -0.1, 0.05], np.float32), (len(state.header.camera_names), 1)
    )
    write_clip_state(opened.project.clip_path(0), replace(state, arrays={**state.arrays, CORRECTIONS: values}))
    refined = open_trained(opened.project)
    seen: list[View] = []

    def looked_at(gaussians: Gaussians, view: View, *, backend: Any) -> Any:
        seen.append(view)
        return render_gaussians(gaussians, view, backend=backend)

    monkeypatch.setattr(read_back, "render_gaussians", looked_at)
    scene = SceneFrames(refined)
    live = scene.gaussians(1)
    figures = read_back.ReadBack(scene, FileWorld()).psnr_db(Splats.of(live), 1, live)
    expected = [refined.rig.world_to_camera[refined.rig.names.index(name)] for name in figures for _ in range(2)]
    assert len(seen) == len(expected) == 6
    for view, pose in zip(seen, expected, strict=True):
        np.testing.assert_allclose(view.world_to_camera.numpy(), pose, atol=1e-5)


def test_sound_is_that_of_the_frames(opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    rate, fps = take_sound.RATE, opened.capture.fps
    sound = np.zeros(rate)
    sound[round((0.3 + 2 / fps) * rate)] = 1.0
    write_sound_video(tmp_path / "loud.mp4", sound, n_frames=30)
    monkeypatch.setattr(
        take_sound, "sound_source", lambda capture, row, frame: (tmp_path / "loud.mp4", 0.3 + frame / fps)
    )
    camera = opened.capture.rig.names[0]
    job = SequenceJob(tmp_path / "s.4dgs", frames=PickedFrames.of(range(1, 5)), sound=camera)
    run(opened, job, quiet)
    with closing(SEQUENCES["4dgs"].open(job.out)) as reader:
        assert reader.timing.sound is not None
        with wave.open(io.BytesIO(b"".join(reader.timing.sound.pieces()))) as file:
            assert file.getnframes() == round(4 / fps * rate)
            samples = np.frombuffer(file.readframes(file.getnframes()), "<i2")[::2]
    assert abs(int(np.abs(samples).argmax()) - rate / fps) < 0.002 * rate
    with pytest.raises(ProjectError, match=r"lasts 7.0 hours; a WAV file holds 6.2"):
        take_sound.take_sound(opened.capture, camera, 0, None, 7 * 3600.0)
    gaps = SequenceJob(tmp_path / "g.4dgs", frames=PickedFrames((range(0, 2), range(4, 6)), 1), sound=camera)
    assert any("sound is left out" in line for line in estimate(opened, gaps).lines)


def test_still_parts_that_change_their_light_from_clip_to_clip_are_expected(stored: TrainedProject, tmp_path: Path):
    def expected(name: str, n_frames: int) -> int:
        job = SequenceJob(tmp_path / f"a{SEQUENCES[name].suffix}", name, PickedFrames.of(range(n_frames)))
        return estimate(stored, job).n_bytes

    n_still, n_moving = expected_rows(stored.header(0))  # of three frames; the other clip has as many
    for name, kind in SEQUENCES.items():
        more = expected(name, 6) - expected(name, 3)
        assert more == pytest.approx(
            kind.moving_bytes * n_moving * 3 + kind.still_again * kind.still_bytes * n_still, rel=0.2
        )
