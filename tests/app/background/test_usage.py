"""What processes use: read from the system, sampled at most once a second, missing where it is not known."""

from __future__ import annotations

import os
import sys

import pytest

from app.background.usage import ProcessUsage, UsageMeter, read_usage


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems do not tell")
def test_this_process_is_read_as_the_system_says() -> None:
    usage = read_usage()
    assert usage.memory_mb is not None
    assert usage.cpu_s is not None
    assert 5 < usage.memory_mb < 100_000
    assert usage.cpu_s == pytest.approx(sum(os.times()[:2]), abs=0.5)
    assert read_usage(os.getpid()).memory_mb == pytest.approx(usage.memory_mb, rel=0.2)


def test_a_process_that_has_ended_is_not_known() -> None:
    assert read_usage(2**22 + 5) == ProcessUsage()


def test_a_system_that_says_nothing_gives_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.platform", "win32")
    assert read_usage(1) == ProcessUsage()
    usage = read_usage()
    assert usage.memory_mb is None
    assert usage.cpu_s is not None


def test_it_is_sampled_once_a_second_and_counts_cores() -> None:
    now_s = [100.0]
    used = {None: 3.0, 77: 50.0}
    n_read = []

    def read(pid: int | None) -> ProcessUsage:
        n_read.append(pid)
        return ProcessUsage(100.0, used[pid])

    meter = UsageMeter(lambda: now_s[0], read)
    first = meter.sample((77,))
    assert (first.window_mb, first.training_mb, first.window_cores) == (100.0, 100.0, None)
    now_s[0] += 0.5
    assert meter.sample((77,)) is first
    assert len(n_read) == 2
    now_s[0] += 1.5
    used[None] += 0.5
    used[77] += 3.0
    second = meter.sample((77,))
    assert (second.window_cores, second.training_cores) == (0.25, 1.5)
    now_s[0] += 2.0
    ended = meter.sample(())
    assert (ended.training_mb, ended.training_cores) == (None, None)
