"""Cluster: the computers that Ray knows, looked at before they get clips, and watched while they work on them."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Collection
from contextlib import ExitStack, suppress
from queue import Empty, SimpleQueue
from typing import Any

from app.cluster.connecting import connect
from app.cluster.nodes import TRAINING, ClusterUse, Node, Seat, take_seat
from app.cluster.ray_library import check_ray, ray_library
from app.cluster.runner import look_around
from app.cluster.versions import difference
from app.project.project import Project
from engine.capture.capture import Capture
from engine.errors import EngineError, ProjectError, TrainingError
from engine.portable import NATIVE, Processor
from engine.storage.files import discard, disk_error, partial_path

logger = logging.getLogger(__name__)

LOOK_TIMEOUT_S = 90.0
WATCH_EVERY_S = 2.0


class Cluster:
    """See the module docstring. Close it at the end.

    Args:
        address: "auto", "HOST:PORT" of a running cluster of which this computer is part, or "local:N".
        project, capture: What is trained, or measured.
        n_bytes: Memory of a training.
        use: What it is for.
        cpu: With the instructions of which processor its computers compute.

    Attributes:
        bytes_sent, bytes_received: Of clips that were trained where the project is not seen, by clip.

    Raises:
        ProjectError: Ray is not installed, the address is wrong, or no computer can be used.
        TrainingError: The cluster does not answer.
    """

    def __init__(
        self,
        address: str,
        project: Project,
        capture: Capture,
        *,
        n_bytes: int,
        use: ClusterUse = TRAINING,
        cpu: Processor = NATIVE,
    ) -> None:
        self.project, self.capture, self.n_bytes, self._use, self._cpu = project, capture, n_bytes, use, cpu
        self.bytes_sent: dict[int, int] = {}
        self.bytes_received: dict[int, int] = {}
        self._nodes: dict[str, Node] = {}
        self._looks: dict[Any, tuple[Node, float]] = {}
        self._notes: SimpleQueue[str] = SimpleQueue()
        self._guard, self._is_closing = threading.RLock(), threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="cluster", daemon=True)
        self._kept = ExitStack()
        check_ray()
        try:
            connect(address, self._kept)
            self._ray = ray_library()
            self._kept.callback(self._ray.shutdown)
            self._nonce = secrets.token_hex(16)
            # of a name that the next one to open the project sweeps where this process has died
            self._probe = partial_path(project.live_dir.absolute() / f"probe-{self._nonce}")
            self._write_probe()
            self._kept.callback(discard, self._probe)
            self._look_until_known()
        except BaseException:
            self.close()
            raise
        self._watcher.start()

    def close(self) -> None:
        """Let go of the cluster; one that was started here ends."""
        self._is_closing.set()
        if self._watcher.is_alive():
            self._watcher.join(WATCH_EVERY_S)
        self._kept.close()

    def _write_probe(self) -> None:
        try:
            self._probe.parent.mkdir(exist_ok=True)
            self._probe.write_text(self._nonce, "ascii")
        except OSError as error:
            raise disk_error(error, what="A file for the other computers to find", path=self._probe) from error

    # ---------------------------------------------------------------- places

    @property
    def nodes(self) -> list[Node]:
        """All computers that were ever part of it."""
        with self._guard:
            return list(self._nodes.values())

    @property
    def words(self) -> list[str]:
        """Sentences about its computers without a full stop, for the user."""
        usable = [node for node in self.nodes if node.is_usable]
        copied = [node.name for node in usable if not node.sees_project]
        n, of, things = self.n_slots, len(usable), self._use.things
        n_things = f"{n} {things if n > 1 else things.removesuffix('s')}"
        found = [f"the cluster {self._use.verb}s {n_things} at once, on {of} computer{'s' * (of > 1)}"]
        if len({node.cpu_kind for node in usable}) > 1:
            found.append(f"their processors differ, so last digits depend on which of them {self._use.verb}s what")
        if copied:
            found.append(f"what a clip needs is copied to {', '.join(copied)}, where the project cannot be seen")
        return found

    @property
    def n_slots(self) -> int:
        """How many clips may train side by side now."""
        return max(sum(node.n_slots(self.n_bytes) for node in self.nodes if node.is_usable), 1)

    @property
    def n_cores(self) -> int:
        """Cores that its clips divide."""
        return max(sum(node.n_cores for node in self.nodes if node.is_usable), 1)

    def seat_for(self, *, n_beside: int, avoided: Collection[Node] = ()) -> Seat | None:
        """See `take_seat`.

        Raises:
            TrainingError: No computer is left.
        """
        with self._guard:
            if not any(node.is_usable for node in self._nodes.values()) and not self._looks:
                raise self._nobody()
            return take_seat(self._nodes.values(), self.n_bytes, n_beside=n_beside, avoided=avoided)

    def refuse(self, node: Node, why: str) -> None:
        """A computer is not used any more. why: Follows its name, without a full stop."""
        with self._guard:
            if not node.refused:
                node.refused = why
                self._note(f"{node.name} gets no {self._use.things}: it {why}")

    def take_notes(self) -> list[str]:
        """What happened to computers since the last call, in sentences without a full stop."""
        found = list[str]()
        with suppress(Empty):
            while True:
                found.append(self._notes.get_nowait())
        return found

    def _note(self, text: str) -> None:
        logger.warning("%s", text)
        self._notes.put(text)

    def _nobody(self) -> EngineError:
        said = [f"{node.name} {node.refused or 'is gone'}" for node in self._nodes.values()]
        listed = "; ".join(dict.fromkeys(said)) or "it has none with free cores"
        what = f"{self._use.verb} {self._use.things}"
        return TrainingError(f"No computer of the cluster can {what}: {listed}.", hint="Progress is kept.")

    # ---------------------------------------------------------------- looking

    def _look_until_known(self) -> None:
        while True:
            self._look()
            if not self._looks:
                break
            time.sleep(0.1)
        if not any(node.is_usable for node in self.nodes):
            error = self._nobody()
            raise ProjectError(error.message, hint="Change that there, or use other computers; see docs/cluster.md.")

    def _watch(self) -> None:
        while not self._is_closing.wait(WATCH_EVERY_S):
            try:
                self._look()
            except Exception as error:  # noqa: BLE001 - the thread has to live; what trains notices a lost cluster itself
                logger.warning("the cluster could not be looked at: %s", error)

    def _look(self) -> None:
        """Ask new computers, take in their answers, and notice those that are gone."""
        known = self._ray.nodes()
        with self._guard:
            for found in known:
                self._meet(found)
            for reference, (node, since_s) in list(self._looks.items()):
                if self._ray.wait([reference], timeout=0)[0]:
                    del self._looks[reference]
                    self._judge(node, reference)
                elif time.monotonic() - since_s > LOOK_TIMEOUT_S:
                    del self._looks[reference]
                    self.refuse(node, f"did not answer for {LOOK_TIMEOUT_S:.0f} s")

    def _meet(self, found: dict[str, Any]) -> None:
        node = self._nodes.get(found["NodeID"])
        if node is not None:
            if node.is_alive and not found["Alive"]:
                self._note(f"{node.name} is gone; its {self._use.things} resume elsewhere")
            node.is_alive = found["Alive"]
            return
        resources = found.get("Resources", {})
        if not found["Alive"] or resources.get("CPU", 0) < 1:
            return
        name = f"{found['NodeManagerHostname']} ({found['NodeManagerAddress']})"
        node = Node(found["NodeID"], name, int(resources["CPU"]), int(resources.get("memory", 0)))
        self._nodes[node.node_id] = node
        self.ask(node)

    def ask(self, node: Node) -> None:
        """Ask a computer, once more, whether it sees the project; it gets no clips before it has answered."""
        settings = self.project.settings
        look = self._ray.remote(look_around).options(**node.pinned(num_cpus=0, max_retries=0))
        seen = settings.capture, settings.follow_links, settings.is_growing
        answer = look.remote(str(self._probe), self._nonce, *seen, self._cpu)
        with self._guard:
            node.sees_project = None
            self._looks[answer] = node, time.monotonic()

    def _judge(self, node: Node, reference: Any) -> None:
        try:
            found = self._ray.get(reference)
        except self._ray.exceptions.RayError as error:
            logger.warning("%s: %s", node.name, error)
            self.refuse(node, "could not run ClipGStream, which has to be installed there in the same version")
            return
        node.n_cores = min(node.n_cores, found["cores"])
        is_same = found["fingerprint"] == self.project.settings.fingerprint
        node.sees_project = found["sees"] and is_same
        why = found.get("why", "" if is_same else "the capture is another one there")
        other, node.cpu_kind = difference(found["versions"]), found.get("cpu", "")
        if other:
            self.refuse(node, other)
        elif "no_cpu" in found:
            self.refuse(node, f"cannot compute as asked: {found['no_cpu'].rstrip('.')}")
        elif why and self._use.needs_project:
            self.refuse(node, f"does not see the project and its capture ({why})")
        elif node.n_slots(self.n_bytes) < 1:
            has, needs = node.memory_bytes / 1e9, self.n_bytes / 1e9
            self.refuse(node, f"has {has:.1f} GB of memory, and {self._use.each} takes about {needs:.1f} GB")
        logger.info("%s: %d cores, %s", node.name, node.n_cores, why or "sees project and capture")

    def document(self) -> dict[str, Any]:
        """For `train --json`."""
        return {
            "nodes": [
                {"name": node.name, "n_cores": node.n_cores, "is_shared": bool(node.sees_project), "why": node.refused}
                for node in self.nodes
            ],
            "bytes_sent": sum(self.bytes_sent.values()),
            "bytes_received": sum(self.bytes_received.values()),
        }
