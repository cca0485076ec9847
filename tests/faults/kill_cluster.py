"""Kills workers, nodes and drivers of trainings on a Ray cluster at random moments: no clip is lost, none is damaged.

python -m tests.faults.kill_cluster --kills 50 --seed 1

Rounds of one project each, of six clips that take a few seconds. Every other round the nodes work on copies of the
project. A killed driver is started again, a killed node is replaced. At the end of a round every clip has to be what
an undisturbed training makes, and nothing may be left over.
Linux only: processes are found in /proc.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from app.cluster.cluster import Cluster
from app.project.opening.opened_project import opened_project
from app.project.opening.project_access import create_project, default_settings, open_project
from app.training.service import TrainingService
from engine.capture.capture import open_capture
from engine.clip_files.clip_state import read_clip_state
from engine.errors import EngineError
from tests.app.cluster.clusters import BlindCluster, add_node, driving, ray_nodes
from tests.app.fakes import make_fake, write_capture
from tests.app.inline_worker import InlineWorker
from tests.faults.trainings import ROOT, _processes_of

KINDS = ("worker", "runner", "node", "driver")
N_CLIPS = 6
N_STEPS = 15
N_NODES = 3
LONGEST_S = 6.0
LONGEST_RUN_S = 600.0
GIVEN_UP = 75
"""Exit code of a driver that has tried a clip as often as it does; the next one resumes."""


@dataclass
class KillTally:
    """What was done and what was wrong."""

    kills: Counter[str] = field(default_factory=Counter)
    n_rounds: int = 0
    n_given_up: int = 0
    faults: list[str] = field(default_factory=list)

    def line(self) -> str:
        """All of it in one line."""
        kinds = ", ".join(f"{n} {kind}" for kind, n in sorted(self.kills.items()))
        return (
            f"{sum(self.kills.values())} kills ({kinds}) in {self.n_rounds} rounds: {len(self.faults)} faults; "
            f"{self.n_given_up} times a clip was hit more often than one driver tries it, and the next one resumed"
        )


def make(folder: Path, capture_folder: Path) -> None:
    """A project of six clips, nothing trained."""
    capture = open_capture(capture_folder)
    settings = replace(default_settings(capture, clip_length=1), overrides={"joint_steps": N_STEPS})
    create_project(folder, settings).close()


def fingerprints(folder: Path) -> list[str]:
    """Of all clips. Raises EngineError for a damaged one, and OSError."""
    return [read_clip_state(folder / "clips" / f"{clip:04d}.safetensors").fingerprint for clip in range(N_CLIPS)]


def undisturbed(folder: Path, capture_folder: Path) -> list[str]:
    """What one worker makes of the clips."""
    make(folder, capture_folder)
    project, capture = open_project(folder), open_capture(capture_folder)
    opened = opened_project(capture, project, 1)
    service = TrainingService(
        project,
        opened.clips,
        holdout=opened.holdout,
        launch=lambda job, project: InlineWorker(job, project.folder, make_fake),
        is_window_open=False,
    )
    service.enqueue_all(range(N_CLIPS))
    while service.is_busy:
        service.poll()
    service.close()
    project.close()
    return fingerprints(folder)


def drive(address: str, folder: Path, *, is_blind: bool) -> None:
    """The process of a driver: train what is missing."""
    project = open_project(folder)
    opened = opened_project(open_capture(Path(project.settings.capture)), project, 1)
    with driving(opened, address, kind=BlindCluster if is_blind else Cluster) as driver:
        driver.service.enqueue_all(range(N_CLIPS))
        driver.run_out()
    is_done = all(project.is_trained(index) for index in range(N_CLIPS))
    project.close()
    if not is_done:
        sys.exit(GIVEN_UP)


class ClusterKillTest:
    """Rounds on one Ray cluster.

    Args:
        work: An empty folder.
        made: The cluster, of N_NODES nodes with `work / "scratch"` as their temporary folder.
        rng: Chooses moments and kinds.
    """

    def __init__(self, work: Path, made: Any, *, rng: random.Random) -> None:
        self._work, self._made, self._rng = work, made, rng
        self._capture = write_capture(work / "ring")
        self._expected = undisturbed(work / "undisturbed", self._capture)
        self._deck: list[str] = []
        self.tally = KillTally()

    def run(self, n_kills: int) -> None:
        """Kill so often, then let the last project finish."""
        while sum(self.tally.kills.values()) < n_kills and not self.tally.faults:
            self.tally.n_rounds += 1
            self._round(self._work / f"round-{self.tally.n_rounds}", n_kills)

    def _round(self, folder: Path, n_kills: int) -> None:
        make(folder, self._capture)
        began_s, is_blind = time.monotonic(), self.tally.n_rounds % 2 == 0
        driver = self._driver(folder, is_blind=is_blind)
        while True:
            code = self._waited(driver, folder, is_last=sum(self.tally.kills.values()) >= n_kills)
            if code == 0:
                break
            if code == GIVEN_UP:
                self.tally.n_given_up += 1
                driver = self._driver(folder, is_blind=is_blind)
                continue
            if code is not None:
                said = (self._work / "stderr.txt").read_text(errors="replace")
                self.tally.faults.append(f"{folder.name}: the driver ended with {code}: {said[-1500:]}")
                return
            if time.monotonic() - began_s > LONGEST_RUN_S:
                driver.kill()
                self.tally.faults.append(f"{folder.name}: not finished after {LONGEST_RUN_S:.0f} s")
                return
            if sum(self.tally.kills.values()) < n_kills and self._kill(driver) == "driver":
                driver = self._driver(folder, is_blind=is_blind)
        self._check(folder)

    def _driver(self, folder: Path, *, is_blind: bool) -> subprocess.Popen[bytes]:
        code = "from tests.faults.kill_cluster import drive; from pathlib import Path; "
        code += f"drive({self._made.address!r}, Path({str(folder)!r}), is_blind={is_blind})"
        paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
        environment = {**os.environ, "PYTHONPATH": paths, "TMPDIR": str(self._work / "scratch")}
        with open(self._work / "stderr.txt", "wb") as errors:
            return subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, env=environment, stderr=errors)

    def _waited(self, driver: subprocess.Popen[bytes], folder: Path, *, is_last: bool) -> int | None:
        """Wait until something is trained, and a random time more. The driver's code where it has ended."""
        until_s = time.monotonic() + LONGEST_RUN_S
        while not is_last and driver.poll() is None and time.monotonic() < until_s:
            if any((folder / "claims").glob("*.0*")):
                until_s = min(until_s, time.monotonic() + self._rng.uniform(0.0, LONGEST_S))
                is_last = True
            time.sleep(0.05)
        with suppress(subprocess.TimeoutExpired):
            return driver.wait(max(until_s - time.monotonic(), 0.0))
        return driver.poll()

    def _kill(self, driver: subprocess.Popen[bytes]) -> str:
        if not self._deck:  # as many of each
            self._deck = self._rng.sample(KINDS, len(KINDS))
        kind = self._deck.pop()
        if kind == "driver":
            driver.kill()
            driver.wait()
        elif kind == "node":
            nodes = sorted(self._made.worker_nodes, key=lambda node: node.node_id)
            self._made.remove_node(self._rng.choice(nodes), allow_graceful=False)
            add_node(
                self._made, self._work / f"cache-{sum(self.tally.kills.values())}", TMPDIR=str(self._work / "scratch")
            )
        else:
            mark = "app.training.process" if kind == "worker" else "ray::Runner"
            found = [pid for pid, name in _processes_of(self._work / "scratch") if mark in name]
            if not found:
                self._deck.append(kind)
                return ""
            with suppress(ProcessLookupError):
                os.kill(self._rng.choice(found), signal.SIGKILL)
        self.tally.kills[kind] += 1
        return kind

    def _check(self, folder: Path) -> None:
        until_s = time.monotonic() + LONGEST_RUN_S
        while any("app.training.process" in name for _, name in _processes_of(self._work / "scratch")):  # orphans
            if time.monotonic() > until_s:
                self.tally.faults.append(f"{folder.name}: a worker still trains {LONGEST_RUN_S:.0f} s after the end")
                break
            time.sleep(0.1)
        try:
            if fingerprints(folder) != self._expected:
                self.tally.faults.append(f"{folder.name}: clips differ from those of an undisturbed training")
        except (OSError, EngineError) as error:
            self.tally.faults.append(f"{folder.name}: {error}")
        left = [*folder.glob("checkpoints/*"), *folder.glob("live/*"), *folder.glob("claims/*")]
        versions = [*folder.glob("versions/*")]
        self.tally.faults += [f"{folder.name}: left over: {path.relative_to(folder)}" for path in left]
        self.tally.faults += [f"{folder.name}: trained twice: {path.relative_to(folder)}" for path in versions]


def run(n_kills: int, seed: int) -> KillTally:
    """So many kills."""
    with tempfile.TemporaryDirectory(prefix="kill-cluster-") as name:
        work = Path(name)
        (work / "scratch").mkdir()
        with ray_nodes(N_NODES, work / "caches", TMPDIR=str(work / "scratch")) as made:
            test = ClusterKillTest(work, made, rng=random.Random(seed))
            test.run(n_kills)
            return test.tally


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    tally = run(options.kills, options.seed)
    print(tally.line())
    for fault in tally.faults:
        print(fault)
    return 1 if tally.faults else 0


if __name__ == "__main__":
    sys.exit(main())
