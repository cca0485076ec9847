"""ClipCatalog: what the files of a project say of each clip: finished, stopped half way, out of date, damaged, nothing.

Read once when a project is opened, in one pass and on any thread; kept up to date clip by clip. Knows no worker.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.project.clips.header_cache import FoundHeader
from app.project.clips.metrics_file import read_metrics
from app.project.project import Project
from engine.capture.exclusions import exclusion_key
from engine.clip_files.clip_header import ClipHeader
from engine.clip_files.roles import REFERENCE_ROLES

_ROLE_REASONS = {
    "source": "It was trained with another reference clip; now it is the reference itself.",
    "reference": "It was trained as the reference, which is now clip {}.",
}
"""Why a clip is out of date that was trained before another clip was made the reference."""
REPORT_EVERY = 32
"""Clips read between two reports of progress."""


@dataclass(frozen=True, slots=True)
class ClipRecord:
    """One clip as it lies on disk. A value.

    Attributes:
        state: untrained; stopped, with a checkpoint that its training continues from; trained; stale, trained on
            something that no longer exists; damaged, a finished clip that cannot be read.
        step, n_steps: Of the state that is shown.
        held_out_psnr: dB: an evaluation's where there is one, else the training's last one; None when not
            measured.
        held_out_whole: Whether that is over all frames in all held-out cameras; else it is over at most three pictures.
        file: The state to show; None when there is none.
        revision: Names that state; empty when there is none.
        resume_step: The step that training this clip continues from; None when it starts from the beginning.
        resume_n_steps: Steps of that training.
        reason: Why it is stale or damaged, what became of its checkpoint, or that it was trained with other pictures;
            empty otherwise.
        blocked_by: A damaged clip without which this one cannot be trained.
        seconds: Duration of its training; None where not recorded.
        exposure_change: How far the cameras' exposure is from the reference clip's, a share; None where not known.
        n_anchors: Inherited ones, and those of the clip itself; zeros where the file does not say.
        origin: By which edits name the anchors of a trained clip, see ClipHeader.origin; empty of others.
        inherits: The same of those that a trained clip inherits; empty where it has its own only.
    """

    state: str = "untrained"
    step: int = 0
    n_steps: int = 0
    held_out_psnr: float | None = None
    file: Path | None = None
    revision: str = ""
    resume_step: int | None = None
    resume_n_steps: int = 0
    reason: str = ""
    blocked_by: int | None = None
    seconds: float | None = None
    exposure_change: float | None = None
    n_anchors: tuple[int, int] = (0, 0)
    origin: str = ""
    inherits: str = ""
    held_out_whole: bool = False

    @property
    def is_due(self) -> bool:
        """Whether it is not finished and up to date, and can be trained. A damaged one is for the user to decide on."""
        return self.state not in ("trained", "damaged") and self.blocked_by is None


@dataclass(frozen=True, slots=True)
class Basis:
    """Whether what a clip was trained on still is what it was.

    Attributes:
        reason: Why not; empty when all is well.
        blocked_by: The damaged clip that is to blame.
    """

    reason: str = ""
    blocked_by: int | None = None


class ClipCatalog:
    """The records of all clips. One thread changes it.

    Attributes:
        order: Indices of the clips as they are trained.
        due: Those that are due, see ClipRecord.is_due.
        revision: Grows with every change.

    Args:
        project: Whose clips.
        n_clips: Number of clips of the capture.
        report: Receives the number of clips read so far, from time to time.
        only: Clips to look at, for who trains one of thousands; the others count as untrained. All when None.
    """

    def __init__(
        self,
        project: Project,
        n_clips: int,
        report: Callable[[int], None] = lambda n_read: None,
        *,
        only: Collection[int] | None = None,
    ) -> None:
        self._project = project
        self.order = project.training_order(n_clips)
        self._after = dict(itertools.pairwise(self.order))
        self._before = {after: before for before, after in self._after.items()}
        self.due: set[int] = set()
        self.revision = 0
        self._clips: list[FoundHeader | None] = [None] * n_clips
        self._checkpoints: list[FoundHeader | None] = [None] * n_clips
        self._curve_psnr: dict[int, float | None] = {}
        self._evaluated: dict[int, tuple[str, float]] = {}
        config = project.settings.config()
        self._inherits, self._goes_on = not config.independent, config.follows_previous
        self._read_all(range(n_clips) if only is None else only, report)
        self._judge_all()

    def extend(self, n_clips: int) -> None:
        """The capture has grown: there are so many clips now, the present ones first."""
        later = range(len(self._clips), n_clips)
        self.order = self._project.training_order(n_clips)
        self._after = dict(itertools.pairwise(self.order))
        self._before = {after: before for before, after in self._after.items()}
        self._clips += [None] * len(later)
        self._checkpoints += [None] * len(later)
        self._read_all(later)
        self.judge_anew()

    def _read_all(self, indices: Collection[int], report: Callable[[int], None] = lambda n_read: None) -> None:
        if self._project.has_progress:
            for index in indices:
                if index % REPORT_EVERY == 0:
                    report(index)
                self._read(index)

    def __len__(self) -> int:
        return len(self._records)

    def __getitem__(self, clip_index: int) -> ClipRecord:
        return self._records[clip_index]

    @property
    def records(self) -> Sequence[ClipRecord]:
        """All of them; one is another object once it has changed."""
        return self._records

    @property
    def finished(self) -> list[int]:
        """Clips with a finished file that can be read, up to date or not, in order."""
        return [index for index in range(len(self)) if self._good(index) is not None]

    @property
    def n_trained(self) -> int:
        """Clips that are finished, readable and up to date."""
        return self._n_trained

    @property
    def has_finished_clips(self) -> bool:
        """Whether there is any clip; see Project.has_finished_clips."""
        return self._has_finished_clips

    def update(self, clip_index: int) -> None:
        """Read the files of one clip again; others that depend on it are judged anew by what was read before."""
        self._read(clip_index)
        self._judge(clip_index)
        self.revision += 1

    def judge_anew(self) -> None:
        """The document has changed: judge all clips by what was read before."""
        self._judge_all()
        self.revision += 1

    def note_evaluated(self, psnr: Sequence[float | None]) -> None:
        """Take up what an evaluation says of the clips as they are now.

        Args:
            psnr: Held-out PSNR of each, over all frames in all held-out cameras, dB; None where not all are measured.
        """
        found = {
            index: (self[index].revision, value)
            for index, value in enumerate(psnr)
            if value is not None and self[index].state == "trained"
        }
        if found != self._evaluated:
            self._evaluated = found
            self.judge_anew()

    def note_damage(self, path: Path | None, reason: str) -> bool:
        """Somebody found that the arrays of a finished clip are damaged, which its header does not show.

        Returns:
            Whether the file is that of a clip which counted as good.
        """
        for index in range(len(self)):
            if path is not None and self._good(index) is not None and path == self._project.clip_path(index):
                self._clips[index] = FoundHeader(None, reason, 0)
                self._judge(index)
                self.revision += 1
                return True
        return False

    def dependents(self, clip_index: int) -> list[int]:
        """Finished clips that were trained on what this one is now."""
        header = self._good(clip_index)
        if header is None:
            return []
        return [
            index
            for index in range(len(self))
            if index != clip_index
            and (other := self._good(index)) is not None
            and header.fingerprint in (other.reference_fingerprint, other.previous_fingerprint)
        ]

    def outdated_by(self, clip_index: int) -> list[int]:
        """Clips that are good now and would be out of date if this one were trained again with another result."""
        now, then = self._bases(), self._bases(replaced=clip_index)
        return [
            index
            for index in range(len(self))
            if index != clip_index and then[index].reason and not now[index].reason and self._good(index) is not None
        ]

    # ---------------------------------------------------------------- reading

    def _read(self, index: int) -> None:
        project = self._project
        self._clips[index] = clip = project.headers.read(project.clip_path(index))
        self._checkpoints[index] = kept = project.headers.read(project.checkpoint_path(index))
        self._curve_psnr.pop(index, None)
        is_measured = clip is not None and clip.header is not None and clip.header.figures.held_out_psnr is not None
        if (clip is not None or kept is not None) and (kept is not None or not is_measured):
            path = project.curve_path(index, is_finished=kept is None)
            rows = [row["held_out_psnr"] for row in read_metrics(path) if _is_number(row.get("held_out_psnr"))]
            self._curve_psnr[index] = rows[-1] if rows else None

    # ---------------------------------------------------------------- judging

    def _good(self, index: int) -> ClipHeader | None:
        """Header of the finished clip, if it can be read."""
        found = self._clips[index]
        return None if found is None else found.header

    def _bases(self, *, replaced: int | None = None) -> list[Basis]:
        """Whether each clip stands on what it was trained on: one pass in the order of training, so that a chain of
        clips that continue from each other costs no more than single ones.

        Args:
            replaced: Suppose that this clip had been trained again, with another result.
        """
        headers = [self._good(index) for index in range(len(self._clips))]
        fingerprints = [None if header is None else header.fingerprint for header in headers]
        if replaced is not None:
            fingerprints[replaced] = "another"
        bases = [Basis()] * len(headers)
        for index in self.order:
            bases[index] = self._basis(index, fingerprints.__getitem__, bases)
        return bases

    def _fingerprint(self, index: int) -> str | None:
        header = self._good(index)
        return None if header is None else header.fingerprint

    def _basis(self, index: int, fingerprint: Callable[[int], str | None], bases: Sequence[Basis]) -> Basis:
        """By the fingerprints of the first clip and the one before, and the basis of that."""
        header, first, before = self._good(index), self.order[0], self._before.get(index)
        if header is None:
            needed = [first] if self._inherits and index != first else []
            needed += [before] if self._goes_on and before is not None else []
            blocker = next((found for other in needed if (found := self._blocker(other, bases)) is not None), None)
            return Basis(blocked_by=blocker)
        if self._inherits and (header.role == "source") != (index != first):
            return Basis(_ROLE_REASONS[header.role].format(first))
        if header.role == "source":
            if self._is_damaged(first):
                return Basis(f"Clip {first}, which it was trained on, is damaged.", first)
            if fingerprint(first) is None or fingerprint(first) != header.reference_fingerprint:
                return Basis(f"Clip {first}, the reference it was trained on, was retrained or is gone.")
        if header.previous_fingerprint is None or before is None:
            return Basis()
        if self._is_damaged(before):
            return Basis(f"Clip {before}, which it continues, is damaged.", before)
        if fingerprint(before) is None or fingerprint(before) != header.previous_fingerprint:
            return Basis(f"Clip {before}, which it continues, was retrained or is gone.")
        if bases[before].reason:
            return Basis(f"Clip {before}, which it continues, is out of date.", bases[before].blocked_by)
        return Basis()

    def _is_damaged(self, index: int) -> bool:
        found = self._clips[index]
        return found is not None and bool(found.damage)

    def _blocker(self, index: int, bases: Sequence[Basis]) -> int | None:
        return index if self._is_damaged(index) else bases[index].blocked_by

    def _judge_all(self) -> None:
        self._basis_of = self._bases()
        self._records = [self._record(index, basis) for index, basis in enumerate(self._basis_of)]
        self._n_trained = sum(record.state == "trained" for record in self._records)
        self._has_finished_clips = self._project.has_finished_clips
        self.due = {index for index, record in enumerate(self._records) if record.is_due}

    def _judge(self, clip_index: int) -> None:
        """A clip was read again: judge it and those that follow from it. All stand on the first one; on another one
        only the next in the order of training, and on that the next as long as something changes."""
        if clip_index == self.order[0]:
            self._judge_all()
            return
        index: int | None = clip_index
        while index is not None:
            basis = self._basis(index, self._fingerprint, self._basis_of)
            is_same = basis == self._basis_of[index]
            self._basis_of[index] = basis
            self._note(index, self._record(index, basis))
            if is_same and index != clip_index:
                break
            index = self._after.get(index)
        self._has_finished_clips = self._clips[clip_index] is not None or self._project.has_finished_clips

    def _note(self, index: int, record: ClipRecord) -> None:
        if record == self._records[index]:
            return
        self._n_trained += (record.state == "trained") - (self._records[index].state == "trained")
        self._records[index] = record
        if record.is_due:
            self.due.add(index)
        else:
            self.due.discard(index)

    def _record(self, index: int, basis: Basis) -> ClipRecord:
        found, kept = self._clips[index], self._checkpoints[index]
        resume_step, resume_n_steps, reason = None, 0, ""
        if kept is not None:
            reason = self._lost_checkpoint(kept.header)
            if not reason and kept.header is not None:
                resume_step, resume_n_steps = kept.header.step, kept.header.n_steps
        resume = {"resume_step": resume_step, "resume_n_steps": resume_n_steps, "blocked_by": basis.blocked_by}
        header = self._good(index)
        if (
            kept is not None
            and kept.header is not None
            and resume_step is not None
            and (found is None or (header is not None and basis.reason))
        ):
            return ClipRecord(
                "stopped",
                resume_step,
                resume_n_steps,
                self._curve_psnr.get(index),
                self._project.checkpoint_path(index),
                f"stopped-{resume_step}-{kept.header.fingerprint}",
                n_anchors=anchor_counts(kept.header),
                **resume,
            )
        if found is None:
            return ClipRecord(reason=reason, **resume)
        if header is None:
            return ClipRecord("damaged", reason=found.damage, **resume)
        revision = f"trained-{header.fingerprint}"
        figures = self._held_out(index, header, "" if basis.reason else revision)
        figures |= {"seconds": header.figures.seconds, "n_anchors": anchor_counts(header)}
        figures["exposure_change"] = found.exposure_change
        if basis.reason:  # it cannot be shown without what it was trained on
            return ClipRecord("stale", header.step, header.n_steps, reason=basis.reason, **figures, **resume)
        reason = reason or self._other_pictures(header)
        path = self._project.clip_path(index)
        return ClipRecord(
            "trained",
            header.step,
            header.n_steps,
            file=path,
            revision=revision,
            reason=reason,
            origin=header.origin,
            inherits=header.reference_fingerprint or "" if _inherits(header) else "",
            **figures,
            **resume,
        )

    def _held_out(self, index: int, header: ClipHeader, revision: str) -> dict[str, Any]:
        """The one figure that everybody shows of a finished clip: an evaluation's, else what its file says, else what
        the curve of its training ends with."""
        of_revision, evaluated = self._evaluated.get(index, ("", 0.0))
        if revision and of_revision == revision:
            return {"held_out_psnr": evaluated, "held_out_whole": True}
        psnr = header.figures.held_out_psnr
        if psnr is None and self._checkpoints[index] is None:
            psnr = self._curve_psnr.get(index)
        return {"held_out_psnr": psnr, "held_out_whole": header.figures.held_out_whole}

    def _other_pictures(self, header: ClipHeader) -> str:
        """That what is excluded of its pictures has changed since; empty where it has not. Such a clip is good."""
        frames = (header.start, header.start + header.n_frames)
        if header.exclusions == exclusion_key(self._project.document.exclusions, frames):
            return ""
        return "Exclusions from training have changed since, so it was trained on other pictures."

    def _lost_checkpoint(self, kept: ClipHeader | None) -> str:
        """Why the training cannot continue from a checkpoint; empty when it can. kept: None where it is damaged."""
        if kept is None:
            return "Progress from before the stop cannot be read; training starts from the beginning."
        reference = None if not self.order else self._good(self.order[0])
        known = kept.reference_fingerprint
        if known is not None and (reference is None or reference.fingerprint != known):
            return "The reference was retrained after the stop; training starts from the beginning."
        return ""


def anchor_counts(header: ClipHeader) -> tuple[int, int]:
    """Anchors of a clip by its header: those it inherits, and those it holds itself. Zeros where it does not say."""
    n_all = sum(header.n_anchors.values())
    if not _inherits(header):
        return 0, n_all
    n_inherited = sum(n for role, n in header.n_anchors.items() if role in REFERENCE_ROLES)
    return n_inherited, n_all - n_inherited


def _inherits(header: ClipHeader) -> bool:
    """Whether some of its anchors are those of the reference clip, as they are there."""
    return header.role == "source" and header.config.get("inherit") not in ("trainable", "off")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
