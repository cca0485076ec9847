"""The dialog's and the command line's sentences about edits and timing that go along with an export."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.document.changes.edit_words import edit_title
from app.document.project_document import ProjectDocument
from engine.text import one_line
from engine.timing.timing import TakeTiming

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject
    from app.export.jobs.job import ExportJob

MAX_TITLES = 3


def edits_line(document: ProjectDocument, *, has_edits: bool = True) -> str:
    """How many edits an export includes, and which, and how many copies of objects: "2 edits are included: delete box
    1 × 1 × 1, red; 3 copies of objects". Empty where none is on, or the export leaves them out.

    Args:
        document: Of the project.
        has_edits: Whether the export applies them.
    """
    titles = [one_line(edit_title(edit, document.objects)) for edit in document.edits if edit.is_on]
    n_copies = sum(copy.is_on for copy in document.copies)
    copied = f"{n_copies} {'copy' if n_copies == 1 else 'copies'} of objects" if n_copies else ""
    if not (titles or copied) or not has_edits:
        return ""
    if not titles:
        return f"{copied} {'is' if n_copies == 1 else 'are'} included"
    more = [f"{len(titles) - MAX_TITLES} more"] if len(titles) > MAX_TITLES else []
    counted = "1 edit is included" if len(titles) == 1 else f"{len(titles)} edits are included"
    return f"{counted}: {', '.join(titles[:MAX_TITLES] + more)}" + (f"; {copied}" if copied else "")


def included_lines(opened: TrainedProject, job: ExportJob) -> list[str]:
    """Which edits an export includes, and the timing that it follows; none where neither."""
    document, capture = opened.project.document, opened.capture
    lines = [edits_line(document, has_edits=job.applies_edits)]
    timing = TakeTiming(document.timing, capture.n_frames)
    if job.follows_timing and not timing.is_as_captured:
        count = "1 segment" if len(timing.played) == 1 else f"{len(timing.played)} segments"
        length = f"{timing.n_output:,} frames, {timing.duration_s(capture.fps):.2f} s"
        lines.append(f"The take is edited in time: {count}, {length}")
    return [line for line in lines if line]
