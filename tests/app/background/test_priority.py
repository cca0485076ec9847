"""Priorities: a thread steps back alone, and the density of a cloud that the window draws is measured right."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from app.playback.point_spacing import point_spacing
from engine.children.priority import lower_thread


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has a niceness per thread")
def test_only_the_calling_thread_steps_back() -> None:
    before = os.getpriority(os.PRIO_PROCESS, 0)
    wanted = min(before + 3, 19)
    seen: list[int] = []

    def work() -> None:
        lower_thread(wanted)
        seen.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [wanted]
    assert os.getpriority(os.PRIO_PROCESS, threading.main_thread().native_id or 0) == before


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux has a class for what nobody waits for")
def test_an_idle_process_and_its_threads_compute_with_what_nobody_else_wants() -> None:
    code = """
import os, threading
from engine.children.priority import idle_process
idle_process()
show = lambda: print(os.getpriority(os.PRIO_PROCESS, 0), os.sched_getscheduler(0) == os.SCHED_IDLE)
show()
thread = threading.Thread(target=show); thread.start(); thread.join()
"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert said.splitlines() == ["19 True", "19 True"]


def test_the_spacing_of_a_grid_is_its_step() -> None:
    axis = np.arange(12) * 0.25
    grid = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3).astype(np.float32)
    assert point_spacing(grid) == pytest.approx(0.25)
    assert point_spacing(grid[:1]) == 0.0
