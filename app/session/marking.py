"""Regions that the user marks as static or dynamic, in the window and on the command line: the list, its words, and
the clips it reaches. `Marking` holds the list of the open project.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from app.session.editing.kept_document import KeptDocument
from app.session.editing.mark_commands import MarkBox, MarkCommand, MarkRegion, RemoveRegion
from app.status import ClipStatus, RegionsStatus
from engine.errors import ProjectError
from engine.gate.regions import GateRegion, parse_region, sphere_region

STARTED = ("preparing", "training", "paused", "stopped", "trained")
"""States of clips that have taken their regions already."""


def after_marking(regions: Sequence[GateRegion], marks: Sequence[GateRegion]) -> tuple[GateRegion, ...]:
    """The list with new marks, which overrule earlier ones."""
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
        return "No effect here: this project is trained without a gate (gate=off)."
    text = "Marks apply to clips trained from now on."
    if not started:
        return text
    names = _clip_names(sorted(started))
    if len(started) == 1:
        return f"{text} {names} has already started and does not change until retrained."
    return f"{text} {names} have already started and do not change until retrained."


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


class Marking:
    """The regions of the open project. For one thread. document: Holds and keeps them."""

    def __init__(self, document: KeptDocument) -> None:
        self._document = document

    @property
    def regions(self) -> tuple[GateRegion, ...]:
        """Those of the open project; none without one."""
        content = self._document.content
        return () if content is None else content.regions

    def apply(self, command: MarkCommand) -> None:
        """Carry out a command.

        Raises:
            ProjectError: It cannot be done now, or is not valid.
        """
        match command:
            case MarkRegion(treat=treat, center=center, radius=radius):
                self._change(after_marking(self.regions, [sphere_region(treat, center, radius)]), "mark a region")
            case MarkBox(treat=treat, low=low, high=high):
                box = parse_region({"treat": treat, "box": [list(low), list(high)]})
                self._change(after_marking(self.regions, [box]), "mark a region")
            case RemoveRegion(index=index):
                self.remove(index)

    def remove(self, index: int) -> None:
        """Forget one region.

        Raises:
            ProjectError: There is no such region, or nothing can be changed now.
        """
        regions = self.regions
        if not 0 <= index < len(regions):
            raise ProjectError(f"There is no region {index + 1}; {len(regions)} are marked.")
        self._change((*regions[:index], *regions[index + 1 :]), "remove a region")

    def _change(self, regions: tuple[GateRegion, ...], name: str) -> None:
        self._document.change(replace(self._document.checked().document, regions=regions), name)

    def status(self, clips: Sequence[ClipStatus]) -> RegionsStatus:
        """Everything as one value. clips: Of the project."""
        why_not, project = self._document.why_not(), self._document.project
        started = [index for index, clip in enumerate(clips) if clip.state in STARTED]
        return RegionsStatus(
            regions=self.regions,
            can_mark=not why_not,
            why_not=why_not,
            effect="" if project is None else effect_text(started, gate=project.settings.config().gate),
        )
