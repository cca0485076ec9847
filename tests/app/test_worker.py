"""The worker process: trains, stops, dies, and holds nothing of the window."""

import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from app.session.showing.look_commands import SetFrame
from app.session.training.train_commands import PauseTraining, TrainNextClip
from app.training.process import ProcessWorker
from app.training.service import TrainingService
from app.training.worker.worker import n_training_threads
from engine.clip_files.clip_state import read_clip_state
from engine.kernels.cache import kernel_folder
from engine.kernels.threads import SPIN_COUNT
from tests.app.conftest import DEADLINE_S, poll_until
from tests.app.fakes import N_STEPS, make_crashing, make_fake, make_slow, make_telling

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def launch(make_training):
    return partial(ProcessWorker, make=f"tests.app.fakes:{make_training.__name__}")


def test_a_process_trains_a_clip(make_session):
    session = make_session(launch=launch(make_fake))
    session.dispatch(TrainNextClip())
    assert session.training.state == "starting"
    poll_until(session, lambda: session.training.state in ("idle", "failed"))
    assert session.clip_states[0].state == "trained", list(session.notices)
    assert read_clip_state(session.project.clip_path(0)).header.step == N_STEPS
    assert "trains clip 0" in session.project.log_path(0).read_text()


def test_a_log_that_is_a_pipe_or_a_link_holds_up_no_worker(make_session, tmp_path):
    session = make_session(launch=launch(make_fake))
    log = session.project.log_path(0)
    log.parent.mkdir()
    for make in (os.mkfifo, lambda path: path.symlink_to(tmp_path / "profile")):
        make(log)
        session.dispatch(TrainNextClip())
        poll_until(session, lambda: session.training.state in ("idle", "failed"))
        assert session.training.state == "idle", list(session.notices)
        assert "The log of the training could not be written" in [notice.title for notice in session.notices]
        log.unlink()
        log = session.project.log_path(1)
    assert not (tmp_path / "profile").exists()


def test_a_worker_chooses_the_folder_of_kernels_and_how_long_threads_spin(make_session, monkeypatch):
    for name in ("NUMBA_CACHE_DIR", "GOMP_SPINCOUNT"):
        monkeypatch.delenv(name, raising=False)
    session = make_session(launch=launch(make_telling))
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.state in ("idle", "failed"))
    found = json.loads((session.project.folder / "environment.json").read_text())
    assert found["NUMBA_CACHE_DIR"] == str(kernel_folder())
    assert found["GOMP_SPINCOUNT"] == str(SPIN_COUNT)


def test_a_killed_worker_is_told_and_training_goes_on_from_what_was_kept(make_session):
    session = make_session(launch=launch(make_slow))
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.step >= 1)
    session.dispatch(PauseTraining())  # writes a checkpoint
    kept = session.project.checkpoint_path(0)
    poll_until(session, kept.is_file, what="the checkpoint")
    step = read_clip_state(kept).header.step
    session.live_training.service.leading.worker.child.kill()
    poll_until(session, lambda: session.training.state == "failed")
    assert "signal 9" in session.notices[-1].detail
    assert session.clip_states[0].state == "failed"
    assert session.training.can_train_next
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.state == "running")
    assert session.training.step >= step


def test_a_worker_that_dies_while_starting_is_told(make_session):
    session = make_session(launch=launch(make_crashing))
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.state == "failed")
    assert session.notices[-1].title == "The training process ended unexpectedly"
    session.dispatch(SetFrame(2))  # the session goes on
    assert session.timeline.frame_index == 2


def test_closing_ends_the_process_and_keeps_what_it_learned(make_session, monkeypatch):
    # on a busy machine, keeping takes longer than the window waits
    monkeypatch.setitem(TrainingService.close.__kwdefaults__, "timeout_s", DEADLINE_S)
    session = make_session(launch=launch(make_slow))
    session.dispatch(TrainNextClip())
    poll_until(session, lambda: session.training.step >= 1)
    child = session.live_training.service.leading.worker.child
    project = session.project
    session.close()
    child.result()  # it was not killed
    assert read_clip_state(project.checkpoint_path(0)).header.step >= 1


PARENT = """
import os, sys
from pathlib import Path
from app.project.opening.project_access import create_project, default_settings
from app.training.jobs import train_job
from app.training.messages import StepReported
from app.training.process import ProcessWorker
from engine.capture.capture import open_capture

if __name__ == "__main__":
    capture, folder = Path(sys.argv[1]), Path(sys.argv[2])
    settings = default_settings(open_capture(capture))
    project = create_project(folder, settings)
    job = train_job(project, project.clips(6)[0])
    worker = ProcessWorker(job, project, "tests.app.fakes:make_slow")
    while not any(isinstance(event, StepReported) and event.step > 0 for event in worker.poll()):
        pass
    print(worker.child.pid, flush=True)
    os._exit(9)  # no goodbye, as when the window is killed
"""


def test_a_worker_whose_window_was_killed_keeps_what_it_learned_and_ends(tmp_path, capture_folder):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    # the worker inherits stdout only until it redirects it; its log is read to see its end
    done = subprocess.run(
        [sys.executable, str(script), str(capture_folder), str(tmp_path / "p")],
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
    )
    assert done.returncode == 9, done.stderr
    log = tmp_path / "p" / "logs" / "clip-0000.log"
    deadline = subprocess.run(  # waits for the end of a process that is not our child
        [sys.executable, "-c", WAIT_FOR_TEXT, str(log), "ends"], timeout=600, check=False
    )
    assert deadline.returncode == 0, log.read_text()
    assert read_clip_state(tmp_path / "p" / "checkpoints" / "0000.safetensors").header.step > 0


WAIT_FOR_TEXT = """
import sys, time
from pathlib import Path
until = time.monotonic() + 500
while not (Path(sys.argv[1]).is_file() and sys.argv[2] in Path(sys.argv[1]).read_text()):
    if time.monotonic() > until:
        sys.exit(1)
    time.sleep(0.05)
"""


@pytest.mark.parametrize(
    ("cores", "is_window_open", "expected"), [(1, True, 1), (2, True, 2), (3, True, 2), (16, True, 15), (16, False, 16)]
)
def test_a_core_is_left_to_the_window_where_there_are_more_than_two(cores, is_window_open, expected):
    assert n_training_threads(cores, is_window_open=is_window_open) == expected
