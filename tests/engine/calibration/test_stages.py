"""How far a calibration is: never less than before, whoever tells it, and soon more than nothing."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from engine.calibration.child import STAGES, StageProgress
from engine.calibration.matching.pictures import N_BACKGROUND_FRAMES, read_pictures
from engine.calibration.videos import find_videos
from engine.progress import Progress
from tests.engine.calibration.test_room_corner import write_corner


def test_threads_advance_a_stage_which_never_goes_back() -> None:
    told: list[Progress] = []
    progress = StageProgress(told.append)
    advance = progress.count("Key points", 40, "cameras")

    def one(_: int) -> None:
        for _ in range(10):
            advance(0.1)

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(one, range(40)))
    done = [one.done for one in told]
    assert done == sorted(done)
    assert len(set(done)) == 401
    assert done[-1] == pytest.approx(STAGES["Key points"])
    assert told[-1].message == "40 of 40 cameras"


def test_stages_follow_each_other_and_a_late_word_takes_nothing_back() -> None:
    told: list[Progress] = []
    progress = StageProgress(told.append)
    advance = progress.count("Matching", 4, "pairs", last=0.5)
    advance(4.0)
    assert told[-1].done == pytest.approx(STAGES["Key points"] + 0.5 * STAGES["Matching"])
    progress.reach("Adjusting", 1.0)
    assert told[-1].done == pytest.approx(1.0)
    progress.reach("Mapping", 0.0)
    assert told[-1].done == pytest.approx(1.0)


@pytest.mark.slow
def test_every_frame_that_is_read_counts(tmp_path) -> None:
    write_corner(tmp_path)
    shares: list[float] = []
    video = find_videos(tmp_path)[0]
    read_pictures(video, video.source.n_frames, advance=shares.append)
    assert 1 <= len(shares) <= N_BACKGROUND_FRAMES
    assert np.sum(shares) == pytest.approx(1.0)
