"""Offsets go into capture.json and come back as frames that belong together; what was there before is counted in."""

from __future__ import annotations

import json

import numpy as np

from engine.capture.capture import open_capture
from engine.capture.writers.capture_json import Corrections, capture_document, write_capture_json, write_corrections
from engine.synchronisation.applying import corrections_for, present_offsets
from engine.synchronisation.recording import recordings_of, videos_without_calibration
from engine.synchronisation.synchronisation import CameraOffset, Synchronisation
from tests.engine.capture.made_videos import SIZE, number_of, write_video_of_kind


def made_capture(folder, n_cameras=3, n_frames=24):
    cameras = []
    for row in range(n_cameras):
        write_video_of_kind(folder / f"c{row}.mp4", n_frames=n_frames, options={"g": str(5 + row)})
        pose = np.eye(4)
        pose[0, 3] = row
        K = [[60, 0, SIZE[0] / 2], [0, 60, SIZE[1] / 2], [0, 0, 1]]
        cameras.append({"name": f"c{row}", "file": f"c{row}.mp4", "width": SIZE[0], "height": SIZE[1], "K": K})
        cameras[-1]["world_to_camera"] = pose.tolist()
    document = {"schema": 1, "fps": 25, "n_frames": n_frames, "cameras": cameras}
    (folder / "cameras.json").write_text(json.dumps(document))
    return open_capture(folder)


def found(*offsets):
    cameras = [
        CameraOffset(f"c{row}", offset or 0.0, 0.1, 1.0, None if offset is None else "audio")
        for row, offset in enumerate(offsets)
    ]
    return Synchronisation(tuple(cameras), (), (), 25.0)


def shown(capture, frame_index):
    return [number_of(capture.frame(row, frame_index)) for row in range(len(capture.rig))]


def test_offsets_are_written_and_hold(tmp_path):
    capture = made_capture(tmp_path)
    write_corrections(capture.layout, tmp_path, corrections_for(capture, found(0.0, 3.0, -2.0)))
    corrected = open_capture(tmp_path)
    assert corrected.n_frames == 19
    assert shown(corrected, 0) == [2, 5, 0]
    assert present_offsets(corrected).tolist() == [0, 3, -2]


def test_a_second_look_adds_to_the_first(tmp_path):
    capture = made_capture(tmp_path)
    write_corrections(capture.layout, tmp_path, corrections_for(capture, found(0.0, 3.0, -2.0)))
    corrected = open_capture(tmp_path)
    assert corrections_for(corrected, found(0.0, 1.0, None)).offset_frames == {"c0": 0, "c1": 4, "c2": -2}
    assert corrections_for(corrected, found(0.0, 0.0, 0.0)).offset_frames == {"c0": 0, "c1": 3, "c2": -2}


def test_parts_of_frames_that_were_rounded_are_not_lost(tmp_path):
    capture = made_capture(tmp_path)
    write_corrections(capture.layout, tmp_path, Corrections(offset_frames={"c1": 2.4}))
    corrected = open_capture(tmp_path)
    assert corrections_for(corrected, found(0.0, 0.4, 0.0)).offset_frames["c1"] == 2.4


def test_recordings_know_where_in_their_file_they_begin(tmp_path):
    capture = made_capture(tmp_path)
    write_capture_json(tmp_path, capture_document(capture.layout, tmp_path))
    write_corrections(capture.layout, tmp_path, Corrections(offset_frames={"c1": 5.0}))
    recordings = recordings_of(open_capture(tmp_path))
    assert [round(recording.skipped_s * 25) for recording in recordings] == [0, 5, 0]
    assert all(recording.video is not None for recording in recordings)


def test_plain_videos_are_told_from_captures(tmp_path):
    assert videos_without_calibration(tmp_path) == []
    write_video_of_kind(tmp_path / "cam10.mp4", n_frames=2)
    write_video_of_kind(tmp_path / "cam2.mp4", n_frames=2)
    assert [path.name for path in videos_without_calibration(tmp_path)] == ["cam2.mp4", "cam10.mp4"]
    made_capture(tmp_path)
    assert videos_without_calibration(tmp_path) == []
