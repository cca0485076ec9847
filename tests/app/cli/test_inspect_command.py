"""clipgstream inspect: a capture, and the clips of a project."""

import json
import os
import re
import shutil

import pytest

from app.project.opening.capture_report import report_of
from engine.capture.capture import open_capture
from engine.capture.writers.capture_json import capture_document, write_capture_json
from engine.clip_files.clip_state import read_clip_state, write_clip_state
from tests.clip_headers import with_header


def test_inspecting_prints_stable_json(run, capture_folder):
    code, out, _ = run("inspect", capture_folder, "--json", "--quick")
    assert code == 0
    document = json.loads(out)
    assert (document["schema"], document["n_cameras"], document["n_frames"]) == (1, 4, 6)
    code, out, _ = run("inspect", capture_folder, "--quick")
    assert code == 0
    assert report_of(open_capture(capture_folder)).text in out  # as the window says it
    assert "Cameras: 4 cameras, 32 x 24" in out


def test_inspecting_a_project_counts_the_bytes_of_its_clips(run, capture_folder, tmp_path):
    project, capture = tmp_path / "p", tmp_path / "capture"
    shutil.copytree(capture_folder, capture)
    assert run("train", capture, "--project", project, "--clip-length", 3)[0] == 0
    code, out, _ = run("inspect", project, "--json")
    assert code == 0
    found = json.loads(out)
    sizes = [(project / "clips" / f"000{i}.safetensors").stat().st_size for i in range(2)]
    assert [clip["n_bytes"] for clip in found["clips"]] == sizes
    assert [sum(clip["components"].values()) for clip in found["clips"]] == sizes
    assert found["components"]["positions"] == sum(clip["components"]["positions"] for clip in found["clips"]) > 0
    assert found["reference_share"] == pytest.approx(sizes[0] / sum(sizes))
    assert found["mb_per_minute"] == pytest.approx(sizes[1] / 3 * found["fps"] * 60 / 1e6)
    code, out, _ = run("inspect", project)
    assert code == 0
    assert f"{found['mb_per_minute']:.1f} MB per minute" in out
    assert re.search(r"positions +\d", out)
    capture.rename(tmp_path / "elsewhere")
    assert json.loads(run("inspect", project, "--json")[1])["mb_per_minute"] is None
    assert "the capture is missing" in run("inspect", project)[1]


