"""A few rounds of use by a program; `make soak` does an hour of them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.soak.held import Growth, Held, growths, held_now
from tests.soak.soak import MAX_GROWTH

pytestmark = [
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="what is held is read from /proc"),
]
ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_a_few_rounds_hold_no_more_handles_and_threads(tmp_path):
    """In a process of its own: what other tests hold does not count. Memory needs the long one: caches still fill."""
    program = (
        "import time\n"
        "from pathlib import Path\n"
        "from tests.soak.held import held_now\n"
        "from tests.soak.soak import Soak\n"
        "if __name__ == '__main__':\n"
        f"    folder = Path({str(tmp_path)!r})\n"
        "    soak = Soak(folder, has_window=False, rounds_of_a_session=2, n_seeks=6, is_preloading=False)\n"
        "    samples = [soak.round() for _ in range(5)]\n"
        "    counts = [[held.handles, held.threads] for held in samples]\n"
        "    until_s = time.monotonic() + 120.0\n"
        "    while counts[-1] > counts[2] and time.monotonic() < until_s:  # threads that end have not ended yet\n"
        "        soak._draw(1)\n"
        "        time.sleep(0.1)\n"
        "        counts[-1] = [(held := held_now()).handles, held.threads]\n"
        "    soak.close()\n"
        "    print(counts)\n"
    )
    script = tmp_path / "few_rounds.py"
    script.write_text(program)
    folders = {name: str(tmp_path / name.lower()) for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME")}
    done = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, **folders, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    held = [tuple(pair) for pair in json.loads(done.stdout.splitlines()[-1])]
    assert held[-1] <= held[2], held  # the same moment of a session, one session later
    assert held[-1][0] < 40, held


def test_growth_is_seen_whatever_the_noise():
    """A guard that cannot fail guards nothing."""

    def samples(growth_mb: float) -> list[Held]:
        return [Held(400.0 + growth_mb * n + 5.0 * (n % 3), 14 + n % 2, 20, 1, 1000) for n in range(60)]

    def memory(found: list[Growth]) -> float:
        return next(growth.share for growth in found if growth.name == "memory_mb")

    assert memory(growths(samples(0.0), warm_up=12)) == pytest.approx(0.0, abs=1e-3)
    assert memory(growths(samples(1.0), warm_up=12)) > MAX_GROWTH
    assert [growth.name for growth in growths(samples(0.0), warm_up=12) if growth.share > MAX_GROWTH] == []


@pytest.mark.slow
def test_what_is_not_closed_is_counted(tmp_path):
    before = held_now()
    files = [(tmp_path / f"{n}.txt").open("w") for n in range(7)]
    assert held_now().handles == before.handles + 7
    for file in files:
        file.close()
    assert held_now().handles == before.handles
    block = bytearray(64 << 20)
    block[::4096] = b"x" * len(block[::4096])
    assert held_now().memory_mb > before.memory_mb + 50
    del block
    assert held_now().memory_mb < before.memory_mb + 32
