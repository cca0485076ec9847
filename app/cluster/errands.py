"""What is brought to a computer and back: nothing where it sees the project, else files in both directions."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Generic

from msgspec.structs import replace

from app.cluster.cluster import Cluster
from app.cluster.contents import SentFile, contents_of, job_key, progress_contents
from app.cluster.far_child import NodeRefused, Remote
from app.cluster.mirror import file_digest
from app.cluster.nodes import Node
from app.project.claims.holder_record import machine_name
from app.training.messages import ClipTrained, SnapshotWritten, TrainingFailed, TrainingStopped
from app.training.process import TrainTask
from engine.children.kind import Job
from engine.errors import CaptureError, DiskError
from engine.storage.files import checked_path, disk_error, open_to_append

logger = logging.getLogger(__name__)

PART_BYTES = 4 << 20
CHECKPOINT_EVERY_S = 240.0
"""Between two that are fetched: a lost computer costs at most that much of a clip."""
MAX_LOG_BYTES = 256 << 10


class SharedProject(Generic[Job]):
    """For a computer that sees the project and its capture. See `Errand`.

    Args:
        job: As it is here. Paths are absolute: where it runs there is another working directory.
    """

    def __init__(self, job: Job) -> None:
        self._job = job

    def begin(self, remote: Remote) -> Job:
        """See `Errand`."""
        return self._job

    def receive(self, remote: Remote, events: Sequence[Any]) -> None:
        """See `Errand`."""

    def keep(self, remote: Remote, *, timeout_s: float) -> None:
        """See `Errand`."""


class CopiedProject:
    """For a computer that does not: it works on a copy. See `Errand`.

    Args:
        cluster: Counts the bytes.
        node: The computer.
        task: As it is here.
        is_whole: Send every picture, not only those of the clip.
        report: Told how far sending is, 0..1.
    """

    def __init__(
        self, cluster: Cluster, node: Node, task: TrainTask, *, is_whole: bool, report: Callable[[float], None]
    ) -> None:
        self._cluster, self._node, self._task, self._is_whole, self._report = cluster, node, task, is_whole, report
        self._files = cluster.project.files(task.job.clip_index)
        self._fetched_s = time.monotonic()
        self._checkpoint = ""

    def begin(self, remote: Remote) -> TrainTask:
        """See `Errand`. Raises CaptureError where the capture is another one there."""
        project, job = self._cluster.project, self._task.job
        with ExitStack() as kept:
            folder = Path(kept.enter_context(TemporaryDirectory(prefix="clipgstream-cluster-")))
            kept.enter_context(self._node.shipping)
            try:
                contents = contents_of(project, self._cluster.capture, job, folder, is_whole=self._is_whole)
                there = Path(remote.call("mirror", job_key(project, job)))
                self._send(remote, contents)
                step, progress = progress_contents(project, job)
                if remote.call("build", _names(contents), job.key) < step:
                    self._send(remote, progress)
                    remote.call("build", _names([*contents, *progress]), job.key)
            except OSError as error:
                raise CaptureError(f"A file cannot be read ({error.strerror}).", path=error.filename) from error
        if remote.call("fingerprint", project.settings.is_growing) != job.fingerprint:
            raise CaptureError("The copy of the capture is not understood as the capture is here.")
        log = there / "project" / "logs" / self._files.log.name
        return replace(self._task, project=there / "project", capture=there / "capture", log=log)

    def receive(self, remote: Remote, events: Sequence[Any]) -> None:
        """See `Errand`."""
        for event in events:
            match event:
                case ClipTrained():
                    self._fetch_rows(remote)
                    if not self._fetch(remote, self._files.handed_over, "The clip"):
                        raise DiskError("The trained clip was removed before it was fetched.", hint="Train it again.")
                    self._fetch_log(remote)
                    remote.call("forget")
                    sent, received = (
                        count.get(self._task.job.clip_index, 0) / 1e6
                        for count in (self._cluster.bytes_sent, self._cluster.bytes_received)
                    )
                    clip, name = self._task.job.clip_index, self._node.name
                    logger.info("clip %d: %.2f MB sent to %s, %.2f MB received", clip, sent, name, received)
                case SnapshotWritten(revision=revision):
                    self._fetch(remote, self._files.snapshot(revision), "A snapshot")
                case TrainingStopped(is_kept=True) | TrainingFailed():
                    self._fetch_progress(remote)
                    self._fetch_log(remote)
                case TrainingStopped():
                    self._cluster.project.discard_progress(self._task.job.clip_index)
                    remote.call("forget")
                case _:
                    pass
        if time.monotonic() - self._fetched_s > CHECKPOINT_EVERY_S:
            self._fetch_progress(remote)

    def keep(self, remote: Remote, *, timeout_s: float) -> None:
        """See `Errand`."""
        self._fetch_progress(remote, timeout_s=timeout_s)

    # ---------------------------------------------------------------- there

    def _send(self, remote: Remote, contents: Sequence[SentFile]) -> None:
        """Send what is not there yet."""
        by_digest = {content.digest: content for content in contents}
        wanted = [by_digest[digest] for digest in remote.call("missing", list(by_digest))]
        n_bytes, n_sent = sum(content.n_bytes for content in wanted), 0
        for parts in _packed(_parts(wanted)):
            remote.call("put", parts)
            n_sent += sum(len(data) for _, _, data, _ in parts)
            self._report(n_sent / max(n_bytes, 1))
        sent = self._cluster.bytes_sent
        sent[self._task.job.clip_index] = sent.get(self._task.job.clip_index, 0) + n_sent

    # ---------------------------------------------------------------- and back

    def _fetch_progress(self, remote: Remote, *, timeout_s: float | None = None) -> None:
        self._fetched_s = time.monotonic()
        with suppress(DiskError, NodeRefused):  # the next one may fit again; the other computer still has it
            digest = remote.call("digest", self._name(self._files.checkpoint), timeout_s=timeout_s)
            if digest and digest != self._checkpoint:
                self._fetch_rows(remote, timeout_s=timeout_s)
                self._fetch(remote, self._files.checkpoint, "The checkpoint", timeout_s=timeout_s)
                self._checkpoint = digest

    def _fetch_rows(self, remote: Remote, *, timeout_s: float | None = None) -> None:
        with suppress(DiskError, NodeRefused):  # curves are not worth a clip
            self._fetch(remote, self._files.unfinished_metrics, "The curves", timeout_s=timeout_s)

    def _fetch(self, remote: Remote, path: Path, what: str, *, timeout_s: float | None = None) -> bool:
        """Put a file of the copy in its place here. Whether there was one. Raises DiskError."""
        name = self._name(path)
        digest = remote.call("digest", name, timeout_s=timeout_s)
        if not digest:
            return False
        with checked_path(path, what=what, is_durable=True) as partial:
            with open(partial, "wb") as file:
                for data in self._read(remote, name, timeout_s=timeout_s):
                    file.write(data)
            if file_digest(partial) != digest:
                raise disk_error(OSError(0, "it arrived damaged"), what=what, path=path)
        return True

    def _fetch_log(self, remote: Remote) -> None:
        said = b"".join(self._read(remote, self._name(self._files.log)))[-MAX_LOG_BYTES:]
        with suppress(OSError):
            self._files.log.parent.mkdir(exist_ok=True)
            with open(open_to_append(self._files.log), "ab") as file:
                file.write(f"--- on {self._node.name}, driven from {machine_name()}\n".encode() + said)

    def _read(self, remote: Remote, name: str, *, timeout_s: float | None = None) -> Iterator[bytes]:
        offset, received = 0, self._cluster.bytes_received
        while data := remote.call("read", name, offset, PART_BYTES, timeout_s=timeout_s):
            offset += len(data)
            yield data
        received[self._task.job.clip_index] = received.get(self._task.job.clip_index, 0) + offset

    def _name(self, path: Path) -> str:
        return path.relative_to(self._cluster.project.folder).as_posix()


def _names(contents: Sequence[SentFile]) -> list[tuple[str, str]]:
    return [(content.name, content.digest) for content in contents]


def _parts(contents: Sequence[SentFile]) -> Iterator[tuple[str, int, bytes, bool]]:
    for content in contents:
        offset = 0
        with open(content.path, "rb") as file:
            while True:
                data = file.read(min(PART_BYTES, content.n_bytes - offset))
                is_last = offset + len(data) >= content.n_bytes or not data
                yield content.digest, offset, data, is_last
                offset += len(data)
                if is_last:
                    break


def _packed(parts: Iterator[tuple[str, int, bytes, bool]]) -> Iterator[list[tuple[str, int, bytes, bool]]]:
    """Parts in groups of about PART_BYTES: a capture may have thousands of small files."""
    group, n_bytes = [], 0
    for part in parts:
        group.append(part)
        n_bytes += len(part[2])
        if n_bytes >= PART_BYTES:
            yield group
            group, n_bytes = [], 0
    if group:
        yield group
