"""The panels' arithmetic and tables; no window, no GL."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from app.cli.commands import COMMANDS
from app.status import ClipStatus
from ui.main import main
from ui.panels.actions.key import parse_key
from ui.panels.actions.table import ACTIONS
from ui.panels.picture.panes import arrange, fit
from ui.panels.state import Rect
from ui.panels.training.clip_quality import clip_quality
from ui.panels.training.curves import MAX_PLOT_POINTS, plot_arrays, seen_part


def test_plot_arrays_are_contiguous_finite_and_short() -> None:
    history = [(step, float("nan") if step == 3 else 1.0 / (step + 1)) for step in range(5000)]
    steps, values = seen_part(*plot_arrays(history), (0.0, 5000.0))
    assert steps.flags.c_contiguous
    assert values.flags.c_contiguous
    assert len(steps) == len(values) == MAX_PLOT_POINTS
    assert np.isfinite(values).all()
    assert (steps[0], steps[-1]) == (0, 4999)
    assert plot_arrays([])[0].shape == (0,)


def test_quality_over_the_clips_is_of_those_that_were_measured() -> None:
    states = [
        ClipStatus("trained", 1.0, 31.0, exposure_change=0.0),
        ClipStatus("untrained"),
        ClipStatus("trained", 1.0, 29.5, exposure_change=0.031),
        ClipStatus("training", 0.4, 25.0),
        ClipStatus("stopped", 0.4, float("nan")),
    ]
    quality = clip_quality(states)
    assert quality.clips.tolist() == [0, 2, 3]
    assert quality.psnr.tolist() == [31.0, 29.5, 25.0]
    assert quality.title == "Quality over clips: ~25.0 to ~31.0 dB"
    whole = [ClipStatus("trained", 1.0, psnr, held_out_whole=True) for psnr in (29.0, 29.7, 29.2)]
    assert clip_quality(whole).title == "Quality over clips: 29.0 to 29.7 dB", "the range, not the first and the last"
    assert "up to 3.1 %" in quality.exposure_text
    assert "(clip 2)" in quality.exposure_text
    assert all(values.flags.c_contiguous for values in (quality.clips, quality.psnr, quality.exposure))
    assert clip_quality(states[:2]).title == ""
    assert "does not change" in clip_quality(states[:2]).exposure_text
    assert clip_quality([]).title == ""


def test_panes_keep_the_camera_s_aspect_and_do_not_overlap() -> None:
    area = Rect(0, 0, 1000, 500)
    for compare in ("off", "wipe", "side"):
        panes = arrange(area, (320, 240), compare)
        assert panes.rendered.width / panes.rendered.height == pytest.approx(320 / 240)
        assert (panes.captured is None) == (compare == "off")
    side = arrange(area, (320, 240), "side")
    assert side.captured is not None
    assert side.captured.x1 <= side.rendered.x0
    assert arrange(area, None, "off").rendered == area
    assert fit(area, 500, 500).width == pytest.approx(500)


def test_the_table_of_actions_is_complete_and_unambiguous() -> None:
    chords = [key.chord for action in ACTIONS for key in map(parse_key, action.keys)]
    assert len(set(chords)) == len(chords)
    assert len({action.id for action in ACTIONS}) == len(ACTIONS)
    assert all(action.text and action.group for action in ACTIONS)
    promised = {"Space", "Left", "Right", "Home", "End", "Up", "Down", "[", "]", "G", "Tab", "T", "F", "F1", "Ctrl+O"}
    assert promised <= {label for action in ACTIONS for label in action.keys}
    leaving = [action for action in ACTIONS if "Escape" in action.keys]
    assert all(action.needs_choosing for action in leaving), "at other times Escape ends nothing"


@pytest.mark.parametrize(
    ("label", "chord", "is_any_shift"),
    [
        ("Space", ("space", False, False, False), False),
        ("Ctrl++", ("equal", True, False, False), True),
        ("Ctrl+Shift+Z", ("z", True, True, False), False),
        ("Page Up", ("page_up", False, False, False), False),
        ("4", ("_4", False, False, False), False),
        ("Alt+[", ("left_bracket", False, False, True), False),
    ],
)
def test_keys_are_read_from_text(label: str, chord: tuple[str, bool, bool, bool], is_any_shift: bool) -> None:
    key = parse_key(label)
    assert (key.chord, key.is_any_shift, key.label) == (chord, is_any_shift, label)


@pytest.mark.parametrize("label", ["", "Ctrl+", "Hyper+X", "Ctrl+Ctrl+X", "mod_ctrl+", "count", "__class__"])
def test_text_that_names_no_key_is_refused(label: str) -> None:
    with pytest.raises(ValueError, match="does not name a key"):
        parse_key(label)


@pytest.mark.slow
@pytest.mark.parametrize("module", ["ui.main", "ui.__main__"])
def test_importing_the_entry_point_loads_no_torch_and_no_window(module: str) -> None:
    code = (
        f"import sys, {module}\n"
        "heavy = {'torch', 'numba', 'pyglet', 'moderngl', 'imgui_bundle', 'pycolmap', 'open3d'} & set(sys.modules)\n"
        "sys.exit(','.join(sorted(heavy)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
def test_the_window_itself_needs_no_torch() -> None:
    code = (
        "import sys, pyglet\n"
        "pyglet.options.headless = True\n"
        "import ui.shell.window\n"
        "sys.exit(','.join(sorted({'torch', 'numba', 'pycolmap', 'open3d'} & set(sys.modules))) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("command", COMMANDS)
def test_subcommands_go_to_the_command_line(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[list[str]] = []

    class FakeCli:
        @staticmethod
        def main(arguments: list[str]) -> int:
            seen.append(list(arguments))
            return 2

    monkeypatch.setitem(sys.modules, "app.cli.cli", FakeCli)
    assert main([command, "somewhere"]) == 2
    assert seen == [[command, "somewhere"]]


def test_without_a_display_the_demo_runs_instead(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[tuple[object, object, bool]] = []

    class FakeDemo:
        @staticmethod
        def run_demo(path: object, out: object, *, quick: bool) -> int:
            seen.append((path, out, quick))
            return 0

    monkeypatch.setitem(sys.modules, "ui.shell.demo", FakeDemo)
    monkeypatch.setattr("ui.main.has_display", lambda: False)
    assert main(["some_capture"]) == 0
    assert [str(path) for path, _, _ in seen] == ["some_capture"]


@pytest.mark.slow
def test_the_headless_job_prints_no_log_records() -> None:
    script = """
