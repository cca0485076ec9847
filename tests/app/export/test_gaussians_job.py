"""Exports of Gaussians: which files, what is in them, what is said, and that nothing is left of what failed."""

from __future__ import annotations

import errno
import json
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec import structs

from app.document.changes import world_changes
from app.evaluation.headless import TrainedProject, open_trained
from app.export.export_progress import ExportProgress
from app.export.gaussians import gaussian_sequence, gaussians_job, read_back
from app.export.gaussians.gaussian_files import GaussianFile, base_name, moment_files, static_file
from app.export.gaussians.gaussians_job import GaussiansJob, estimate, run
from app.export.picked_frames import PickedFrames
from app.export.scene_frames import Part, SceneFrames
from app.project.opening.project_access import open_project
from engine.camera.projection import to_camera, to_pixels
from engine.children.kind import Unwanted
from engine.errors import DiskError, ProjectError
from engine.export.formats.table import FORMATS, Format
from engine.export.splats import Splats
from tests.engine.export.scenes import order_of
from tests.faults.full_disk import can_mount, full_disk


def quiet(progress: ExportProgress) -> None:
    """Nothing is told."""


def read(path: Path, name: str) -> Splats:
    with path.open("rb") as file:
        return FORMATS[name].read(file)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def sidecar(folder: Path) -> dict:
    return json.loads((folder / "p_export.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_holds_what_the_frame_decodes_and_looks_like_it(opened: TrainedProject, tmp_path: Path, name: str):
    out, suffix = tmp_path / "out", FORMATS[name].suffix
    result = run(opened, GaussiansJob(out, name, PickedFrames.of(range(1, 5))), quiet)
    assert names(out) == [*(f"p_{frame:04d}{suffix}" for frame in range(1, 5)), "p_export.json"]
    document = sidecar(out)
    assert result.psnr_db == document["psnr_db"]
    assert result.psnr_db is not None
    assert result.psnr_db >= FORMATS[name].min_psnr_db
    assert [row["psnr_db"] is not None for row in document["files"]] == [True, False, True, True]
    scene = SceneFrames(opened)
    for row in document["files"]:
        live = Splats.of(scene.gaussians(row["frame"]))
        found = read(out / row["file"], name)
        assert len(found) == len(live) == row["n_gaussians"]
        np.testing.assert_allclose(found.means, live.means[order_of(found, live)], atol=0.01)
    assert (result.n_files, result.n_bytes) == (5, sum(path.stat().st_size for path in out.iterdir()))


def test_the_document_says_what_the_files_are(opened: TrainedProject, tmp_path: Path):
    result = run(
        opened, GaussiansJob(tmp_path / "out", "spz", PickedFrames.of(range(0, 6, 2)), up="+z", scale=2.0), quiet
    )
    document = sidecar(tmp_path / "out")
    assert document["schema"] == 1
    assert (document["project"], document["first_frame"], document["last_frame"], document["n_frames"]) == (
        "p",
        0,
        4,
        3,
    )
    assert document["axes"] == "turned so that +z is up, 2 units per unit of the capture"
    assert document["up"] == [0.0, 0.0, 1.0]
    assert document["settings"] == {"format": "spz", "part": "all", "axes": "ply", "up": "+z", "scale": 2.0}
    assert document["min_psnr_db"] == 38.0
    assert set(document["files"][0]["psnr_db"]) == {"0", "2", "3"}  # cameras: the first, the last, one in the middle
    assert document["seconds"] >= 0
    assert document["lines"] == list(result.lines)
    assert result.lines[0] == "Coordinates: turned so that +z is up, 2 units per unit of the capture."


def test_a_scene_that_is_turned_and_scaled_still_measures_well(opened: TrainedProject, tmp_path: Path):
    job = GaussiansJob(tmp_path / "out", "ply", PickedFrames.of(range(2, 3)), up="+z", scale=3.0, axes="rub")
    assert (run(opened, job, quiet).psnr_db or 0) > 60
    found = read(tmp_path / "out" / "p.ply", "ply")
    live = Splats.of(SceneFrames(opened).gaussians(2))
    assert np.linalg.norm(found.means, axis=1) == pytest.approx(3 * np.linalg.norm(live.means, axis=1), rel=1e-4)
    np.testing.assert_allclose(found.scales, 3 * live.scales, rtol=1e-4)


def test_the_document_has_cameras_where_they_stand_in_the_files(opened: TrainedProject, tmp_path: Path):
    job = GaussiansJob(tmp_path / "out", frames=PickedFrames.of(range(1)), up="+z", scale=3.0)
    run(opened, job, quiet)
    document, rig = sidecar(tmp_path / "out"), opened.rig
    assert [row["name"] for row in document["cameras"]] == list(rig.names)
    live = Splats.of(SceneFrames(opened).gaussians(0)).means
    written = read(tmp_path / "out" / "p.ply", "ply").means
    for camera, row in enumerate(document["cameras"]):
        assert row["image_size"] == rig.image_sizes[camera].tolist()
        pose = np.linalg.inv([*row["camera_to_world"], [0.0, 0.0, 0.0, 1.0]])
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-9)
        expected = to_pixels(to_camera(live, rig.world_to_camera[camera]), rig.Ks[camera])
        np.testing.assert_allclose(to_pixels(to_camera(written, pose), np.array(row["K"])), expected, rtol=1e-3)
    assert (document["near_plane"], document["meters_per_unit"]) == (pytest.approx(3.0 * 0.1), None)


def test_full_fields_are_read_back_and_measured_as_others(opened: TrainedProject, tmp_path: Path):
    job = GaussiansJob(tmp_path / "out", frames=PickedFrames.of(range(2, 3)), fields="full")
    result = run(opened, job, quiet)
    assert (result.psnr_db or 0) > 60
    path = tmp_path / "out" / "p.ply"
    assert b"property float f_rest_44\n" in path.read_bytes()[:4096]
    live = Splats.of(SceneFrames(opened).gaussians(2))
    np.testing.assert_array_equal(read(path, "ply").means, live.means)
    assert sidecar(tmp_path / "out")["settings"]["fields"] == "full"
    usual = estimate(opened, GaussiansJob(tmp_path / "o", frames=PickedFrames.of(range(2, 3))))
    assert estimate(opened, job).n_bytes == pytest.approx(usual.n_bytes * 248 / 56)
    wrongs: tuple[dict[str, Any], ...] = ({"format": "spz", "fields": "full"}, {"fields": "all"})
    for wrong in wrongs:
        with pytest.raises(ProjectError, match="ields"):
            run(opened, GaussiansJob(tmp_path / "x", **wrong), quiet)
    assert not (tmp_path / "x").exists()


def test_parts_are_the_whole(opened: TrainedProject, tmp_path: Path):
    run(opened, GaussiansJob(tmp_path / "split", "ply", PickedFrames.of(range(3)), part="split"), quiet)
    assert names(tmp_path / "split") == [
        *("p_export.json", "p_moving_0000.ply", "p_moving_0001.ply", "p_moving_0002.ply", "p_static.ply")
    ]
    run(opened, GaussiansJob(tmp_path / "all", "ply", PickedFrames.of(range(3))), quiet)
    still = read(tmp_path / "split" / "p_static.ply", "ply")
    for frame in range(3):
        moving = read(tmp_path / "split" / f"p_moving_{frame:04d}.ply", "ply")
        whole = read(tmp_path / "all" / f"p_{frame:04d}.ply", "ply")
        np.testing.assert_array_equal(np.concatenate([still.means, moving.means]), whole.means)
    run(opened, GaussiansJob(tmp_path / "static", "spz", None, part="static"), quiet)
    run(opened, GaussiansJob(tmp_path / "moving", "spz", PickedFrames.of(range(4, 5)), part="moving"), quiet)
    assert names(tmp_path / "moving") == ["p_export.json", "p_moving.spz"]


def test_what_stands_still_comes_again_where_it_changes(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    gaussians = SceneFrames.gaussians
    shown: list[str] = []

    def same(self: SceneFrames, frame: float, part: Part = "all"):
        shown.append(part)
        return gaussians(self, 0, part)

    monkeypatch.setattr(SceneFrames, "gaussians", same)
    run(opened, GaussiansJob(tmp_path / "same", "ply", None, part="static"), quiet)
    assert names(tmp_path / "same") == ["p_export.json", "p_static.ply"]
    monkeypatch.setattr(SceneFrames, "gaussians", gaussians)
    run(opened, GaussiansJob(tmp_path / "out", "ply", None, part="static"), quiet)
    assert names(tmp_path / "out") == ["p_export.json", "p_static_0000.ply", "p_static_0003.ply"]
    assert shown == ["static", "static"]  # once per clip
    assert [row["frame"] for row in sidecar(tmp_path / "out")["files"]] == [0, 3]


def test_names_are_those_of_sequences():
    assert moment_files("s", ".spz", [7], "all", 10) == [GaussianFile("s.spz", 7, "all")]
    assert [file.name for file in moment_files("s", ".ply", [5, 9], "moving", 10)] == [
        *("s_moving_0005.ply", "s_moving_0009.ply")
    ]
    assert moment_files("s", ".ply", [5, 12345], "all", 20_000)[0].name == "s_00005.ply"
    assert moment_files("s", ".ply", [1, 2], "static", 10) == []
    assert static_file("s", ".ply", None, 10).name == "s_static.ply"
    assert base_name("Überraschung 数 100%") == "Überraschung 数 100%"
    assert len(base_name("ü" * 400).encode()) <= 120
    assert base_name("..") == "scene"


def test_a_project_with_another_name_gives_it_to_its_files(project: Path, tmp_path: Path):
    from app.evaluation.headless import open_trained
    from app.project.opening.project_access import open_project

    renamed = project.rename(tmp_path / "Tänzer 数 100%s {x}")
    opened = open_trained(open_project(renamed, is_writable=False))
    run(opened, GaussiansJob(tmp_path / "out", "splat", PickedFrames.of(range(1))), quiet)
    assert names(tmp_path / "out") == ["Tänzer 数 100%s {x}.splat", "Tänzer 数 100%s {x}_export.json"]
    document = json.loads((tmp_path / "out" / "Tänzer 数 100%s {x}_export.json").read_text(encoding="utf-8"))
    assert document["project"] == "Tänzer 数 100%s {x}"


@pytest.mark.parametrize("part", ["all", "split", "moving", "static"])
def test_the_estimate_is_about_right(opened: TrainedProject, tmp_path: Path, part):
    job = GaussiansJob(tmp_path / "out", "ply", None, part=part)
    told = estimate(opened, job)
    result = run(opened, job, quiet)
    assert result.n_files <= told.n_files <= result.n_files + 1  # static parts of clips may be equal
    # 3 kB of headers and the document; other frames show fewer than the one with most
    assert told.n_bytes < 2 * result.n_bytes
    assert result.n_bytes < 2 * told.n_bytes + 6000


def test_frames_are_told_as_they_are_done_and_few_scenes_are_kept(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(gaussian_sequence, "_MOST_WRITERS", 1)
    told: list[ExportProgress] = []
    run(opened, GaussiansJob(tmp_path / "out", "ply"), told.append)
    assert [(progress.n_done, progress.n_all) for progress in told] == [(n, 6) for n in (0, *range(7))]


@pytest.mark.parametrize(("n_threads", "n_writers"), [(1, 1), (3, 3), (64, 4)])
def test_files_are_written_with_as_many_threads_as_the_process_may_use(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, n_threads: int, n_writers: int
):
    pools: list[int] = []

    class Pool(ThreadPoolExecutor):
        def __init__(self, max_workers: int, thread_name_prefix: str) -> None:
            pools.append(max_workers)
            super().__init__(max_workers, thread_name_prefix)

    monkeypatch.setattr(gaussians_job, "use_threads", lambda _: n_threads)
    monkeypatch.setattr(gaussian_sequence, "ThreadPoolExecutor", Pool)
    run(opened, GaussiansJob(tmp_path / "out", "ply", PickedFrames.of(range(2))), quiet)
    assert pools == [n_writers]


# ---------------------------------------------------------------- what goes wrong


def at_frame(n: int, act: Callable[[], None]) -> Callable[[ExportProgress], None]:
    """Do something when so many frames are done."""

    def report(progress: ExportProgress) -> None:
        if progress.n_done == n:
            act()

    return report


def cancel() -> None:
    raise Unwanted


def test_a_cancelled_export_leaves_nothing(opened: TrainedProject, tmp_path: Path):
    before = names(tmp_path)
    for n in (0, 3, 6):
        with pytest.raises(Unwanted):
            run(opened, GaussiansJob(tmp_path / "out", "spz"), at_frame(n, cancel))
        assert names(tmp_path) == before


def test_a_disk_that_fills_up_leaves_nothing(opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    before, n_written = names(tmp_path), 0

    def write(splats: Splats, file) -> tuple[str, ...]:
        nonlocal n_written
        n_written += 1
        file.write(b"half of it")
        if n_written > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        return FORMATS["ply"].write(splats, file)

    full: dict[str, Format] = {"ply": FORMATS["ply"]._replace(write=write, read=lambda file: SAMPLE)}
    SAMPLE = Splats.of(SceneFrames(opened).gaussians(0))
    monkeypatch.setattr("app.export.gaussians.gaussians_job.FORMATS", full)
    with pytest.raises(DiskError, match="No space left on device"):
        run(opened, GaussiansJob(tmp_path / "out"), quiet)
    assert names(tmp_path) == before


@pytest.mark.skipif(not can_mount(), reason="needs root, to mount a small disk")
def test_a_real_disk_that_somebody_fills_meanwhile(opened: TrainedProject, tmp_path: Path):
    (tmp_path / "disk").mkdir()
    with full_disk(tmp_path / "disk", 20_000) as disk:

        def fill() -> None:
            with suppress(OSError), (disk / "other").open("wb", buffering=0) as file:
                while file.write(bytes(1 << 12)):
                    pass

        with pytest.raises(DiskError, match="No space left on device"):
            run(opened, GaussiansJob(disk / "out"), at_frame(3, fill))
        assert names(disk) == ["other"]
        with pytest.raises(ProjectError, match="are free"):
            run(opened, GaussiansJob(disk / "out"), quiet)
        (disk / "other").unlink()
        run(opened, GaussiansJob(disk / "out"), quiet)
        assert len(names(disk / "out")) == 7


def test_untrained_clips_are_named_before_anything_is_made(opened: TrainedProject, tmp_path: Path):
    opened.project.clip_path(1).unlink()
    before = names(tmp_path)
    with pytest.raises(ProjectError, match="Frame 3 lies in clip 1, which is not trained") as error:
        run(opened, GaussiansJob(tmp_path / "out", frames=PickedFrames.of(range(6))), quiet)
    assert "--frames 0:3" in error.value.hint
    assert names(tmp_path) == before
    run(opened, GaussiansJob(tmp_path / "out"), quiet)  # all trained frames
    assert len(names(tmp_path / "out")) == 4


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"frames": range(4, 9)}, "There is no frame 6; the capture has frames 0 to 5"),
        ({"frames": range(0)}, "no frames"),
        ({"format": "obj"}, "Format is 'obj'; it has to be 'ply'"),
        ({"up": "up"}, "Up axis is 'up'"),
        ({"scale": 0.0}, "Scale is 0.0"),
        ({"scale": float("nan")}, "Scale is nan"),
        ({"scale": 1e30}, r"Scale is 1e\+30"),
        ({"format": "spz", "scale": 1e6}, None),
    ],
)
def test_bad_input_is_an_error_in_words(opened: TrainedProject, tmp_path: Path, change: dict, said: str | None):
    if said is None:
        job = GaussiansJob(tmp_path / "out", **change)
        assert any("larger than 379" in line for line in run(opened, job, quiet).lines)
        return
    with pytest.raises(ProjectError, match=said):
        run(opened, GaussiansJob(tmp_path / "out", **change), quiet)
    assert not (tmp_path / "out").exists()


