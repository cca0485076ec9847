"""How fast trained clips are rendered: what the times come to, what is kept, and what is said without OpenGL."""

import json
import sys
from pathlib import Path

import pytest

from app.evaluation.evaluation import EVALUATIONS
from app.evaluation.headless import TrainedProject, open_trained
from app.evaluation.speed import window_drawing
from app.evaluation.speed.frame_rates import RATES_FILE, FrameRates, frame_rates, kept_rates
from app.evaluation.speed.laps import ENOUGH_LAPS, ENOUGH_S, Lap, RenderRate, camera_of, enough, frames_of, rate_of
from app.evaluation.speed.window_drawing import WindowLaps, draw_with, drawn_laps, read_said, said_by
from app.project.opening.project_access import open_project
from tests.app.fakes import write_capture
from tests.app.lab.report.made_up import change_header, train

HEADER = {"camera_names": [], "near_plane": 0.1, "spacing": 0.2}
DRAWN = WindowLaps([Lap(0.01, 0.03, 500), Lap(0.01, 0.03, 700), Lap(0.02, 0.06, 600)], "a card")


class Clock:
    """Ten milliseconds pass between two looks."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        self.now_s += 0.01
        return self.now_s


@pytest.fixture
def opened(tmp_path: Path) -> TrainedProject:
    project = train(tmp_path / "p", write_capture(tmp_path / "ring", n_cameras=4, size=(48, 32)))
    for path in (project / "clips").iterdir():
        change_header(path, **HEADER)
    return open_trained(open_project(project, is_writable=False))


def kept_file(opened: TrainedProject) -> Path:
    return opened.project.folder / EVALUATIONS / RATES_FILE


# ---------------------------------------------------------------- laps


def test_a_rate_is_of_medians_over_laps():
    rate = rate_of(DRAWN.laps, "a card")
    assert rate is not None
    assert (rate.fps, rate.fps_drawing) == (pytest.approx(25.0), pytest.approx(1 / 0.03))
    assert (rate.n_gaussians, rate.n_laps, rate.drawn_by) == (600, 3, "a card")
    assert rate_of([], "nothing") is None
    assert rate_of([Lap(0.0, 0.0, 5)], "a clock that stands still") is None


def test_slow_pictures_are_rendered_until_it_is_known_well_enough():
    slow, quick = [Lap(0.0, ENOUGH_S, 1)] * 9, [Lap(0.0, ENOUGH_S / 100, 1)] * 9
    assert len(list(enough(slow))) == ENOUGH_LAPS
    assert len(list(enough(quick))) == 9
    assert list(enough([])) == []


def test_pictures_are_of_a_held_out_camera_and_of_frames_of_the_first_and_the_last_clip(opened):
    assert opened.capture.rig.names[camera_of(opened)] == opened.project.settings.holdout[0]
    assert frames_of(opened) == {0: [2, 0, 1, 2], 1: [5, 3, 4, 5]}


# ---------------------------------------------------------------- measuring and keeping


def test_rates_say_what_they_are_of(opened):
    rates = frame_rates(opened, clock=Clock(), draw=lambda folder: DRAWN)
    assert (rates.camera, rates.size) == (opened.project.settings.holdout[0], "48 x 32")
    assert rates.cpu is not None
    assert (rates.cpu.fps, rates.cpu.fps_drawing) == (pytest.approx(50.0), pytest.approx(100.0))
    assert (rates.cpu.n_laps, rates.cpu.drawn_by.split(",")[0]) == (6, "CPU rasterizer")
    assert rates.cpu.n_gaussians > 0
    assert rates.gl is not None
    assert rates.gl.drawn_by == "OpenGL, a card"
    assert rates.figures() == {
        "fps_cpu": pytest.approx(50.0),
        "fps_gl": pytest.approx(25.0),
        "n_gaussians": rates.cpu.n_gaussians,
    }
    for part in ("48 x 32 px", "50.0 FPS by CPU rasterizer", "25.0 FPS by OpenGL, a card", "600 Gaussians"):
        assert part in rates.words()


def test_what_was_measured_is_not_measured_again_until_a_clip_changes(opened):
    assert kept_rates(opened) is None
    first = frame_rates(opened, clock=Clock(), draw=lambda folder: DRAWN)
    assert kept_rates(opened) == first
    assert frame_rates(opened, clock=lambda: 0.0, draw=lambda folder: WindowLaps([], "")) == first
    change_header(opened.project.clip_path(1), fingerprint="another")
    again = open_trained(opened.project)
    assert kept_rates(again) is None
    assert frame_rates(again, clock=Clock(), draw=lambda folder: DRAWN) == first


def test_without_opengl_the_reason_stands_there_and_it_is_tried_again(opened):
    rates = frame_rates(opened, clock=Clock(), draw=lambda folder: WindowLaps([], "", "no driver"))
    assert rates.cpu is not None
    assert (rates.gl, rates.why_no_gl) == (None, "no driver")
    assert rates.figures()["fps_gl"] is None
    assert "none by OpenGL: no driver" in rates.words()
    later = frame_rates(opened, clock=lambda: 0.0, draw=lambda folder: DRAWN)
    assert later.cpu == rates.cpu  # kept
    assert later.gl is not None
    assert later.why_no_gl == ""


@pytest.mark.parametrize("damage", [b"", b"{", b'{"key": 1}', b"\xff" * 40])
def test_a_damaged_file_is_measured_again(opened, damage):
    first = frame_rates(opened, clock=Clock(), draw=lambda folder: DRAWN)
    kept_file(opened).write_bytes(damage)
    assert kept_rates(opened) is None
    assert frame_rates(opened, clock=Clock(), draw=lambda folder: DRAWN) == first
    assert kept_rates(opened) == first


def test_a_project_that_cannot_be_written_to_is_measured_all_the_same(opened):
    (opened.project.folder / EVALUATIONS).touch()  # as root, rights alone keep nobody from writing
    assert frame_rates(opened, clock=Clock(), draw=lambda folder: DRAWN).gl is not None


def test_figures_are_not_touched_by_times(opened):
    """Figures of clips are the same in every run; frame rates have a file of their own."""
    frame_rates(opened, clock=Clock(), draw=lambda folder: DRAWN)
    assert [path.name for path in (opened.project.folder / EVALUATIONS).iterdir()] == [RATES_FILE]


# ---------------------------------------------------------------- the program that draws


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Makes a module the program that draws; gives what it said."""

    def draw(source: str) -> WindowLaps:
        (tmp_path / "made_up_drawing.py").write_text(source)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        monkeypatch.setattr(window_drawing, "_module", "")
        draw_with("made_up_drawing")
        return drawn_laps(tmp_path / "a project")

    return draw


