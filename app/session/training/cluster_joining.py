"""ClusterJoining: clips of the open project train on the computers of a cluster from when the user asks for it.

Knows no cluster: `connect` brings the way to one, and what trains there are workers like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from app.background.jobs import JobContext, Jobs
from app.project.opening.opened_project import OpenedProject
from app.session.notices import Notices
from app.session.part import SessionPart
from app.session.training.live_training import LiveTraining
from app.session.training.train_commands import ClusterCommand, JoinCluster, LeaveCluster
from app.training.service import Launch
from engine.errors import ProjectError

JOINING = "Joining the cluster"


class ClusterConnection(Protocol):
    """A cluster that this process has joined for one project."""

    @property
    def launch(self) -> Launch:
        """Starts the worker of a clip on one of its computers."""
        ...

    @property
    def n_slots(self) -> int:
        """How many clips may train side by side now; cheap."""
        ...

    def close(self) -> None:
        """Let go of it; may take seconds."""
        ...


Connect = Callable[[str, OpenedProject], ClusterConnection]
"""Joins a cluster by its address for a project, which may take minutes. Raises EngineError."""


class ClusterJoining(SessionPart):
    """For one thread, and nothing here waits.

    Attributes:
        address: Of the cluster that clips train on; empty without one.

    Args:
        connect: Joins clusters; None where the program cannot.
        live, jobs, notices: Of the session.
    """

    def __init__(self, connect: Connect | None, live: LiveTraining, jobs: Jobs, notices: Notices) -> None:
        self._connect, self._live, self._jobs, self._notices = connect, live, jobs, notices
        self._opened: OpenedProject | None = None
        self._connection: ClusterConnection | None = None
        self._is_joining = False
        self._left: list[ClusterConnection] = []
        self.address = ""

    @property
    def can_join(self) -> bool:
        """Whether the program can join clusters at all."""
        return self._connect is not None

    def open(self, opened: OpenedProject) -> None:
        """Another project is open, or other settings; a cluster is joined for one project as it is."""
        if self.address:
            self._notices.add("info", f"Clips train on this computer again, not on the cluster {self.address}")
        self._leave()
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    def obey(self, command: ClusterCommand) -> None:
        """Join a cluster, or leave it.

        Raises:
            ProjectError: It cannot be done now; states the cause.
        """
        match command:
            case JoinCluster(address=address):
                self._join(address.strip())
            case LeaveCluster():
                self._check_idle()
                self._leave()

    def _check_idle(self) -> None:
        if self._live.is_busy:
            raise ProjectError("Clips are training.", hint="Stop training first; progress is kept.")

    def _join(self, address: str) -> None:
        connect, opened = self._connect, self._opened
        if connect is None or opened is None:
            raise ProjectError("No capture is open." if opened is None else "This program cannot join clusters.")
        opened.project.check_writable()
        self._check_idle()
        if self._is_joining:
            raise ProjectError("Another cluster is being joined.", hint="Wait until it answers.")
        self._leave()
        self._is_joining = True

        def work(context: JobContext) -> ClusterConnection:
            return connect(address, opened)

        def done(connection: ClusterConnection) -> None:
            self._is_joining = False
            if self._opened is not opened or self._live.is_busy:  # meanwhile another project, or training here
                self._left.append(connection)
                return
            self._connection, self.address = connection, address
            self._live.use(connection.launch, connection.n_slots)
            self._notices.add("info", f"Clips train on the cluster {address}", f"{connection.n_slots} at once.")

        def failed(error: Exception) -> None:
            self._is_joining = False
            self._notices.add_failure(f"The cluster {address} could not be joined", error)

        self._jobs.start(JOINING, work, done, failed)

    def _leave(self) -> None:
        connection, self._connection, self.address = self._connection, None, ""
        if connection is not None:
            self._live.use(None)
            self._left.append(connection)

    def _close(self, connection: ClusterConnection) -> None:
        def failed(error: Exception) -> None:
            self._notices.add_failure("The cluster could not be left properly", error)

        self._jobs.start("Leaving the cluster", lambda context: connection.close(), lambda _: None, failed)

    def poll(self) -> bool:
        """Follow how many clips the cluster has room for; let go of one that was left once nothing trains there."""
        if self._connection is not None:
            self._live.use(self._connection.launch, self._connection.n_slots)
        if self._left and not self._live.is_ending:
            self._close(self._left.pop())
        return False

    def close(self) -> None:
        """Let go of the cluster."""
        for connection in (self._connection, *self._left):
            if connection is not None:
                connection.close()
        self._connection, self._left = None, []
