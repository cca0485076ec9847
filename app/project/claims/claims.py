"""Claims: what one process of a project trains, said to all others; and what those train.

Training a clip needs no lock of the project, only the claim of that clip. A thread says every few seconds that this
process lives, and looks at what others say. Whether another one lives is judged by whether its record changes, on this
process's own clock: clocks of computers may differ by any amount. Time counts only while this process looks: where it
was halted, or the disk did not answer, others could not have been heard.
"""

from __future__ import annotations

import logging
import os
import threading
import time
import uuid
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TypeVar

from app.project.claims.asks import Ask, drop_ask, take_ask
from app.project.claims.claim_files import (
    CLAIMS,
    ClaimFile,
    holder_path,
    is_unsurpassed,
    list_claims,
    list_holders,
    make_claim,
    newest_claim,
    remove_claim,
)
from app.project.claims.holder_record import (
    ClipProgress,
    HolderRecord,
    MachineLoad,
    holder_words,
    machine_load,
    read_holder,
    write_holder,
)
from app.project.lock import this_process
from engine.errors import ProjectError
from engine.storage.files import disk_error
from engine.storage.process_space import pid_space

logger = logging.getLogger(__name__)
T = TypeVar("T")

BEAT_EVERY_S = 5.0
LOOK_EVERY_S = 2.0
LOOK_SHARE = 0.05
"""Share of the time that looking may take: where there are hundreds of others, it is done less often."""
DEAD_AFTER_S = 60.0
"""A holder that has said nothing for so long has ended; one that was only slow notices that its claim is lost."""
LONGEST_GAP_S = 10.0
"""Of silence, between two looks, no more counts."""
FRESH_S = 1.0
"""What was said so long ago need not be said again before a clip is put in its place."""
MAX_SAID_AT_ONCE = 16
"""Clips in training up to which the record is written when one more begins; that of hundreds takes a while."""
_MAX_TRIES = 100


class ClipClaimed(ProjectError):
    """Another process trains the clip.

    Attributes:
        is_sure: Whether that one lives for certain; else it may have died, and a minute will tell.
    """

    def __init__(self, message: str, *, hint: str = "", path: Path | None = None, is_sure: bool = True) -> None:
        super().__init__(message, hint=hint, path=path)
        self.is_sure = is_sure


def lost_claim() -> ClipClaimed:
    """The error of a process that was taken for dead, and whose clip another one trains since."""
    return ClipClaimed(
        f"Another program trains this clip, because this one had said nothing for {DEAD_AFTER_S:.0f} s.",
        hint="Nothing is lost: the other one continues.",
    )


def check_claim(folder: Path, key: str, token: str) -> None:
    """Check that no other process has claimed a clip than the one that the caller works for. folder: Of the project.
    token: Of that one; empty where it has claimed nothing.

    Raises:
        ClipClaimed: Another one has.
    """
    if not token:
        return
    with suppress(OSError):
        newest = newest_claim(folder, key)
        if newest is not None and newest.token() not in (token, ""):
            raise lost_claim()


@dataclass(frozen=True, slots=True)
class Elsewhere:
    """A clip that another process trains.

    Attributes:
        key: Of the clip.
        holder: Who trains it; None while that is not known.
        is_dead: Whether the claim may be taken over.
    """

    key: str
    holder: HolderRecord | None = None
    is_dead: bool = False

    @property
    def progress(self) -> ClipProgress | None:
        """How far it is; None while that is not known."""
        return None if self.holder is None else self.holder.clips.get(self.key)

    @property
    def who(self) -> str:
        """The holder as the subject of a sentence."""
        return holder_words(self.holder)


@dataclass(frozen=True, slots=True)
class _Heard:
    """What was seen of a holder last: its state, its silence since then, when that was looked at, and how many states
    went before."""

    state: object
    silent_s: float
    looked_s: float
    n_before: int


def _seconds() -> float:
    """Of a clock that also counts while the computer sleeps, where the system has one."""
    boot_time = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if boot_time is None else time.clock_gettime(boot_time)


