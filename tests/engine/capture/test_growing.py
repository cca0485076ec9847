"""Captures that are still being recorded: what counts of them, what is late, lost, torn or another one."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from engine.capture.capture import Capture, open_capture
from engine.capture.exclusions import ExcludedFrames, Exclusions
from engine.capture.growing.arrivals import LOOK_AHEAD, VideoArrivals
from engine.capture.growing.numbered_files import numbered_files
from engine.capture.growing.watch import END_FILE, GrowthWatch
from engine.errors import CaptureError
from tests.engine.capture.layouts.all_layouts import ALL
from tests.engine.capture.made_videos import number_of, write_video_of_kind
from tests.engine.capture.small_ring import write_capture
from tests.faults.record import Recorder

PATIENCE_S = 10.0


class Clock:
    """Seconds that pass when a test says so."""

    now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    """A complete capture of four cameras and twelve frames."""
    return open_capture(write_capture(tmp_path_factory.mktemp("source") / "c", n_frames=12))


class Recording:
    """A recorder and a watch over what it writes. `tick` records a moment, waits and looks."""

    def __init__(self, source: Capture, folder: Path, n_before: int = 2, **faults: object) -> None:
        self.recorder, self.clock, self.n = Recorder(source, folder, **faults), Clock(), 0  # type: ignore[arg-type]
        for _ in range(n_before):
            self.write()
        self.capture = open_capture(folder, is_growing=True)
        self.watch = GrowthWatch(self.capture, patience_s=PATIENCE_S, clock=self.clock)

    def write(self) -> None:
        self.recorder.write(self.n)
        self.n += 1

    def tick(self, n: int = 1, seconds: float = 1.0):
        for _ in range(n - 1):
            self.write()
            self.wait(seconds)
        self.write()
        return self.wait(seconds)

    def wait(self, seconds: float):
        self.clock.now_s += seconds
        return self.watch.look()


def test_frames_count_once_all_cameras_have_written_them(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c")
    assert recording.watch.look().n_complete == 2
    seen = []
    recording.recorder.write(2, between=lambda: seen.append(recording.watch.look()))
    assert (seen[0].n_complete, recording.watch.look().n_complete) == (2, 3)
    assert "truncated" in seen[0].cameras[0].fault
    assert recording.watch.look().words(0, 5) == "waiting for frames 0 to 4: 3 are complete on all cameras"
    grown = recording.capture.grown(3)
    assert (grown.n_frames, grown.frames, grown.fingerprint) == (3, (0, 3), recording.capture.fingerprint)
    assert np.array_equal(grown.frame(1, 2), source.frame(1, 2))


def test_its_identity_is_that_of_its_cameras_at_any_length(source: Capture, tmp_path: Path) -> None:
    short = Recording(source, tmp_path / "c").capture
    whole = open_capture(source.path, is_growing=True)
    assert short.fingerprint == whole.fingerprint != source.fingerprint
    assert open_capture(source.path).fingerprint == source.fingerprint, "as it always was"
    other = Recording(open_capture(write_capture(tmp_path / "s", n_cameras=5)), tmp_path / "d").capture
    assert other.fingerprint != short.fingerprint


def test_a_camera_that_is_only_slow_is_waited_for(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c", n_before=5, late={"2": 3})
    growth = recording.tick(4, seconds=0.9 * PATIENCE_S)
    assert (growth.n_complete, growth.n_reached, recording.watch.take_lost(99)) == (6, 9, [])
    assert "camera 2 is 3 frames behind" in growth.words(5, 10)


@pytest.mark.parametrize(("kind", "word"), [("lost", "no frame 3"), ("torn", "truncated")])
def test_a_frame_that_stays_away_is_given_up(source: Capture, tmp_path: Path, kind: str, word: str) -> None:
    recording = Recording(source, tmp_path / "c", **{kind: [("1", 3)]})  # type: ignore[arg-type]
    growth = recording.tick(4)
    assert growth.n_complete == 3
    assert word in growth.words(0, 5)
    assert "1 has later frames" in growth.words(0, 5)
    growth = recording.wait(0.5 * PATIENCE_S)
    assert (growth.n_complete, recording.watch.take_lost(99)) == (3, [])
    recording.wait(PATIENCE_S)
    assert recording.watch.look().n_complete == 6
    assert recording.watch.take_lost(3) == []
    assert recording.watch.take_lost(4) == [(1, 3)]
    assert recording.watch.take_lost(99) == []


def test_a_frame_that_comes_late_and_out_of_order_counts(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c", lost=[("1", 3)])
    assert recording.tick(4).n_complete == 3
    shutil.copyfile(source.path / "ims/1/000003.jpg", tmp_path / "c/ims/1/000003.jpg")
    assert recording.watch.look().n_complete == 6
    assert recording.watch.take_lost(99) == []


def test_a_camera_that_dies_is_given_up_frame_by_frame(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c", lost=[("3", frame) for frame in range(4, 12)])
    growth = recording.tick(10, seconds=3.0)
    assert growth.n_reached == 12
    assert 4 < growth.n_complete < 12, "later frames have not been late for so long yet"
    recording.wait(PATIENCE_S)
    assert recording.watch.look().n_complete == 12
    assert recording.watch.take_lost(99) == [(3, frame) for frame in range(4, 12)]


def test_excluded_pictures_need_not_come_and_are_not_read(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c", lost=[("1", 3)])
    excluded = Exclusions(frames=(ExcludedFrames("1", 3, 4),))
    watch = GrowthWatch(
        recording.capture, is_wanted=lambda camera, frame: (camera, frame) != (1, 3), clock=recording.clock
    )
    recording.tick(4)
    watch.look()
    assert watch.look().n_complete == 6
    capture = recording.capture.grown(6)
    with pytest.raises(CaptureError, match="missing"):
        capture.frame(1, 3)
    left = capture.without(excluded)
    assert not left.is_usable(1, 3)
    assert np.array_equal(left.frame(1, 3), source.frame(1, 2)), "the nearest one stands in its place"
    assert np.array_equal(left.frames_of(1, (2, 3, 4))[2], source.frame(1, 4))


def test_a_camera_whose_first_frame_is_missing_is_not_moved_up(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c", n_before=4, lost=[("2", 0)])
    assert np.array_equal(recording.capture.frame(2, 2), source.frame(2, 2))
    assert recording.watch.look().n_complete == 0


def test_memory_of_a_watch_does_not_grow(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c", n_before=3)
    files = sorted((tmp_path / "c").glob("ims/*/000002.jpg"))
    for frame in range(3, 203):
        for file in files:
            file.with_name(f"{frame:06d}.jpg").hardlink_to(file)
        assert recording.wait(0.1).n_complete == frame + 1
    assert len(recording.watch._reached) <= 2
    assert recording.watch._lost == []


def test_the_folder_may_be_away_for_a_while_only(source: Capture, tmp_path: Path) -> None:
    recording = Recording(source, tmp_path / "c")
    recording.watch.look()
    (tmp_path / "c").rename(tmp_path / "away")
    assert "the capture folder is gone" in recording.wait(1.0).words(0, 5)
    (tmp_path / "away").rename(tmp_path / "c")
    assert not recording.wait(PATIENCE_S).is_gone
    (tmp_path / "c" / END_FILE).touch()
    assert recording.watch.look().has_ended
    shutil.rmtree(tmp_path / "c")
    recording.wait(1.0)
    with pytest.raises(CaptureError, match="has been gone for 1"):
        recording.wait(PATIENCE_S)


def test_images_have_to_be_numbered() -> None:
    folder = Path("/c")
    frames = numbered_files([folder / "a/f_9.png", folder / "a/f_10.png", folder / "a/f_12.png"], folder)
    assert (len(frames), frames.first, frames.file(2), frames[3]) == (
        4,
        9,
        folder / "a/f_11.png",
        folder / "a/f_12.png",
    )
    by_frame = numbered_files([folder / f"frame{n:03d}/cam07.png" for n in (1, 2)], folder)
    assert by_frame.file(9 + LOOK_AHEAD) == folder / "frame026/cam07.png"
    for names in (
        ["a.png", "b.png"],
        ["f_1.png", "f_6.png", "f_11.png"],
        ["f1.png", "g2.png"],
        ["t1700000000.png", "t1.png"],
    ):
        with pytest.raises(CaptureError, match="not numbered one after the other"):
            numbered_files([folder / name for name in names], folder)
    with pytest.raises(CaptureError, match="one frame so far"):
        numbered_files([folder / "f_1.png"], folder)


@pytest.mark.parametrize("suffix", ["mkv", "ts"])
def test_a_video_counts_up_to_its_last_key_frame_until_it_rests(tmp_path: Path, suffix: str) -> None:
    whole, path, clock = tmp_path / f"whole.{suffix}", tmp_path / f"a.{suffix}", Clock()
    write_video_of_kind(whole, n_frames=40, options={"g": "10", "sc_threshold": "0"})
    data = whole.read_bytes()
    path.write_bytes(data[: 2 * len(data) // 3])
    arrivals = VideoArrivals(path, 0, clock)
    n_half = next(n for n in range(41) if not arrivals.has(n, clock()))
    assert 0 < n_half < 40
    assert n_half % 10 == 0
    path.write_bytes(data)
    clock.now_s += 1.0
    assert next((n for n in range(41) if not arrivals.has(n, clock())), 41) == 30
    clock.now_s += 2.0
    assert next(n for n in range(41) if not arrivals.has(n, clock())) == 40
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(CaptureError, match=r"has shrunk from [\d,]+ to [\d,]+ bytes"):
        arrivals.has(40, clock())


def test_videos_of_different_length_are_read_as_far_as_they_are(make_sample, tmp_path: Path) -> None:
    folder = make_sample(n_frames=6)
    for row, path in enumerate(folder.glob("*.mp4")):
        options = {"g": "5", "sc_threshold": "0", "crf": str(15 + row)}
        write_video_of_kind(path.with_suffix(".ts"), n_frames=20, options=options)
    document = (folder / "cameras.json").read_text().replace('"width": 48, "height": 32', '"width": 64, "height": 48')
    (folder / "cameras.json").write_text(document.replace(".mp4", ".ts"))
    path = min(folder.glob("*.ts"))
    data = path.read_bytes()
    path.write_bytes(data[: 2 * len(data) // 3])
    with pytest.raises(CaptureError, match="20"):
        open_capture(folder)
    capture = open_capture(folder, is_growing=True)
    assert capture.n_frames == 20
    assert number_of(capture.frame(0, 4)) == 4
    with pytest.raises(CaptureError, match=r"only \d+ so far"):
        capture.frame(0, 19)
    path.write_bytes(data)
    assert number_of(capture.grown(20).frame(0, 19)) == 19


def test_a_plain_mp4_says_that_it_cannot_be_read_before_its_end(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    write_video_of_kind(path)
    path.write_bytes(path.read_bytes()[:-700])
    arrivals = VideoArrivals(path, 0, Clock())
    assert not arrivals.has(0, 0.0)
    assert "before it is finished" in arrivals.fault


@pytest.mark.parametrize(
    "layout",
    ["capture_json-fisheye", "colmap_frames", "easyvolcap-videos", "multipleview", "n3dv-images", "technicolor"],
)
def test_a_complete_capture_of_any_layout_is_the_same_when_read_as_growing(layout: str, tmp_path: Path) -> None:
    ALL[layout](tmp_path)
    whole, growing = open_capture(tmp_path), open_capture(tmp_path, is_growing=True)
    assert (growing.rig.names, growing.n_frames) == (whole.rig.names, whole.n_frames)
    for camera in range(len(whole.rig)):
        assert np.array_equal(growing.frame(camera, 2), whole.frame(camera, 2))


def test_a_capture_with_times_of_frames_is_refused(tmp_path: Path) -> None:
    ALL["caliscope"](tmp_path)
    with pytest.raises(CaptureError, match="has times of its frames, which a capture that is still being recorded"):
        open_capture(tmp_path, is_growing=True)
