"""The command line of ablations."""

from __future__ import annotations

import json

import pytest

from app.lab.ablation.running import project_folder
from app.lab.ablation.variants import FULL, VARIANTS
from app.project.opening.project_access import read_settings
from engine.training.preparation import picture_store
from tests.app.lab.ablation.runs import BY_NAME


def test_the_list_needs_no_capture(run):
    code, out, _ = run("ablate", "--list")
    assert code == 0
    lines = out.splitlines()
    assert [line.split()[0] for line in lines] == list(BY_NAME)
    assert {line.split()[0] for line in lines if "baseline:" in line} == {v.name for v in VARIANTS if v.is_baseline}


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--seeds", "a"], "--seeds is 'a'"),
        (["--seeds", ""], "--seeds is ''"),
        (["--seeds", "0,0"], "only once"),
        (["--seeds", "0,-4"], "seed is -4"),
        (["--source-steps", "4,x"], "--source-steps is '4,x'"),
        (["--source-steps", "0,4"], "at least one step"),
        (["--source-steps", "4,4"], "only once"),
        (["--source-steps", "4", "--variants", "independent"], "independent has no source clips"),
        (["--n-clips", "0"], "--n-clips is 0; the capture has 2 clips of 3 frames"),
        (["--n-clips", "3"], "--n-clips is 3"),
        (["--reference-clip", "2"], "reference clip is 2"),
        (["--reference-clip", "1", "--n-clips", "1"], "none of the 1 clips of the ablation. Choose one from 0 to 0"),
        (["--seed", "3"], "unrecognized arguments: --seed 3. Did you mean --seeds? See `clipgstream ablate --help`"),
        (["--variants", " , "], "--variants is ' , ', which names none"),
        (["--variants", "full,nonsense"], "no variant called nonsense"),
        (["--preset", "nonsense"], "no preset called 'nonsense'"),
        (["--metrics", "none"], "invalid choice"),
        (["--set", "field=joint"], "field=joint leaves no clips"),
        (["--set", "field=continue"], "cannot continue each other's field"),
        (["--holdout", "0,1,2"], "leaves 1 for training"),
    ],
)
def test_bad_arguments_end_with_2_and_leave_nothing_behind(run, capture_folder, tmp_path, arguments, expected):
    code, out, err = run("ablate", capture_folder, "--project", tmp_path / "a", "--clip-length", 3, *arguments)
    assert code == 2
    assert expected in err
    assert "Traceback" not in err
    assert out == ""
    assert not (tmp_path / "a").exists()


def test_a_variant_whose_pictures_do_not_fit_is_refused_before_any_is_trained(run, runner, capture_folder, monkeypatch):
    monkeypatch.setattr(picture_store, "memory_bytes", lambda: 30_000)  # 3 x 24 x 32 x 3 bytes a frame
    arguments = ["ablate", capture_folder, "--project", runner.folder, "--clip-length", 4, "--variants", "field-joint"]
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert "field-joint: 6 frames of 3 cameras, 32 x 24, are 0.0 GB of pictures; reading them" in err
    assert "Leave field-joint out. Choose shorter clips or a smaller scale." in err
    assert not runner.folder.exists()


def test_a_capture_and_a_folder_are_asked_for(run, capture_folder):
    for arguments in ([], [capture_folder], ["--project", "x"]):
        code, _, err = run("ablate", *arguments)
        assert code == 2
        assert "--project are needed" in err


def test_the_command_prints_the_table(run, runner, capture_folder):
    arguments = ["ablate", capture_folder, "--project", runner.folder, "--clip-length", 3, "--variants", "decoder-new"]
    settings = ["--set", "joint_steps=6"]
    code, out, err = run(*arguments, *settings)
    assert code == 0, err
    table, _, said = out.partition("\n\n")
    assert [line.split()[0] for line in table.splitlines()[1:]] == [FULL, "decoder-new"]
    assert said.startswith("Flicker: ")
    assert "Here 32 x 24 px, by CPU rasterizer, 2 threads. No OpenGL: no driver." in said
    assert runner.rated == [f"{name}-seed0" for name in (FULL, "decoder-new")]
    assert 'those of the clips of "full"' in said
    code, out, _ = run(*arguments, *settings, "--json", "--quiet")
    assert code == 0
    assert json.loads(out)["n_clips"] == 2
    assert json.loads(out)["precision"] == "float"
    assert [line["fps_cpu"] for line in json.loads(out)["lines"]] == [12.5, 12.5]
    code, out, _ = run(*arguments, *settings, "--json", "--quiet", "--precision", "8bit")
    assert json.loads(out)["precision"] == "8bit"
    code, _, err = run(*arguments, "--set", "joint_steps=7")
    assert code == 2
    assert "other settings" in err


def test_the_reference_clip_is_that_of_every_variant_cut_alike(run, runner, capture_folder):
    code, _, err = run(
        "ablate", capture_folder, "--project", runner.folder, "--clip-length", 3, "--variants", "decoder-new,,gate-off",
        "--reference-clip", 1, "--quiet", "--no-fps",
    )  # fmt: skip
    assert code == 0, err
    assert runner.rated == []
    for name in (FULL, "decoder-new", "gate-off"):
        assert read_settings(project_folder(runner.folder, name, 0)).reference_clip == 1
