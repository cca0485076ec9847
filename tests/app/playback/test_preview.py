"""The first cloud: built in a process of its own, shown before any training, and missed quietly."""

import numpy as np
import pytest
from safetensors.numpy import save_file

from app.background.jobs import JobCancelled, JobContext
from app.playback.preview import CloudJob, make_cloud, read_cloud
from engine.assets import asset_path
from engine.capture.capture import open_capture
from engine.errors import PreparationError, ProjectError
from tests.app.conftest import poll_until


@pytest.mark.slow
def test_the_cloud_of_a_capture_looks_like_the_capture(tiny_capture, tmp_path):
    capture = open_capture(tiny_capture)
    camera = capture.rig.names.index(capture.default_holdout[0])  # not used for the cloud, so that it says something
    said = []

    class Listening(JobContext):
        def report(self, done: float, message: str = "") -> None:
            super().report(done, message)
            said.append(message)

    path = make_cloud(CloudJob(tiny_capture, (camera,), tmp_path / "c.safetensors"), Listening("c"))
    assert said[0] == "starting a process"
    assert {"loading", "sweeping planes"} <= set(said)
    points, colors, _ = read_cloud(path)
    assert points.shape == colors.shape
    assert len(points) > 1000
    rig = capture.rig
    p_camera = points @ rig.world_to_camera[camera, :3, :3].T + rig.world_to_camera[camera, :3, 3]
    pixels = p_camera @ rig.Ks[camera].T
    pixels = pixels[:, :2] / pixels[:, 2:]
    width, height = rig.image_sizes[camera]
    is_seen = (p_camera[:, 2] > 0.3) & (pixels >= 0).all(1) & (pixels < [width, height]).all(1)
    assert is_seen.mean() > 0.2
    rows = pixels[is_seen].astype(int)
    truth = capture.frame(camera, 0)[rows[:, 1], rows[:, 0]] / 255
    error = np.abs(truth - colors[is_seen]).mean()
    shuffled = np.abs(truth - np.random.default_rng(0).permutation(colors[is_seen])).mean()
    assert error < 0.75 * shuffled  # most points lie where their colour is, some are hidden behind others


@pytest.mark.slow
def test_no_cloud_is_said_and_leaves_nothing(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(PreparationError, match=r"could not be built: .*empty"):
        make_cloud(CloudJob(tmp_path / "empty", (), tmp_path / "c.safetensors"), JobContext("c"))
    assert not (tmp_path / "c.safetensors").exists()


def test_a_cancelled_job_ends_its_process(tmp_path):
    context = JobContext("c")
    context.cancel()
    with pytest.raises(JobCancelled):
        make_cloud(CloudJob(asset_path("sample"), (), tmp_path / "c.safetensors"), context)


def test_a_first_cloud_takes_the_place_of_the_hint(make_session):
    session = make_session()
    poll_until(session, lambda: session.shown_points() is not None)
    assert session.shown_points().is_hint
    session.project.prep_dir.mkdir(exist_ok=True)
    points = np.zeros((5, 3), np.float32)
    save_file({"points": points, "colors": points + 0.5}, session.project.first_cloud_path)
    poll_until(session, lambda: not session.shown_points().is_hint)
    assert len(session.shown_points().points) == 5


def test_a_damaged_cloud_is_named(tmp_path):
    (tmp_path / "c.safetensors").write_bytes(b"no cloud")
    with pytest.raises(ProjectError, match=r"c\.safetensors"):
        read_cloud(tmp_path / "c.safetensors")