import logging, sys, types
demo = types.ModuleType("ui.shell.demo")
demo.run_demo = lambda *_, **__: logging.getLogger("engine.capture").info("opened a capture") or 0
sys.modules["ui.shell.demo"] = demo
from ui import main
main.has_display = lambda: False
sys.exit(main.main(["some_capture"]))
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


def test_help_says_what_each_command_does(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    lines = [line.split(maxsplit=2) for line in capsys.readouterr().out.splitlines()]
    said = {line[1]: line[2] for line in lines if line[:1] == ["clipgstream"]}
    assert said.keys() == {*COMMANDS, "sample", "demo", "completion"}
    assert all(said[name] == command.summary for name, command in COMMANDS.items())


def test_nonsense_arguments_end_with_2_and_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    from ui.main import main

    cases = (
        (["--ui-scale", "big"], "'big' is not a scale"),
        (["--size", "wide"], "'wide' is not a size"),
        (["a", "b"], "'a' is neither a command nor a file or folder"),
        ([".", "b"], "unrecognized arguments: b"),
        (["--siez", "9x9"], "unrecognized arguments: --siez. Did you mean --size?"),
    )
    for arguments, expected in cases:
        with pytest.raises(SystemExit) as ended:
            main(arguments)
        message = capsys.readouterr().err
        assert ended.value.code == 2
        assert expected in message
        assert message.count("\n") == 1
