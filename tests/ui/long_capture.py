"""A made-up session of a long capture: many clips in all states, seams, markers, decoded frames."""

from __future__ import annotations

import random

import numpy as np

from app.document.project_document import Marker
from app.playback.markers import Markers
from app.playback.timeline import Timeline
from app.status import ClipStatus, ResidualStatus, SeamStatus
from engine.capture.clip import split_clips
from tests.ui.fake_session import FakeSession

MARKERS = ("foul", "50 % ## of\nall %s", "goal")


def long_session(
    n_frames: int = 10_000, n_clips: int = 1_000, *, is_alternating: bool = False, fps: float = 29.97
) -> FakeSession:
    """Six tenths are trained, with some that are not as they should be, one trains, and the rest wait.

    Args:
        is_alternating: No two neighbours are in the same state, so that nothing can be drawn in runs.
    """
    session = FakeSession()
    session.clips = split_clips(n_frames, max(n_frames // n_clips, 1))
    n_clips = len(session.clips)
    chance = random.Random(0)
    session.clip_states = [_clip(index, n_clips, chance, is_alternating=is_alternating) for index in range(n_clips)]
    measured = int(0.6 * n_clips)
    seams = tuple(
        SeamStatus(clip.clip_index, clip.start, 0.1, 1.0 + 2.4 * chance.random() ** 6)
        for clip in session.clips[1:measured]
    )
    psnr = 29.0 + 5.0 * np.sin(np.arange(n_frames) / n_frames * 9.0) + 0.8 * np.sin(np.arange(n_frames) / 3.0)
    psnr[session.clips[measured].start :] = np.nan
    cells = {"psnr": np.repeat(psnr[:, None], len(session.rig), axis=1).astype(np.float32)}
    is_held_out = tuple(index in session.holdout for index in range(len(session.rig)))
    session.measured = ResidualStatus(seams, cells, is_held_out, revision=1)
    session.cached = [(0, 12), (13, 40), (n_frames // 2, n_frames // 2 + n_frames // 15)]
    session.timeline = Timeline(session.clips, fps=fps)
    session.timeline.markers = Markers(
        [Marker((place * 2 + 1) * n_frames // 7, name) for place, name in enumerate(MARKERS)]
    )
    session.timeline.seek(n_frames // 3)
    return session


def _clip(index: int, n_clips: int, chance: random.Random, *, is_alternating: bool) -> ClipStatus:
    if is_alternating:
        state = ("trained", "stale", "untrained", "failed")[index % 4]
    elif index < 0.6 * n_clips:
        odd = {50: "failed", 51: "damaged"}
        state = "stale" if 0.2 < index / n_clips < 0.22 else odd.get(index % 97, "trained")
    elif index < 0.6 * n_clips + 1:
        state = "training"
    else:
        state = "queued" if index < 0.8 * n_clips else "untrained"
    psnr = 29.0 + 5.0 * np.sin(index / n_clips * 9.0) + chance.random() if state in ("trained", "stale") else None
    return ClipStatus(state, 0.56 if state == "training" else float(psnr is not None), psnr)