def test_what_another_program_says_is_read(program):
    said = json.dumps(said_by(DRAWN))
    assert program(f"import sys\nprint('a driver says hello', sys.argv[1])\nprint({said})") == DRAWN


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("raise SystemExit(7)", "ended with code 7"),
        ("import os; os.abort()", "ended with code"),
        ("print('hello')", "nothing readable"),
        ("pass", "nothing readable"),
        ('print(\'{"laps": [["a", 1, 2]], "renderer": "", "reason": ""}\')', "nothing readable"),
    ],
)
def test_a_program_that_fails_costs_the_laps_only(program, source, expected):
    drawn = program(source)
    assert drawn.laps == []
    assert expected in drawn.reason


def test_a_program_that_hangs_is_ended(program, monkeypatch):
    monkeypatch.setattr(window_drawing, "TIME_LIMIT_S", 0.3)
    assert "took more than" in program("import time; time.sleep(60)").reason


def test_without_a_window_s_program_nothing_is_drawn(monkeypatch, tmp_path):
    monkeypatch.setattr(window_drawing, "_module", "")
    assert drawn_laps(tmp_path) == WindowLaps([], "", "this program has no window")
    monkeypatch.setattr(window_drawing, "_module", "anything")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "nothing here"))
    assert "could not be started" in drawn_laps(tmp_path).reason


def test_said_and_read_are_the_same():
    assert read_said(said_by(DRAWN)) == DRAWN
    assert read_said(said_by(WindowLaps([], "", "no driver"))) == WindowLaps([], "", "no driver")


def test_rates_without_a_figure_say_so():
    rates = FrameRates("0", 4, 3, None, RenderRate(1.0, 2.0, 3, 4, "OpenGL, a card"))
    assert rates.figures() == {"fps_cpu": None, "fps_gl": 1.0, "n_gaussians": None}