def test_inspecting_a_project_says_how_much_of_what_moves_is_within_reach_of_an_anchor(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    assert run("train", capture_folder, "--project", project, "--clip-length", 3)[0] == 0
    assert "within reach" not in run("inspect", project)[1]  # nothing known, as in files of earlier versions
    path = project / "clips" / "0001.safetensors"
    state = read_clip_state(path)
    coverage = {"n_points": 4000, "n_inherited": 500, "n_residual": 3000, "n_left_out": 500, "share": 0.9876}
    write_clip_state(path, with_header(state, coverage=coverage | {"reason": "at most 3500"}))
    clips = json.loads(run("inspect", project, "--json")[1])["clips"]
    assert [clip["coverage"] and clip["coverage"]["share"] for clip in clips] == [None, 0.9876]
    said = "clip 1 98.8 % with 3,000 residual anchors, 500 points beyond the budget left to their neighbours"
    assert said in run("inspect", project)[1]


def test_a_damaged_clip_is_listed_beside_the_others(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    assert run("train", capture_folder, "--project", project, "--clip-length", 3)[0] == 0
    clip = project / "clips" / "0001.safetensors"
    clip.write_bytes(clip.read_bytes()[:50])
    code, out, err = run("inspect", project)
    assert (code, err) == (0, "")
    assert "1 trained clips, 3 frames" in out
    assert f"Damaged, and not counted (invalid header length): {clip}" in out
    found = json.loads(run("inspect", project, "--json")[1])
    assert [entry["path"] for entry in found["damaged"]] == [str(clip)]
    (project / "clips" / "0000.safetensors").write_bytes(b"")
    code, out, err = run("inspect", project)
    assert (code, out) == (2, "")
    assert "damaged" in err


def test_inspecting_a_project_without_clips_is_bad_input(run, capture_folder, tmp_path):
    project = tmp_path / "p"
    assert run("train", capture_folder, "--project", project, "--clip-length", 3)[0] == 0
    for path in (project / "clips").iterdir():
        path.unlink()
    code, out, err = run("inspect", project)
    assert (code, out) == (2, "")
    assert "Nothing is trained" in err


@pytest.mark.parametrize("path", ["", " ", "x" * 5000, "y/" * 2040, "a\0b"])
def test_what_cannot_be_a_path_is_one_message(run, path):
    for command in (["inspect", path], ["train", path, "--project", "p"], ["eval", path, "--json", "out.json"]):
        code, out, err = run(*command)
        assert code == 2
        assert (out, err.count("\n"), "Traceback" in err) == ("", 1, False)
        assert len(err) < 300


def test_names_cannot_command_the_terminal_nor_stop_the_program(run, capture_folder, tmp_path):
    folder = tmp_path / os.fsdecode(b"caf\xe9 \x1b[2J")  # no UTF-8, as unpacked from an old archive
    shutil.copytree(capture_folder, folder)
    code, out, _ = run("inspect", folder, "--quick")
    assert code == 0
    out.encode("utf-8")
    assert "\x1b" not in out
    code, out, _ = run("inspect", folder, "--json", "--quick")
    assert code == 0
    assert out.isascii()
    assert json.loads(out)["path"] == str(folder)
    (folder / "train_meta.json").write_text("{")
    code, out, err = run("inspect", folder, "--quick")
    assert (code, out, err.count("clipgstream: ")) == (2, "", 1)
    err.encode("utf-8")
    assert "\x1b" not in err


def test_links_outside_are_allowed_once_for_a_project(run, capture_folder, tmp_path):
    capture, project = tmp_path / "capture", tmp_path / "p"
    shutil.copytree(capture_folder, capture)
    (capture / "ims").rename(tmp_path / "another disk")
    (capture / "ims").symlink_to(tmp_path / "another disk")
    for command in (["inspect", capture], ["train", capture, "--project", project]):
        code, _, err = run(*command)
        assert code == 2
        assert "'ims' is a link that leads out of the capture folder" in err
        assert err.count("\n") == 1
        assert "--follow-links" in err
    assert run("inspect", capture, "--follow-links", "--quick")[0] == 0
    assert run("train", capture, "--project", project, "--clip-length", 3, "--follow-links")[0] == 0
    assert json.loads(run("inspect", project, "--json")[1])["fps"] == 30.0  # opens the capture as the project allows
    assert run("train", capture, "--project", project)[0] == 0


def test_training_repeats_what_is_odd_about_the_capture(run, capture_folder, tmp_path):
    capture = tmp_path / "capture"
    shutil.copytree(capture_folder, capture)
    for folder in (capture / "ims").iterdir():
        sorted(folder.iterdir())[-1].unlink()
    code, _, err = run("train", capture, "--project", tmp_path / "p", "--clip-length", 3)
    assert code == 0
    assert "Note: The calibration lists 6 frames, the first 5 are there and are used." in err


def test_corrections_are_written_by_flags_and_taken_back(run, capture_folder, tmp_path):
    capture = tmp_path / "capture"
    shutil.copytree(capture_folder, capture)
    names = [camera["name"] for camera in json.loads(run("inspect", capture, "--json", "--quick")[1])["cameras"]]
    flags = ["--exclude", names[1], "--shift", f"{names[2]}=1", "--hold-out", names[3]]
    code, out, _ = run("inspect", capture, *flags)
    assert code == 0
    assert "capture.json" in out
    found = json.loads(run("inspect", capture, "--json", "--quick")[1])
    assert [camera["name"] for camera in found["cameras"]] == [names[0], *names[2:]]
    assert found["default_holdout"] == [names[3]]
    assert found["n_frames"] == 5
    assert run("inspect", capture, "--include", names[1], "--shift", f"{names[2]}=0", "--hold-out", "none")[0] == 0
    found = json.loads(run("inspect", capture, "--json", "--quick")[1])
    assert [camera["name"] for camera in found["cameras"]] == names
    assert (found["default_holdout"], found["n_frames"]) == ([], 6)


def test_corrections_go_to_another_folder_where_that_is_asked(run, capture_folder, tmp_path):
    capture, out_folder = tmp_path / "capture", tmp_path / "corrected"
    shutil.copytree(capture_folder, capture)
    out_folder.mkdir()
    before = sorted(path.name for path in capture.iterdir())
    name = json.loads(run("inspect", capture, "--json", "--quick")[1])["cameras"][0]["name"]
    assert run("inspect", capture, "--exclude", name, "--out", out_folder)[0] == 0
    assert sorted(path.name for path in capture.iterdir()) == before
    found = json.loads(run("inspect", out_folder, "--json", "--quick", "--follow-links")[1])
    assert name not in [camera["name"] for camera in found["cameras"]]


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--exclude", "nobody"], "no camera called nobody"),
        (["--shift", "0=x"], "is not a number of frames"),
        (["--shift", "0"], "write CAM=FRAMES"),
        (["--mask", "0="], "write CAM=FILES"),
        (["--exclude", "0", "--exclude", "1", "--exclude", "2"], "would be left"),
    ],
)
def test_corrections_that_cannot_be_are_one_message(run, capture_folder, tmp_path, flags, said):
    capture = tmp_path / "capture"
    shutil.copytree(capture_folder, capture)
    names = [camera["name"] for camera in json.loads(run("inspect", capture, "--json", "--quick")[1])["cameras"]]
    flags = [names[int(flag)] if flag in ("0", "1", "2") else flag for flag in flags]
    code, out, err = run("inspect", capture, *flags)
    assert (code, out) == (2, "")
    assert said in err
    assert "Traceback" not in err
    assert not (capture / "capture.json").exists()


@pytest.mark.slow
def test_inspecting_says_what_the_doctor_found(run, capture_folder):
    code, out, err = run("inspect", capture_folder)
    assert code == 0
    assert "Capture doctor:" in out
    assert "Exposure" in out
    assert "Capture doctor" in err  # how far it is
    document = json.loads(run("inspect", capture_folder, "--json")[1])
    assert {"findings", "pairs", "cameras", "seconds", "n_pictures"} <= document["doctor"].keys()
    assert document["exposure"]["n_measured"] == 4


def test_frames_of_quite_another_shape_are_refused_until_it_is_said_what_became_of_them(run, capture_folder, tmp_path):
    folder = tmp_path / "capture"
    shutil.copytree(capture_folder, folder)
    document = capture_document(open_capture(folder).layout, folder)
    for row in document["cameras"]:
        row["height"] += 6
    write_capture_json(folder, document)
    code, _, said = run("inspect", folder, "--quick")
    assert code == 2
    assert "its calibration is for 32x30" in said
    assert "--fit" in said
    code, out, _ = run("inspect", folder, "--fit", "cropped-start")
    assert (code, "Written" in out) == (0, True)
    code, out, _ = run("inspect", folder, "--quick")
    assert code == 0
    assert "which were cropped at the left and upper border" in out
