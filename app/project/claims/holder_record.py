"""HolderRecord: what a process that trains clips says of itself, for all that share the project's folder."""

from __future__ import annotations

import os
import platform
from contextlib import suppress
from pathlib import Path

from msgspec import Struct, to_builtins

from app.project.lock import LockOwner
from engine.machine import free_memory_bytes
from engine.storage.files import atomic_path
from engine.storage.json_files import JsonError, json_text, read_json_object
from engine.storage.process_space import boot_id, pid_space
from engine.storage.typed_json import EntryError, to_type

SCHEMA = 1
MAX_HOLDER_BYTES = 4_000_000
"""A driver with a thousand clips in training says less; a longer file is something else."""


class MachineLoad(Struct, frozen=True):
    """How busy a computer is.

    Attributes:
        n_cores: Of it.
        load: Processes that want to run, a mean over the last minute; None where the system does not say.
        free_mb: Memory that can still be had, 10^6 bytes; None where the system does not say.
    """

    n_cores: int = 1
    load: float | None = None
    free_mb: float | None = None


class ClipProgress(Struct, frozen=True):
    """How far one clip in training is.

    Attributes:
        clip_index: As clips are cut where it trains.
        state: As of a ClipRun: starting, preparing, running, paused or stopping.
        machine: Name of the computer that trains it, which need not be the holder's.
        stage: In words.
        step, n_steps: Of its optimiser; zeros while it is prepared.
        steps_per_s: 0 where unknown.
        eta_s: Seconds until it is finished; None where unknown.
        held_out_psnr: dB; None where not measured yet.
        since_s: For how long it trains already.
        load: Of that computer, where it is not the holder's; None where it is, or is not known.
    """

    clip_index: int
    state: str = "starting"
    machine: str = ""
    stage: str = ""
    step: int = 0
    n_steps: int = 0
    steps_per_s: float = 0.0
    eta_s: float | None = None
    held_out_psnr: float | None = None
    since_s: float = 0.0
    load: MachineLoad | None = None


class HolderRecord(Struct, frozen=True):
    """A process that trains clips.

    Attributes:
        token: Names it in claims; made up at its start.
        owner: Which process it is, and on which computer.
        space: Of its process id; containers of one computer count processes apart.
        beat: Grows as long as it lives.
        load: Of its computer.
        clips: The clips in training, by key.
    """

    token: str
    owner: LockOwner
    space: str = ""
    beat: int = 0
    load: MachineLoad = MachineLoad()
    clips: dict[str, ClipProgress] = {}
    schema: int = SCHEMA

    @property
    def is_here(self) -> bool:
        """Whether this computer knows if it lives. Computers made from one image may have one name and one id: where
        the system numbers its starts, only the same start is this computer."""
        is_other_start = bool(boot_id()) and self.owner.boot != boot_id()
        return bool(self.owner.host) and not is_other_start and self.owner.is_here and self.space == pid_space()

    @property
    def is_gone(self) -> bool:
        """Whether it is certain that it has ended."""
        return self.is_here and not self.owner.is_alive


def machine_load() -> MachineLoad:
    """Of this computer."""
    load, free = None, free_memory_bytes()
    with suppress(OSError, AttributeError):  # AttributeError: Windows
        load = os.getloadavg()[0]
    return MachineLoad(os.cpu_count() or 1, load, None if free is None else free / 1e6)


def holder_words(holder: HolderRecord | None) -> str:
    """A process that trains clips as the subject of a sentence. holder: None where it is not known."""
    return "Another program" if holder is None else holder.owner.words()


def machine_name() -> str:
    """Of this computer, as others call it."""
    return platform.node() or "this computer"


def write_holder(path: Path, record: HolderRecord) -> None:
    """Write the record, atomically. Raises OSError."""
    with atomic_path(path, makes_parents=False) as partial:
        partial.write_text(json_text(to_builtins(record)), encoding="utf-8")


def read_holder(path: Path) -> HolderRecord | None:
    """The record of a process; None where there is none, or one that no program of ours can have written."""
    try:
        return to_type(read_json_object(path, max_bytes=MAX_HOLDER_BYTES), HolderRecord)
    except (OSError, JsonError, EntryError):
        return None
