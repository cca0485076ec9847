"""Kills of trainings on a cluster, a few of them; `python -m tests.faults.kill_cluster` does many."""

from __future__ import annotations

import sys

import pytest

from tests.faults import kill_cluster

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="processes are found in /proc"),
]


def test_killed_workers_nodes_and_drivers_cost_no_clip() -> None:
    pytest.importorskip("ray", reason="Ray is an extra: pip install clipgstream[cluster]")
    tally = kill_cluster.run(4, seed=1)
    assert tally.faults == []
    assert set(tally.kills) == set(kill_cluster.KINDS)
