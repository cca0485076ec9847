"""FrameDecoder: frames of clips on disk, and that nothing of a project that was left is shown in the next one."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from app.playback.frame_decoder import FrameDecoder, FrameRequest
from app.playback.picture_source import PictureSource
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState, write_clip_state
from tests.app.fakes import anchor_arrays, decoder_arrays
from tests.clip_headers import make_header

WAIT_S = 300.0


def write_clip(path: Path, *, shift: float, step: int = 1) -> Path:
    """A reference clip that can be decoded; its anchors are moved along x, to tell clips apart."""
    arrays = anchor_arrays("static") | decoder_arrays()
    arrays["sets.static.positions"] = arrays["sets.static.positions"] + np.array([shift, 0.0, 0.0], np.float32)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_clip_state(path, ClipState(arrays, make_header(clip_length=3, n_frames=3, step=step)).stamped())
    return path


def frame_of(path: Path, *, revision: str = "live-1", frame_index: int = 0, generation: int = 1) -> FrameRequest:
    """What playback asks for."""
    return FrameRequest(0, revision, frame_index, path, generation, None, Clip(0, 0, 3, 3))


@pytest.fixture
def decoder() -> Iterator[FrameDecoder]:
    made = FrameDecoder()
    yield made
    made.close()


def wait_for(decoder: FrameDecoder, request: FrameRequest) -> float:
    """Ask until the frame is there; returns where its anchors begin along x."""
    shown = decoder.frame(request)
    assert decoder.worker.wait_idle(WAIT_S)
    shown = decoder.frame(request)
    assert shown is not None
    assert decoder.worker.take_error() is None
    return float(shown.anchors.own_positions[0, 0])


@pytest.fixture
def hold(monkeypatch: pytest.MonkeyPatch) -> Callable[[], tuple[threading.Event, threading.Event]]:
    """Makes the thread stop after it has read the next file: gives "it was read" and "go on"."""
    import app.playback.frame_decoder as module

    def arm() -> tuple[threading.Event, threading.Event]:
        was_read, go_on = threading.Event(), threading.Event()
        read = module.read_clip_state

        def read_and_wait(path: Path) -> ClipState:
            state = read(path)
            was_read.set()
            assert go_on.wait(WAIT_S)
            return state

        monkeypatch.setattr(module, "read_clip_state", read_and_wait)
        return was_read, go_on

    return arm


def test_a_frame_says_what_it_is(decoder: FrameDecoder, tmp_path: Path):
    request = frame_of(write_clip(tmp_path / "a.safetensors", shift=0.0, step=4), frame_index=2)
    wait_for(decoder, request)
    shown = decoder.frame(request)
    assert shown is not None
    expected = PictureSource(clip_index=0, frame_index=2, revision="live-1", step=4, is_still=True)
    assert shown.gaussians.source == shown.anchors.source == expected


def test_what_was_decoded_for_one_project_is_not_shown_in_the_next(decoder: FrameDecoder, tmp_path: Path):
    """Both have a clip 0 whose first live state is being looked at, at frame 0."""
    first, second = (
        write_clip(tmp_path / name / "live.safetensors", shift=shift) for name, shift in (("a", 0.0), ("b", 5.0))
    )
    assert wait_for(decoder, frame_of(first)) == 0.0
    decoder.clear()
    assert not decoder.is_loaded(frame_of(second))
    assert decoder.anchors(frame_of(second)) is None
    assert decoder.frame(frame_of(second)) is None
    assert wait_for(decoder, frame_of(second)) == 5.0


def test_what_the_thread_finishes_after_a_change_of_project_is_dropped(decoder: FrameDecoder, tmp_path: Path, hold):
    path = write_clip(tmp_path / "live.safetensors", shift=0.0)
    was_read, go_on = hold()
    assert decoder.frame(frame_of(path)) is None
    assert was_read.wait(WAIT_S)
    decoder.clear()
    write_clip(path, shift=5.0)  # the same place, as when a project folder is made anew
    go_on.set()
    assert decoder.worker.wait_idle(WAIT_S)
    assert decoder.worker.newest is None
    assert not decoder.is_loaded(frame_of(path)), "its snapshot would be called consumed although nobody read it"
    assert decoder.anchors(frame_of(path)) is None
    assert decoder.frame(frame_of(path)) is None
    assert wait_for(decoder, frame_of(path)) == 5.0


def test_two_states_of_a_clip_never_share_a_key(decoder: FrameDecoder, tmp_path: Path):
    """What draws on the graphics card uploads by key."""
    keys = set()
    for name in ("a", "b"):
        path = write_clip(tmp_path / name / "live.safetensors", shift=0.0)
        wait_for(decoder, frame_of(path))
        shown = decoder.frame(frame_of(path))
        assert shown is not None
        keys |= {shown.gaussians.key, shown.anchors.key}
    assert len(keys) == 2
    decoder.clear()
    again = frame_of(path, generation=2)
    wait_for(decoder, again)
    shown = decoder.frame(again)
    assert shown is not None
    assert shown.gaussians.key not in keys


def test_until_a_frame_is_there_the_last_one_is_shown_and_says_so(decoder: FrameDecoder, tmp_path: Path):
    path = write_clip(tmp_path / "a.safetensors", shift=0.0)
    wait_for(decoder, frame_of(path, frame_index=0))
    shown = decoder.frame(frame_of(path, frame_index=2))
    assert shown is not None
    assert shown.gaussians.source.frame_index == 0


def test_a_damaged_file_is_not_on_its_way(decoder: FrameDecoder, tmp_path: Path):
    path = tmp_path / "a.safetensors"
    path.write_bytes(b"not a clip")
    assert decoder.frame(frame_of(path)) is None
    assert decoder.worker.wait_idle(WAIT_S)
    assert decoder.has_failed(frame_of(path))
    assert not decoder.is_loaded(frame_of(path))
