"""Measuring on a cluster: the figures of one process, also where a computer is lost; and who takes no part."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.cli.cli import main
from app.cluster.nodes import Node, Seat, take_seat
from app.evaluation import cluster_measuring
from app.evaluation.cluster_measuring import MAX_LOST, ClusterMeasuring
from app.evaluation.kept_figures import EVALUATIONS
from app.evaluation.measuring_children import MeasuringLost
from engine.errors import ProjectError
from tests.app.cluster.clusters import BlindCluster, add_node, ray_nodes
from tests.app.evaluation.test_kept_figures import make_project
from tests.app.evaluation.test_measuring_children import InlineChild, measured

pytest.importorskip("ray", reason="Ray is an extra: pip install clipgstream[cluster]")


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_project(tmp_path_factory.mktemp("far"), n_cameras=5)


@pytest.fixture(autouse=True)
def _nothing_kept(project: Path) -> Iterator[None]:
    yield
    forget(project)


def forget(project: Path) -> None:
    for path in (project / EVALUATIONS).glob("*"):
        path.unlink()


class MadeUpCluster:
    """Computers that are not there: two cores on each of two."""

    def __init__(self, address: str, project: Any, capture: Any, *, n_bytes: int, use: Any) -> None:
        self.project, self._n_bytes = project, n_bytes
        self.nodes = [Node(name, name, 2, 1 << 40, sees_project=True) for name in ("red", "green")]
        self.words, self.n_slots, self.is_closed = ["it is made up"], 4, False

    def seat_for(self, *, n_beside: int, avoided: Any) -> Seat | None:
        return take_seat(self.nodes, self._n_bytes, n_beside=n_beside, avoided=avoided)

    def take_notes(self) -> list[str]:
        return []

    def close(self) -> None:
        self.is_closed = True
        assert not any(node.n_clips or node.n_threads for node in self.nodes), "all have left their seats"


class FarInlineChild(InlineChild):
    """One of those on green dies after a few answers."""

    started: list[FarInlineChild]
    n_before_death = 4

    def __init__(self, kind: Any, *, seat: Seat, errand: Any, environment: Any) -> None:
        is_doomed = seat.node.name == "green"
        super().__init__(kind, errand.begin(SimpleNamespace()), self.n_before_death if is_doomed else 10_000)
        self.node, self.fault = seat.node.name, "lost" if is_doomed else ""
        self.started.append(self)


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> list[FarInlineChild]:
    monkeypatch.setattr(cluster_measuring, "Cluster", MadeUpCluster)
    monkeypatch.setattr(cluster_measuring, "FarChild", FarInlineChild)
    monkeypatch.setattr(FarInlineChild, "started", [], raising=False)
    return FarInlineChild.started


def test_where_processes_are_lost_the_others_measure_what_is_missing(project: Path, made_up) -> None:
    alone, said = measured(project), []
    forget(project)
    with ClusterMeasuring("auto", said.append) as measuring:
        assert measured(project, measuring) == alone
    assert {child.node for child in made_up[:4]} == {"red", "green"}
    assert {child.node for child in made_up[4:]} == {"red"}, "green was lost before"
    assert all(Path(child.task.project).is_absolute() and child.task.n_threads == 1 for child in made_up)
    assert len(said) == 2
    assert "measured elsewhere" in said[1]
    lines = b"".join(path.read_bytes() for path in (project / EVALUATIONS).iterdir()).splitlines()
    assert len(lines) == len(set(lines)), "nothing twice"
    with ClusterMeasuring("auto", said.append) as measuring:
        assert measured(project, measuring) == alone
    assert len(said) == 2, "nothing was missing, so no cluster was joined"


def test_processes_that_are_always_lost_end_it_and_what_they_measured_is_kept(
    project: Path, made_up, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MadeUpCluster, "seat_for", lambda self, **_: take_seat(self.nodes[1:], 1, n_beside=4))
    with (
        pytest.raises(MeasuringLost, match="Figures measured so far are kept"),
        ClusterMeasuring("auto", lambda sentence: None) as measuring,
    ):
        measured(project, measuring)
    assert len(made_up) == 2 * (MAX_LOST + 1)
    assert all(child.is_ended for child in made_up)
    assert (project / EVALUATIONS / "0000-quick-float.jsonl").read_bytes().count(b"\n") > MAX_LOST


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--cluster", "nowhere"], "'nowhere', which is not the address of a cluster"),
        (["--cluster", "local:2", "--workers", "2"], "not allowed with argument"),
    ],
)
def test_bad_options_are_refused_at_once(project: Path, given: list[str], said: str, capsys) -> None:
    assert main(["eval", str(project), "--json", "-", *given]) == 2
    assert said in capsys.readouterr().err
    assert main(["report", str(project), *given]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_two_nodes_of_which_one_is_lost(project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alone, said = measured(project), []
    forget(project)
    compiled = os.environ.get("XDG_CACHE_HOME", str(Path.home() / ".cache"))  # or each would compile kernels anew
    with ray_nodes(1, tmp_path, XDG_CACHE_HOME=compiled) as nodes:
        running = [add_node(nodes, Path(compiled))]
        with ClusterMeasuring(nodes.address, said.append) as measuring:

            def watched(*arguments: Any) -> Iterator[Any]:
                for item in measuring(*arguments):
                    while running:
                        nodes.remove_node(running.pop(), allow_graceful=False)
                    yield item

            assert measured(project, watched) == alone
        assert said[0] == "Note: the cluster measures 2 pictures at once, on 2 computers"
        assert any("What it has not sent is measured elsewhere." in sentence for sentence in said[1:])
        forget(project)
        monkeypatch.setattr(cluster_measuring, "Cluster", BlindCluster)
        with (
            pytest.raises(ProjectError, match=r"can measure pictures: .* does not see the project and its capture \("),
            ClusterMeasuring(nodes.address, said.append) as measuring,
        ):
            measured(project, measuring)
    assert not list((project / "live").glob("*"))
