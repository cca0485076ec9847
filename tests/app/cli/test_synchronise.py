"""clipgstream synchronise: a table or JSON, and capture.json on request only."""

from __future__ import annotations

import json

import numpy as np
import pytest

from app.lab.synthetic.writing import write_video
from tests.engine.capture.made_videos import write_video_of_kind
from tests.engine.synchronisation.made_recordings import FPS, made_recordings, ring


def shifted_capture(folder, offsets):
    """A capture of the painted balls whose cameras are ahead by so many frames."""
    folder.mkdir()
    rig = ring(len(offsets))
    cameras = []
    for row, recording in enumerate(made_recordings(rig, offsets, n_frames=45)):
        write_video(folder / f"{recording.name}.mp4", recording.source.read(range(45)), fps=FPS)
        cameras.append({"name": recording.name, "file": f"{recording.name}.mp4", "width": 160, "height": 120})
        cameras[-1] |= {"K": rig.Ks[row].tolist(), "world_to_camera": rig.world_to_camera[row].tolist()}
    document = {"schema": 1, "fps": FPS, "n_frames": 45, "cameras": cameras}
    (folder / "cameras.json").write_text(json.dumps(document))
    return folder


@pytest.mark.slow
def test_offsets_are_found_shown_and_applied(run, tmp_path):
    offsets = np.array([0.0, 4.0, 0.0, -3.0])
    folder = shifted_capture(tmp_path / "capture", offsets)
    code, out, _ = run("synchronise", folder, "--json")
    assert code == 0
    document = json.loads(out)
    assert not document["is_in_step"]
    assert document["written"] is None
    assert np.abs([camera["offset_frames"] for camera in document["cameras"]] - offsets).max() < 0.3
    assert not (folder / "capture.json").exists()
    code, out, _ = run("synchronise", folder, "--apply")
    assert code == 0
    assert "Written to" in out
    code, out, _ = run("synchronise", folder)
    assert code == 0
    assert "All cameras are synchronised." in out


@pytest.mark.slow
def test_plain_videos_need_no_calibration_but_cannot_be_corrected(run, tmp_path):
    folder = shifted_capture(tmp_path / "videos", [0.0, 2.0])
    (folder / "cameras.json").unlink()
    code, out, _ = run("synchronise", folder)
    assert code == 0
    assert "motion:" in out
    code, _, err = run("synchronise", folder, "--apply")
    assert code != 0
    assert "no calibration" in err


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("fault", ["one frame", "false timescale"])
def test_a_video_without_a_rate_is_named(run, tmp_path, fault):
    for name in ("cam0", "cam1", "cam2"):
        write_video_of_kind(tmp_path / f"{name}.mp4", n_frames=1 if (name, fault) == ("cam1", "one frame") else 20)
    if fault == "false timescale":
        path = tmp_path / "cam1.mp4"
        content = bytearray(path.read_bytes())
        at = content.index(b"mdhd") + 16
        content[at : at + 4] = (2**31 - 1).to_bytes(4, "big")
        path.write_bytes(content)
    code, _, err = run("synchronise", tmp_path)
    assert code == 2
    assert "cam1.mp4" in err
    assert ("1 frame," if fault == "one frame" else "frames per second; cameras have") in err
    assert err.strip().count("\n") == 0


@pytest.mark.slow
def test_links_out_of_the_folder_are_followed_only_when_allowed(run, tmp_path):
    folder = shifted_capture(tmp_path / "videos", [0.0, 2.0])
    (folder / "cameras.json").unlink()
    (folder / "cam01.mp4").rename(tmp_path / "elsewhere.mp4")
    (folder / "cam01.mp4").symlink_to(tmp_path / "elsewhere.mp4")
    code, _, err = run("synchronise", folder)
    assert code == 2
    assert "leads out of the capture folder" in err
    assert run("synchronise", folder, "--follow-links")[0] == 0


def test_a_folder_of_something_else_is_refused(run, tmp_path):
    code, _, err = run("synchronise", tmp_path)
    assert code != 0
    assert "not a capture" in err
