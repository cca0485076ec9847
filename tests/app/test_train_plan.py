"""clipgstream train --plan, and the plan that a training says before it begins."""

import json
import re

import pytest

from engine.training.plan import stillness


def test_a_plan_is_printed_and_nothing_is_made(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3, "--plan")
    code, out, err = run(*arguments, "--set", "source_steps=7")
    assert code == 0, err
    assert not (tmp_path / "p").exists()
    assert re.search(r"Clip 0, frames 0 to 2, reference\n  pictures +9\n", out)
    assert re.search(r"source steps +7\n", out)
    assert re.search(r"  training +\S+ s\n", out)
    assert re.search(r"All 2 clips: about \d+:\d\d, at most 0\.\d GB of memory", out)


def test_a_plan_as_json(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    code, out, err = run(*arguments, "--plan", "--json", "--preset", "toy")
    assert code == 0, err
    document = json.loads(out)
    assert document.keys() == {
        "schema",
        "project",
        "capture",
        "holdout",
        "settings",
        "clips",
        "discards",
        "forecast",
    }
    assert (document["schema"], document["holdout"]) == (3, ["0"])
    assert document["settings"]["passes"] == 4
    assert [(clip["clip_index"], clip["state"], clip["role"]) for clip in document["clips"]] == [
        (0, "planned", "reference"),
        (1, "planned", "source"),
    ]
    first = document["clips"][0]
    assert first.keys() == {
        "clip_index",
        "start",
        "n_frames",
        "role",
        "n_steps",
        "steps_done",
        "forecast",
        "lines",
        "state",
    }
    assert first["n_steps"] == 300 + 36
    for name in ("preparation_s", "training_s"):
        together = sum(clip["forecast"][name] for clip in document["clips"])
        assert document["forecast"][name] == pytest.approx(together, abs=0.1)
    assert run(*arguments, "--clips", "0")[0] == 0
    document = json.loads(run(*arguments, "--plan", "--json")[1])
    assert [(clip["clip_index"], clip["state"]) for clip in document["clips"]] == [(0, "trained"), (1, "planned")]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--clips", "9"], "clips 0 to 0"),
        (["--preset", "huge"], "no preset called 'huge'"),
        (["--set", "passes=-1"], "passes is -1"),
        (["--holdout", "0,1,2"], "leaves 1 for training"),
    ],
)
def test_a_plan_that_cannot_be_is_bad_input(run, capture_folder, tmp_path, arguments, expected):
    code, out, err = run("train", capture_folder, "--project", tmp_path / "p", "--plan", *arguments)
    assert (code, out) == (2, "")
    assert expected in err
    assert not (tmp_path / "p").exists()


def test_a_plan_of_a_trained_project_with_other_settings_is_refused(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p")
    assert run(*arguments)[0] == 0
    code, _, err = run(*arguments, "--plan", "--set", "passes=3")
    assert code == 2
    assert "can no longer change: 1 trained clip" in err
    assert "--start-over" in err
    code, out, _ = run(*arguments, "--plan", "--set", "passes=3", "--start-over")
    assert code == 0
    assert out.startswith("Discards 1 trained clip (")
    assert "Clip 0, frames 0 to 5, reference" in out
    assert len(list((tmp_path / "p" / "clips").iterdir())) == 1  # nothing has happened yet
    code, out, _ = run(*arguments, "--plan")
    assert (code, out) == (0, "Already trained: clip 0\n")


def test_training_says_its_plan_and_how_right_it_was(run, capture_folder, tmp_path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    _, _, err = run(*arguments)
    assert re.search(r"Clip 0: 1,500 steps, about \d+:\d\d \(preparation \d+:\d\d\), 0\.\d GB of memory", err)
    figures = r"preparation \S+ against \S+ s, training \S+ against \S+ s, memory \S+ against \S+ MB"
    assert len(re.findall(f"Forecast against measured: {figures}", err)) == 2
    assert "Forecast" not in run(*arguments)[2]  # trained already


def test_a_later_clip_in_which_nothing_moves_takes_no_steps(run, capture_folder, tmp_path, monkeypatch):
    looks = []
    monkeypatch.setattr(stillness, "looks_still", lambda *arguments: looks.append(arguments) or True)
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    assert run(*arguments, "--clips", "0")[0] == 0
    looks.clear()
    code, out, err = run(*arguments, "--plan")
    assert code == 0, err
    assert re.search(r"source steps +0\n", out)
    ((_, clip, camera_indices, _, prep_dir),) = looks
    assert (clip.clip_index, camera_indices, prep_dir) == (1, [1, 2, 3], tmp_path / "p" / "prep")
    assert run("gate", tmp_path / "p", "--dynamic-sphere", 0, 0, 0, 1)[0] == 0
    assert re.search(r"source steps +[1-9]", run(*arguments, "--plan")[1])  # whatever it is, it may learn to change
    assert len(looks) == 1