def test_targets_that_are_taken_are_refused(opened: TrainedProject, tmp_path: Path):
    taken = tmp_path / "file.ply"
    taken.write_text("mine")
    for out, said in ((taken, "already taken"), (taken / "x", "is a file"), (tmp_path, "already taken")):
        with pytest.raises(ProjectError, match=said):
            run(opened, GaussiansJob(out), quiet)
    assert taken.read_text() == "mine"


def test_a_file_that_does_not_look_like_the_scene_is_a_warning(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def pale(file) -> Splats:
        found = FORMATS["ply"].read(file)
        found.colors[:] += 0.1
        return found

    monkeypatch.setattr("app.export.gaussians.gaussians_job.FORMATS", {"ply": FORMATS["ply"]._replace(read=pale)})
    result = run(opened, GaussiansJob(tmp_path / "out", frames=PickedFrames.of(range(1))), quiet)
    assert result.psnr_db is not None
    assert 10 < result.psnr_db < 50
    (warning,) = [line for line in result.lines if line.startswith("Warning")]
    assert "At least 50 dB were expected of .ply" in warning


def test_many_measured_files_are_one_line(opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(gaussian_sequence, "_MOST_LINES", 2)
    lines = run(opened, GaussiansJob(tmp_path / "out"), quiet).lines
    assert len(lines) == 2
    assert "p_0000.ply" in lines[1], "the worst"


def test_large_pictures_are_compared_smaller(opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(read_back, "LONGEST_SIDE_PX", 12)
    assert (run(opened, GaussiansJob(tmp_path / "out", frames=PickedFrames.of(range(1))), quiet).psnr_db or 0) > 60


def test_a_part_without_gaussians_is_written_and_said(
    opened: TrainedProject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    gaussians = SceneFrames.gaussians
    monkeypatch.setattr(SceneFrames, "gaussians", lambda self, frame, part: gaussians(self, frame, part)[:0])
    for name in FORMATS:
        result = run(opened, GaussiansJob(tmp_path / name, name, PickedFrames.of(range(2))), quiet)
        assert any("2 files hold no Gaussians" in line for line in result.lines)
        assert result.psnr_db == 100.0


def test_up_and_scale_are_those_of_the_project_unless_others_are_asked_for(project, tmp_path):
    writable = open_project(project)
    said = world_changes.set_scale(world_changes.set_up(writable.document, (1.0, 0.0, 0.0)), 0.25)
    writable.change(said, "set up and scale")
    writable.close()
    opened = open_trained(open_project(project, is_writable=False))
    job = GaussiansJob(tmp_path / "out", frames=PickedFrames.of(range(1)), up="+z")
    assert estimate(opened, job).lines == ("Coordinates: turned so that +z is up, 0.25 units per unit of the capture.",)
    run(opened, job, quiet)
    assert sidecar(tmp_path / "out")["up"] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert sidecar(tmp_path / "out")["meters_per_unit"] == 1.0
    other = structs.replace(job, out=tmp_path / "other", scale=2.0, scene_up=(0.0, 1.0, 0.0))
    assert "2 units per unit" in estimate(opened, other).lines[0]
    run(opened, other, quiet)
    assert sidecar(tmp_path / "other")["meters_per_unit"] == 0.125
