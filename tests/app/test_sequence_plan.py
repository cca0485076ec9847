"""train --plan --workers: when clips end, what they move and cost, as text and JSON."""

from __future__ import annotations

import json
import random
import re
from pathlib import Path

import pytest

from app.plan.makespan import ANEW_EVERY_S, Seldom, ends_of
from engine.capture.capture import open_capture
from engine.capture.frame_bytes import frame_bytes
from engine.errors import CaptureError


def test_source_clips_go_to_the_next_free_worker_once_the_reference_is_there() -> None:
    seconds = {0: 10.0, 1: 4.0, 2: 1.0, 3: 2.0, 4: 1.0}
    needs = {clip: (0,) for clip in range(1, 5)}
    assert ends_of(seconds, needs, 1) == {0: 10.0, 1: 14.0, 2: 15.0, 3: 17.0, 4: 18.0}
    assert ends_of(seconds, needs, 2) == {0: 10.0, 2: 11.0, 3: 13.0, 1: 14.0, 4: 14.0}
    assert max(ends_of(seconds, needs, 100).values()) == 14.0
    del seconds[0]  # trained before: nothing to wait for
    assert max(ends_of(seconds, needs, 2).values()) == 4.0
    assert ends_of({}, {}, 3) == {}


@pytest.mark.parametrize("seed", range(20))
def test_it_is_what_a_minute_by_minute_simulation_gives(seed: int) -> None:
    drawn = random.Random(seed)
    seconds = {clip: float(drawn.randrange(1, 9)) for clip in range(12)}
    needs = {clip: [other for other in range(clip) if drawn.random() < 0.2] for clip in range(12)}
    n_workers, left, running, ends = drawn.randrange(1, 5), list(range(12)), {}, {}
    for now in range(200):
        ends |= {clip: float(now) for clip, end in running.items() if end == now}
        running = {clip: end for clip, end in running.items() if end > now}
        for clip in list(left):
            if len(running) < n_workers and all(other in ends for other in needs[clip]):
                running[clip] = now + seconds[clip]
                left.remove(clip)
    assert ends_of(seconds, needs, n_workers) == ends


def test_bytes_are_those_of_the_files_and_figures_agree_with_each_other(run, capture_folder: Path, tmp_path: Path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 1, "--plan")
    code, out, err = run(*arguments, "--workers", 2, "--price-per-hour", 3.6, "--json")
    assert code == 0, err
    document = json.loads(out)
    workers, clips = document["workers"], document["clips"]
    stored = sum(path.stat().st_size for path in capture_folder.rglob("*.jpg"))
    assert sum(clip["moved_mb"] for clip in clips) == pytest.approx(stored / 1e6, abs=1e-3)
    taken = [sum(clip["forecast"][name] for name in ("preparation_s", "training_s")) for clip in clips]
    assert workers["alone_s"] == pytest.approx(taken[0], abs=1e-3)
    assert workers["seconds"] == pytest.approx(taken[0] + 3 * taken[1], abs=0.01)  # five clips on two
    assert workers["busy"] == pytest.approx(sum(taken) / (2 * workers["seconds"]), abs=1e-3)
    assert workers["price"] == pytest.approx(3.6 * workers["worker_hours"], abs=1e-3)
    assert workers["price_per_minute"] == pytest.approx(workers["price"] * 60 / workers["video_s"], rel=1e-2)
    memory = [clip["forecast"]["memory_mb"] for clip in clips]
    assert (workers["memory_mb"], workers["side_by_side_mb"]) == (max(memory), pytest.approx(2 * memory[1]))
    assert workers["shared_mb"] == pytest.approx(3 * 32 * 24 * (3 + 1 / 8) / 1e6, abs=1e-3)
    assert "workers" not in json.loads(run(*arguments, "--json")[1])


def test_the_reference_clip_costs_no_time_once_it_is_trained(run, capture_folder: Path, tmp_path: Path):
    arguments = ("train", capture_folder, "--project", tmp_path / "p", "--clip-length", 3)
    assert run(*arguments, "--clips", "0")[0] == 0
    code, out, err = run(*arguments, "--plan", "--workers", 500)
    assert code == 0, err
    first = r"500 workers, each as fast as this computer: 1 clip, 0\.100 s of video\n"
    assert re.search(first + r"  wall time +\S.*, workers busy 0 % of it\n", out)
    assert "alone" not in out
    moved = r"bytes moved +\S+ MB a clip, \S+ MB once a machine, \S+ MB in all\n"
    assert re.search(moved + r"  worker-hours +\S+, \S+ a minute of video\n$", out)


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--plan", "--price-per-hour", -1), "--price-per-hour is -1.0"),
        (("--plan", "--price-per-hour", "nan"), "--price-per-hour is nan"),
        (("--price-per-hour", 1), "--price-per-hour is of a plan"),
    ],
)
def test_numbers_that_cannot_be_are_bad_input(run, capture_folder: Path, tmp_path: Path, arguments, expected: str):
    code, out, err = run("train", capture_folder, "--project", tmp_path / "p", *arguments)
    assert (code, out) == (2, "")
    assert expected in err
    assert not (tmp_path / "p").exists()


def test_a_file_that_is_gone_is_said(capture_folder: Path, tmp_path: Path):
    import shutil

    folder = Path(shutil.copytree(capture_folder, tmp_path / "copy"))
    capture = open_capture(folder)
    (folder / "ims" / "1" / "000003.jpg").unlink()
    with pytest.raises(CaptureError, match="No such file"):
        frame_bytes(capture)


def test_the_time_left_is_worked_out_anew_now_and_then() -> None:
    clock, asked = [0.0], []

    def work_out() -> float:
        asked.append(clock[0])
        clock[0] += 0.05 if len(asked) > 2 else 0.0
        return float(len(asked))

    left = Seldom(lambda: clock[0])
    assert [left.value((1, 2), work_out) for _ in range(3)] == [1.0, 1.0, 1.0]
    assert left.value((2,), work_out) == 2.0, "other clips train"
    clock[0] = ANEW_EVERY_S
    assert left.value((2,), work_out) == 3.0
    clock[0] += 4.9
    assert left.value((2,), work_out) == 3.0, "it takes 50 ms, so at most every five seconds"
    clock[0] += 0.2
    assert left.value((2,), work_out) == 4.0
