"""Regions that the user marks as static or dynamic, in the window and on the command line: the list, its words, and
the clips it reaches. `Marking` keeps the list of the open project; its files are read and written on a thread.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field

from app.background.latest import LatestWorker
from app.project.project import Project
from app.session.commands import EditCommand, MarkRegion, RedoMark, RemoveRegion, UndoMark
from app.status import ClipStatus, RegionsStatus
from engine.errors import EngineError, ProjectError
from engine.gate.regions import GateRegion, sphere_region

logger = logging.getLogger(__name__)

STARTED = ("preparing", "training", "paused", "stopped", "trained")
"""States of clips that have taken their regions already."""
MAX_UNDO = 100
SETTLE_S = 2.0
"""A disk that takes longer than this to write a few lines is not waited for."""


def after_marking(regions: Sequence[GateRegion], marks: Sequence[GateRegion]) -> tuple[GateRegion, ...]:
    """The list with new marks, which overrule what was marked before."""
    return (*regions, *marks)


def region_text(region: GateRegion) -> str:
    """A region in words and numbers."""

    def point(values: tuple[float, float, float]) -> str:
        return "(" + ", ".join(f"{value:.5g}" for value in values) + ")"

    if region.radius > 0.0:
        return f"{region.treat} in the sphere of {region.radius:.5g} around {point(region.center)}"
    return f"{region.treat} in the box from {point(region.low)} to {point(region.high)}"


def effect_text(started: Sequence[int], *, gate: str) -> str:
    """In which clips regions take effect. started: Clips whose training has started."""
    if gate == "off":
        return "Without effect here: the clips of this project are trained without a gate (gate=off)."
    text = "Marks apply to clips whose training starts from now on."
    if not started:
        return text
    names = _clip_names(sorted(started))
    if len(started) == 1:
        return f"{text} {names} has started already: it stays as it is until it is trained again."
    return f"{text} {names} have started already: they stay as they are until they are trained again."


def _clip_names(indices: Sequence[int]) -> str:
    """Sorted indices in words: "Clip 3", "Clips 0 to 2, 5"."""
    runs: list[list[int]] = []
    for index in indices:
        if runs and index == runs[-1][-1] + 1:
            runs[-1].append(index)
        else:
            runs.append([index])
    words = ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)
    return f"Clip{'s' if len(indices) > 1 else ''} {words}"


@dataclass(frozen=True, slots=True)
class RegionsRequest:
    """Keep these regions in the project, or read its own.

    Attributes:
        number: Of the request; a later one is another request even with the same regions.
        regions: None reads.
    """

    number: int
    regions: tuple[GateRegion, ...] | None
    project: Project = field(compare=False)


class Marking:
    """The regions of the open project and the way back. For one thread, which never waits for the disk.

    A change holds at once and reaches the disk a moment later; `settle` waits for that, before a training reads it.
    """

    def __init__(self) -> None:
        self._files: LatestWorker[RegionsRequest, tuple[GateRegion, ...]] = LatestWorker("regions", _keep_or_read)
        self._project: Project | None = None
        self._regions: tuple[GateRegion, ...] = ()
        self._past: list[tuple[GateRegion, ...]] = []
        self._future: list[tuple[GateRegion, ...]] = []
        self._number = 0
        self._awaited: int | None = None
        self._problem = ""

    def open(self, project: Project) -> None:
        """Take another project; its regions are there a moment later."""
        self.leave()
        self._project = project
        self._read()

    def leave(self) -> None:
        """Let go of the project once everything is kept."""
        self._settle_for_good()
        self._files.forget()
        self._project, self._regions, self._past, self._future = None, (), [], []
        self._awaited, self._problem = None, ""

    # ---------------------------------------------------------------- changes

    def apply(self, command: EditCommand) -> None:
        """Carry out a command.

        Raises:
            ProjectError: It cannot be done now, or makes no sense.
        """
        match command:
            case MarkRegion(treat=treat, center=center, radius=radius):
                self.mark(treat, center, radius)
            case RemoveRegion(index=index):
                self.remove(index)
            case UndoMark():
                self.undo()
            case RedoMark():
                self.redo()

    def mark(self, treat: str, center: Sequence[float], radius: float) -> None:
        """Mark a sphere.

        Raises:
            ProjectError: It is not a sphere, or nothing can be marked now.
        """
        self._change(after_marking(self._regions, [sphere_region(treat, center, radius)]))

    def remove(self, index: int) -> None:
        """Forget one region.

        Raises:
            ProjectError: There is no such region, or nothing can be changed now.
        """
        if not 0 <= index < len(self._regions):
            raise ProjectError(f"There is no region {index + 1}; {len(self._regions)} are marked.")
        self._change((*self._regions[:index], *self._regions[index + 1 :]))

    def undo(self) -> None:
        """Take back the last change since the project was opened; nothing happens without one.

        Raises:
            ProjectError: Nothing can be changed now.
        """
        if self._past:
            now, future = self._regions, self._future
            self._change(self._past[-1])
            del self._past[-2:]  # what was just undone, and the way back to it
            self._future = [*future, now]

    def redo(self) -> None:
        """Do again what was taken back last; nothing happens when nothing was, or when something else was done since.

        Raises:
            ProjectError: Nothing can be changed now.
        """
        if self._future:
            future = self._future
            self._change(future[-1])
            self._future = future[:-1]

    def _change(self, regions: tuple[GateRegion, ...]) -> None:
        project = self._checked()
        self._past = [*self._past, self._regions][-MAX_UNDO:]
        self._regions, self._future = regions, []
        self._number += 1
        self._files.request(RegionsRequest(self._number, regions, project))

    def _checked(self) -> Project:
        """The project, if something can be changed in it.

        Raises:
            ProjectError: Not now; says why.
        """
        if self._project is None:
            raise ProjectError("No capture is open.", hint="Open a capture first; its project keeps the regions.")
        self._project.check_writable()
        if self._problem:
            raise ProjectError(self._problem)
        if self._awaited is not None:
            raise ProjectError("The regions marked before are still being read.", hint="Try again in a moment.")
        return self._project

    # ---------------------------------------------------------------- files

    def _read(self) -> None:
        assert self._project is not None
        self._number += 1
        self._awaited, self._past, self._future = self._number, [], []
        self._files.request(RegionsRequest(self._number, None, self._project))

    def take_error(self) -> tuple[RegionsRequest, Exception] | None:
        """The last failure, once. After one of writing, what the project holds is read again."""
        found = self._files.take_error()
        if found is None or self._project is None or found[0].project is not self._project:
            return None
        request, error = found
        if request.regions is not None:
            self._read()
        elif request.number == self._awaited:
            self._awaited, self._problem = None, _sentence(error)
        return found

    def poll(self) -> bool:
        """Take in what was read. Whether there was something."""
        newest = self._files.newest
        if newest is None or newest[0].number != self._awaited:
            return False
        self._regions, self._awaited = newest[1], None
        return True

    def settle(self) -> None:
        """Wait until what was marked is on disk; longer than a moment only where the disk is at fault."""
        self._files.wait_idle(SETTLE_S)

    def close(self) -> None:
        """Keep what was marked, end the thread."""
        self._settle_for_good()
        self._files.close()

    def _settle_for_good(self) -> None:
        self.settle()
        found = self._files.take_error()
        if found is not None:  # nobody will ask any more
            logger.error("the marked regions could not be read or kept: %s", found[1])

    # ---------------------------------------------------------------- status

    def status(self, clips: Sequence[ClipStatus]) -> RegionsStatus:
        """Everything as one value. clips: Of the project."""
        why_not = ""
        try:
            project = self._checked()
        except ProjectError as error:
            project, why_not = self._project, _sentence(error)
        started = [index for index, clip in enumerate(clips) if clip.state in STARTED]
        return RegionsStatus(
            regions=self._regions,
            can_mark=not why_not,
            why_not=why_not,
            can_undo=bool(self._past) and not why_not,
            can_redo=bool(self._future) and not why_not,
            effect="" if project is None else effect_text(started, gate=project.settings.config().gate),
        )


def _sentence(error: Exception) -> str:
    """Cause and hint in one line, without the path: the panel that shows it is narrow."""
    return f"{error.message} {error.hint}".strip() if isinstance(error, EngineError) else str(error)


def _keep_or_read(request: RegionsRequest) -> tuple[GateRegion, ...]:
    if request.regions is None:
        return request.project.gate_regions()
    request.project.set_gate_regions(request.regions)
    return request.regions
