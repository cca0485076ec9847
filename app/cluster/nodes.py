"""The computers of a cluster: what each has, which may be used, and who sits where."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from app.cluster.ray_library import ray_library
from app.cluster.runner import Runner


class ClusterUse(NamedTuple):
    """What a cluster is used for, in the words of its messages.

    Attributes:
        verb, things: As in "train clips".
        each: What takes memory, as in "a clip takes about 2 GB".
        needs_project: Whether a computer is of no use that does not see project and capture: it gets no copies.
    """

    verb: str
    things: str
    each: str
    needs_project: bool


TRAINING = ClusterUse("train", "clips", "a clip", needs_project=False)
MEASURING = ClusterUse("measure", "pictures", "measuring", needs_project=True)


@dataclass(eq=False)
class Node:
    """One computer of a cluster, as Ray counts them.

    Attributes:
        node_id: Ray's name of it.
        name: For people.
        n_cores, memory_bytes: What Ray may hand out there.
        sees_project: Whether project and capture are there under their paths; None before it was asked.
        refused: Why it is not used; empty where it is.
        cpu_kind: See engine.portable.cpu_kind.
        is_alive: Whether Ray still counts it.
        n_clips, n_threads: Taken now.
        shipping: Held while something is sent there, so that nothing is sent twice.
    """

    node_id: str
    name: str
    n_cores: int
    memory_bytes: int
    sees_project: bool | None = None
    refused: str = ""
    cpu_kind: str = ""
    is_alive: bool = True
    n_clips: int = 0
    n_threads: int = 0
    shipping: threading.Lock = field(default_factory=threading.Lock)

    @property
    def is_usable(self) -> bool:
        """Whether clips may be trained, or measured, there."""
        return self.is_alive and self.sees_project is not None and not self.refused

    def n_slots(self, n_bytes: int) -> int:
        """How many clips of that memory fit, each with a core."""
        return min(self.n_cores, self.memory_bytes // max(n_bytes, 1))

    def pinned(self, **options: Any) -> dict[str, Any]:
        """Options of Ray for something that runs there or nowhere."""
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        return options | {"scheduling_strategy": NodeAffinitySchedulingStrategy(self.node_id, soft=False)}


@dataclass(eq=False)
class Seat:
    """The place of one clip.

    Attributes:
        node: The computer.
        n_threads, n_bytes: What is declared for it.
    """

    node: Node
    n_threads: int
    n_bytes: int

    def runner(self) -> Any:
        """Start a Runner there. Ray holds it back until what it needs is free."""
        options = self.node.pinned(num_cpus=self.n_threads, memory=self.n_bytes, max_restarts=0, max_task_retries=0)
        return ray_library().remote(Runner).options(**options).remote()

    def leave(self) -> None:
        """Free it."""
        self.node.n_clips -= 1
        self.node.n_threads -= self.n_threads


def take_seat(nodes: Iterable[Node], n_bytes: int, *, n_beside: int, avoided: Iterable[Node] = ()) -> Seat | None:
    """The best place for a clip: where most cores are free. None while there is none.

    Args:
        n_bytes: Memory it takes.
        n_beside: How many clips share the cluster: alone, it has all cores of a computer.
        avoided: Only where no other computer is usable.
    """
    usable = [node for node in nodes if node.is_usable]
    n_cores = sum(node.n_cores for node in usable)
    usable = [node for node in usable if node not in set(avoided)] or usable
    free = [node for node in usable if node.n_clips < node.n_slots(n_bytes) and node.n_threads < node.n_cores]
    if not free:
        return None
    node = max(free, key=lambda node: node.n_cores - node.n_threads)
    n_threads = min(max(n_cores // max(n_beside, 1), 1), node.n_cores - node.n_threads)
    node.n_clips += 1
    node.n_threads += n_threads
    return Seat(node, n_threads, n_bytes)
