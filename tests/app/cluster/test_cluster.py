"""Clips on a Ray cluster of several nodes on this computer."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.cluster import cluster as cluster_module
from app.evaluation.headless import train_clips
from app.project.opening.opened_project import OpenedProject, opened_project
from app.training.messages import TrainingFailed, WarningRaised
from engine.clip_files.clip_state import read_clip_header, read_clip_state
from engine.errors import ProjectError
from tests.app.cluster.clusters import HOLDS_AT, BlindCluster, Driver, add_node, driving, ray_nodes
from tests.app.training.test_side_by_side import make_service
from tests.app.training.test_train_queue import run_out

pytest.importorskip("ray", reason="Ray is an extra: pip install clipgstream[cluster]")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def caches(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("caches")


@pytest.fixture(scope="module")
def ray_cluster(caches: Path) -> Iterator[Any]:
    with ray_nodes(3, caches) as made:
        yield made


def clips_of_one(make_opened: Any, name: str = "p", n_steps: int = 6) -> OpenedProject:
    """Six clips of one frame."""
    opened = make_opened(name)
    settings = replace(opened.project.settings, clip_length=1, overrides={"joint_steps": n_steps})
    opened.project.update(settings)
    return opened_project(opened.capture, opened.project, 1)


def fingerprints(opened: OpenedProject) -> list[str]:
    return [read_clip_state(opened.project.clip_path(index)).fingerprint for index in range(len(opened.clips))]


def alone(make_opened: Any, n_steps: int = 6) -> list[str]:
    """What one worker of this computer makes of the same clips."""
    opened = clips_of_one(make_opened, "alone", n_steps)
    service = make_service(opened)
    service.enqueue_all(range(6))
    run_out(service)
    return fingerprints(opened)


def warnings(driver: Driver) -> str:
    return "\n".join(f"{event.title}. {event.detail}" for _, event in driver.events if isinstance(event, WarningRaised))


@pytest.mark.parametrize("kind", [cluster_module.Cluster, BlindCluster])
def test_a_lost_node_costs_no_clip(ray_cluster, caches, make_opened, kind) -> None:
    opened, n_steps = clips_of_one(make_opened, n_steps=12), 12
    doomed = add_node(ray_cluster, caches / "doomed", **{HOLDS_AT: "3"})
    with driving(opened, ray_cluster.address, kind=kind) as driver:
        assert driver.cluster.n_slots == 4
        driver.service.enqueue_all(range(6))
        driver.poll_until(lambda: bool(driver.on_node(doomed.node_id)) and 0 not in driver.service.runs)
        (lost,) = driver.on_node(doomed.node_id)
        driver.poll_until(lambda: driver.service.runs[lost].step > 1)
        assert driver.service.runs[lost].load is not None, "how busy its computer is"
        ray_cluster.remove_node(doomed, allow_graceful=False)
        driver.run_out()
        sent, received = driver.cluster.bytes_sent, driver.cluster.bytes_received
    assert sorted(driver.trained) == [0, 1, 2, 3, 4, 5], "each once"
    assert f"Clip {lost} resumes" in warnings(driver)
    assert fingerprints(opened) == alone(make_opened, n_steps)
    assert not list((opened.project.folder / "versions").glob("*")), "none was trained twice"
    assert not list(opened.project.live_dir.glob("*"))
    assert bool(sent) == bool(received) == (kind is BlindCluster)


def test_a_copy_is_sent_once_and_gives_the_same_curves(ray_cluster, make_opened, caches) -> None:
    opened = clips_of_one(make_opened)
    n_bytes = sum(path.stat().st_size for path in opened.capture.path.rglob("*") if path.is_file())
    with driving(opened, ray_cluster.address, kind=BlindCluster) as driver:
        driver.service.enqueue_all(range(6))
        driver.run_out()
        sent = sum(driver.cluster.bytes_sent.values())
        results = sum(opened.project.clip_path(index).stat().st_size for index in range(6))
        received = sum(driver.cluster.bytes_received.values())
    reference = opened.project.clip_path(0).stat().st_size
    assert sent <= 3 * (n_bytes + reference) + 20_000, "nothing twice to one node"
    assert results <= received <= 1.2 * results + 50_000
    for index in range(6):
        assert opened.project.metrics_path(index).is_file()
        assert "on " in opened.project.log_path(index).read_text()
    left = [path for path in caches.glob("*/ClipGStream/cluster/work/*/*") if "doomed" not in path.parts]
    assert not left, "copies of finished clips go, but for those of a computer that was lost in another test"


def test_ctrl_c_keeps_progress_and_the_next_run_resumes(ray_cluster, make_opened) -> None:
    for kind, name in ((cluster_module.Cluster, "shared"), (BlindCluster, "copied")):
        opened = clips_of_one(make_opened, name, n_steps=10_000)  # more than anybody waits for
        with driving(opened, ray_cluster.address, kind=kind) as driver:

            def interrupt(seconds: float, driver: Driver = driver) -> None:
                if any(run.step >= 3 for run in driver.service.runs.values()):
                    raise KeyboardInterrupt

            def nothing(*_: object) -> None:
                pass

            with pytest.raises(KeyboardInterrupt):
                train_clips(
                    driver.service, [0], on_status=nothing, on_event=nothing, on_outcome=nothing, sleep=interrupt
                )
            kept = read_clip_header(opened.project.checkpoint_path(0))
            assert kept is not None, name
            assert kept.step >= 3
            driver.service.enqueue(0)
            driver.poll_until(lambda: bool(driver.service.runs) and driver.service.runs[0].last_step is not None)
            assert driver.service.runs[0].step >= kept.step


def test_a_node_without_room_gets_no_more_clips(ray_cluster, make_opened, caches) -> None:
    (caches / "full").write_text("not a folder")
    full = add_node(ray_cluster, caches / "full")
    try:
        opened = clips_of_one(make_opened)
        with driving(opened, ray_cluster.address, kind=BlindCluster) as driver:
            driver.service.enqueue_all(range(6))
            driver.run_out()
        assert sorted(driver.trained) == [0, 1, 2, 3, 4, 5]
        assert "gets no clips: it has no room" in warnings(driver)
    finally:
        ray_cluster.remove_node(full)


def test_a_worker_that_dies_again_and_again_fails_in_the_end(ray_cluster, make_opened) -> None:
    opened = clips_of_one(make_opened)
    with driving(opened, ray_cluster.address, make="tests.app.fakes:make_crashing") as driver:
        driver.service.enqueue(0)
        driver.run_out()
    assert warnings(driver).count("Clip 0 resumes") == 3
    assert driver.service.queue.failed == {0: "The worker ended unexpectedly."}


def test_a_training_that_fails_is_not_tried_elsewhere(ray_cluster, make_opened) -> None:
    opened = clips_of_one(make_opened)
    settings = replace(opened.project.settings, overrides={"static_steps": 1})  # the fake fails then
    opened.project.update(settings)
    with driving(opened, ray_cluster.address, make="tests.app.fakes:make_fake") as driver:
        driver.service.enqueue(0)
        driver.run_out()
    (failed,) = (event for _, event in driver.events if isinstance(event, TrainingFailed))
    assert failed.kind == "NonFiniteLoss"
    assert not warnings(driver)


def test_nodes_of_another_version_are_refused(ray_cluster, make_opened, monkeypatch) -> None:
    opened = clips_of_one(make_opened)
    monkeypatch.setattr(cluster_module, "difference", lambda there: f"has numba {there['numba']} (here 0.1)")
    with (
        pytest.raises(ProjectError, match=r"No computer of the cluster can train .* has numba [\d.]+ \(here 0\.1"),
        driving(opened, ray_cluster.address),
    ):
        pass
    assert not list(opened.project.live_dir.glob("*"))


def test_nodes_of_too_little_memory_are_refused(ray_cluster, make_opened, monkeypatch) -> None:
    opened = clips_of_one(make_opened)
    monkeypatch.setattr("tests.app.cluster.clusters.N_BYTES", 10**15)
    with (
        pytest.raises(ProjectError, match=r"GB of memory, and a clip takes about 1000000\.0 GB"),
        driving(opened, ray_cluster.address),
    ):
        pass