class Claims:
    """Claims of one process in one project. Methods are for one thread, but for those said to be for another.

    Args:
        folder: Of the project.
        describe: Called on the thread of the claims: how far the clips in training are, by key.
        clock: Seconds; tests bring their own.
        has_thread: Whether to look and beat by itself; tests call `look`.
    """

    def __init__(
        self,
        folder: Path,
        *,
        describe: Callable[[], Mapping[str, ClipProgress]] = dict,
        clock: Callable[[], float] = _seconds,
        has_thread: bool = True,
    ) -> None:
        self.folder = folder
        self.token = uuid.uuid4().hex
        self._owner = this_process()
        self._describe, self._clock, self._has_thread = describe, clock, has_thread
        self._held: dict[str, ClaimFile] = {}
        self._lost: set[str] = set()
        self._elsewhere: dict[str, Elsewhere] = {}
        self._others: tuple[HolderRecord, ...] = ()
        self._asked: SimpleQueue[tuple[str, Ask]] = SimpleQueue()
        self._changed: SimpleQueue[str] = SimpleQueue()
        self._heard: dict[str, _Heard] = {}  # of holders, by the paths of claims and of records
        self._clip_files: dict[str, int] | None = None
        self._clips_time: int | None = None
        self._is_clips_time_old = False
        self._load = MachineLoad(os.cpu_count() or 1)
        self._beat, self._beaten_s = 0, -BEAT_EVERY_S
        self._said_s, self._was_silent = clock(), False
        self._is_watching = False
        self._guard = threading.RLock()
        self._wake = threading.Event()
        self._thread: threading.Thread | None = None

    # ---------------------------------------------------------------- one's own

    def take(self, key: str) -> None:
        """Claim a clip.

        Raises:
            ClipClaimed: Another process trains it, or may do so.
            DiskError: The disk refused.
        """
        with self._guard:
            if key in self._held:
                return
            try:
                (self.folder / CLAIMS).mkdir(exist_ok=True)  # not the project itself, which may be gone
                if len(self._held) < MAX_SAID_AT_ONCE:  # else with the next beat
                    self._say()
                self._held[key] = self._claimed(key)
            except OSError as error:
                raise disk_error(error, what="The claim of the clip", path=self.folder / CLAIMS) from error
            finally:
                self._be_silent_without_claims()
            if key in self._elsewhere:
                self._elsewhere = {other: known for other, known in self._elsewhere.items() if other != key}
            self._lost.discard(key)
            drop_ask(self.folder, key)
        self._start()

    def _claimed(self, key: str) -> ClaimFile:
        made: ClaimFile | None = None  # by another one, which a listing from the network may not show yet
        for _ in range(_MAX_TRIES):
            newest = newest_claim(self.folder, key)
            if made is not None and (newest is None or newest.number < made.number) and os.path.lexists(made.path):
                newest = made
            if newest is not None:
                other = self._judged(newest)
                if not other.is_dead:
                    self._elsewhere = {**self._elsewhere, key: other}
                    is_sure = other.holder is not None and (other.holder.is_here or self._has_changed(newest))
                    raise ClipClaimed(
                        f"{other.who} trains this clip.", hint="Wait for it, or stop it there.", is_sure=is_sure
                    )
                logger.info("clip %s: the claim of %s is taken over, which has ended", key, other.who)
            claim = ClaimFile(self.folder, key, 1 if newest is None else newest.number + 1)
            if make_claim(claim, self.token):
                return claim
            made = claim
        self._elsewhere = {**self._elsewhere, key: Elsewhere(key)}  # until the next look: nobody tries again at once
        raise ClipClaimed("Other programs claim this clip again and again.", hint="Try again later.")

    def release(self, key: str) -> None:
        """Free a clip, if it is claimed. Never fails."""
        with self._guard:
            claim = self._held.pop(key, None)
            if claim is not None and key not in self._lost and claim.token() == self.token:
                remove_claim(claim)
                drop_ask(self.folder, key)
            self._lost.discard(key)
            self._be_silent_without_claims()
            if not self._held:
                self._wake.set()

    def _be_silent_without_claims(self) -> None:
        if not self._held:
            with suppress(OSError):
                holder_path(self.folder, self.token).unlink(missing_ok=True)

    def is_lost(self, key: str) -> bool:
        """Whether another process has taken over a clip claimed here, for it took this one for dead."""
        return key in self._lost

    def check(self, key: str) -> None:
        """Check, on disk, that a clip is still claimed here. For any thread.

        Raises:
            ClipClaimed: It is not.
        """
        with self._guard:
            if key in self._held:
                if self._clock() - self._said_s >= FRESH_S:  # nobody takes over from one that has just spoken
                    with suppress(OSError):
                        self._say()  # also makes a computer of the network list the folder as it is
                self._check_held(key)
            if key not in self._held or key in self._lost:
                raise lost_claim()

    # ---------------------------------------------------------------- what others do

    @property
    def elsewhere(self) -> Mapping[str, Elsewhere]:
        """Clips that other processes train, by key, as of the last look. Not to be changed."""
        return self._elsewhere

    @property
    def n_holders(self) -> int:
        """How many processes train clips of the project, this one included, as far as their files say."""
        try:
            return len(list_holders(self.folder))
        except OSError:
            return 1

    @property
    def others(self) -> tuple[HolderRecord, ...]:
        """The other processes that train clips, as of the last look."""
        return self._others

    @property
    def load(self) -> MachineLoad:
        """How busy this computer is, as of the last look."""
        return self._load

    def take_asked(self) -> list[tuple[str, Ask]]:
        """What others ask of clips claimed here; each request is given once."""
        return _all_of(self._asked)

    def take_changed(self) -> set[str]:
        """Keys of clips whose finished files came, went or changed since the last call, whoever did it."""
        return set(_all_of(self._changed))

    def watch(self) -> None:
        """Look at what others do, from now on, also while nothing is claimed here. Who only trains needs not: hundreds
        of processes that all look at each other would keep a shared disk from anything else."""
        self._is_watching = True
        self._start()

    def close(self) -> None:
        """Release everything, and let the thread end, which is not waited for: the disk may be slow to answer it."""
        self._is_watching = False
        for key in list(self._held):
            self.release(key)
        self._wake.set()

    # ---------------------------------------------------------------- the thread

    def look(self) -> None:
        """One round: say that this process lives, and see what others do. For the thread of the claims."""
        self.look_after_held()
        try:
            claims = list_claims(self.folder)
            read = cache(read_holder)
            known = {
                key: self._judged(claim, read)
                for key, claim in claims.items()
                if key not in self._held and not self._was_released(claim)
            }
            self._sweep(claims, known)
        except OSError:
            return  # the disk does not answer; what was seen last holds
        elsewhere = {key: other for key, other in known.items() if not other.is_dead}
        said = {other.holder.token: other.holder for other in elsewhere.values() if other.holder is not None}
        with self._guard:
            self._elsewhere = {key: other for key, other in elsewhere.items() if key not in self._held}
            self._others = tuple(said.values())
        self._look_at_clips()

    def _sweep(self, claims: Mapping[str, ClaimFile], known: Mapping[str, Elsewhere]) -> None:
        """Remove claims of the dead, and records of those that claim nothing and say nothing any more. Raises OSError.

        known: Of claims that are not one's own.
        """
        for key, other in known.items():
            if other.is_dead:
                remove_claim(claims[key])
                drop_ask(self.folder, key)
        claiming = {self.token, *(other.holder.token for other in known.values() if other.holder is not None)}
        idle = [holder_path(self.folder, token) for token in list_holders(self.folder) if token not in claiming]
        for path in idle:
            with suppress(OSError):
                if self._silent_s(path, path.stat().st_mtime_ns) >= DEAD_AFTER_S:
                    path.unlink()
        there = {str(path) for path in (*idle, *(claim.path for claim in claims.values()))}
        with self._guard:
            self._heard = {path: heard for path, heard in self._heard.items() if path in there}

    def look_after_held(self) -> None:
        """The part of a round for what is claimed here: say that this process lives, see whether a claim was lost and
        what is asked. Looks at files of these clips only, however many others train."""
        self._load = machine_load()
        with self._guard, suppress(OSError):
            if self._held and self._clock() - self._beaten_s >= BEAT_EVERY_S:
                self._say()
        for key, claim in list(self._held.items()):
            if not is_unsurpassed(claim, self.token):
                with self._guard:
                    self._check_held(key)
            ask = take_ask(self.folder, key)
            if ask is not None:
                self._asked.put((key, ask))

    def _start(self) -> None:
        with self._guard:
            if self._has_thread and self._thread is None:
                self._thread = threading.Thread(target=self._run, name="claims", daemon=True)
                self._thread.start()

    def _is_needed(self) -> bool:
        """Whether the thread goes on; else whoever needs it next starts another."""
        with self._guard:
            if not (self._held or self._is_watching):
                self._thread = None
            return self._thread is not None

    def _run(self) -> None:
        while self._is_needed():
            started_s = time.monotonic()
            try:
                if self._is_watching:
                    self.look()
                else:
                    self.look_after_held()
            except Exception:  # the thread must go on: others take a silent process for dead
                logger.exception("claims could not be looked at")
            took_s = time.monotonic() - started_s
            self._wake.wait(min(max(LOOK_EVERY_S, took_s / LOOK_SHARE), BEAT_EVERY_S))
            self._wake.clear()

    def _say(self) -> None:
        """Write this process's record. Raises OSError."""
        self._beat += 1
        self._beaten_s = now_s = self._clock()
        if self._held and now_s - self._said_s >= DEAD_AFTER_S:
            self._was_silent = True
        path = holder_path(self.folder, self.token)
        record = HolderRecord(self.token, self._owner, pid_space(), self._beat, self._load, dict(self._describe()))
        try:
            write_holder(path, record)
        except OSError:
            with suppress(OSError):
                os.utime(path)  # a full disk keeps nobody from saying that it lives
                self._said_s = now_s
            raise
        self._said_s = now_s

    def _check_held(self, key: str) -> None:
        claim = self._held.get(key)
        if claim is None:
            return
        try:
            newest = newest_claim(self.folder, key)
            if newest is None or newest.number < claim.number:  # removed, by anybody or by one that took it over
                if not self._was_silent and make_claim(claim, self.token):
                    return
                newest = newest_claim(self.folder, key)
        except OSError:
            return
        if newest is None:
            is_lost = self._was_silent
        else:
            is_lost = newest.number > claim.number or newest.token() not in (self.token, "")
        if is_lost:
            self._lost.add(key)

    def _judged(self, claim: ClaimFile, read: Callable[[Path], HolderRecord | None] = read_holder) -> Elsewhere:
        """A claim, and whether its holder has ended. read: Of its record."""
        token = claim.token()
        path = holder_path(self.folder, token) if token else claim.path
        record = read(path) if token else None
        if record is not None and record.is_gone:
            return Elsewhere(claim.key, record, is_dead=True)
        try:
            state: object = (None if record is None else record.beat, path.stat().st_mtime_ns)
        except OSError:
            state = None
        return Elsewhere(claim.key, record, is_dead=self._silent_s(claim.path, state) >= DEAD_AFTER_S)

    def _silent_s(self, path: Path, state: object) -> float:
        """For how long the state of something has not changed, as far as this process looked."""
        with self._guard:
            now_s, before = self._clock(), self._heard.get(str(path))
            if before is None or before.state != state:
                heard = _Heard(state, 0.0, now_s, 0 if before is None else before.n_before + 1)
            else:
                silent_s = before.silent_s + min(now_s - before.looked_s, LONGEST_GAP_S)
                heard = _Heard(state, silent_s, now_s, before.n_before)
            self._heard[str(path)] = heard
            return heard.silent_s

    def _was_released(self, claim: ClaimFile) -> bool:
        """Whether it was one's own, or is gone, since claims were listed."""
        return not claim.path.exists() or claim.token() == self.token

    def _has_changed(self, claim: ClaimFile) -> bool:
        """Whether its holder has been heard of while this process watched."""
        return self._heard[str(claim.path)].n_before > 0

    def _look_at_clips(self) -> None:
        folder = self.folder / "clips"
        try:
            changed_ns = folder.stat().st_mtime_ns
            is_same, self._clips_time = changed_ns == self._clips_time, changed_ns
            if is_same and self._is_clips_time_old:
                return
            self._is_clips_time_old = is_same  # looked at once more: times are coarse
            with os.scandir(folder) as entries:  # a file that replaces another one has another inode
                files = [entry for entry in entries if entry.name.endswith(".safetensors")]
                found = {entry.name.removesuffix(".safetensors"): entry.inode() for entry in files}
        except OSError:
            return
        before, self._clip_files = self._clip_files, found
        if before is not None:
            for key in {*before, *found}:
                if before.get(key) != found.get(key):
                    self._changed.put(key)


def _all_of(waiting: SimpleQueue[T]) -> list[T]:
    """Everything that waits, oldest first."""
    found: list[T] = []
    with suppress(Empty):
        while True:
            found.append(waiting.get_nowait())
    return found
