"""Where an edit acts, in words, and the check that it acts at all. For the window, the command line and scripts."""

from __future__ import annotations

from collections.abc import Sequence

from app.document.changes.edit_words import scope_text
from engine.capture.clip import Clip
from engine.editing.edit import Scope
from engine.editing.reach import Frames, Reach
from engine.errors import ProjectError

VOLUME_HINT = "An object made of it acts in all clips, and so does a box or sphere."
MAX_RUNS = 3


def check_acts(reach: Reach, scope: Scope) -> None:
    """Check that a new edit can act somewhere.

    Raises:
        ProjectError: Its target exists in none of its frames.
    """
    if reach.is_nowhere:
        hint = "Choose other frames for the edit, or select in a frame where it should act."
        raise ProjectError(_nowhere_text(reach, scope), hint=hint)


def reach_note(reach: Reach, scope: Scope) -> str:
    """A note on an edit that acts in unexpected places, before it is made and afterwards; empty for others."""
    if reach.is_nowhere:
        return _nowhere_text(reach, scope)
    if reach.empty:
        return f"The selection does not exist in {frames_text(reach.empty)}; there the edit acts on everything."
    if not reach.is_whole:
        return f"Acts in {frames_text(reach.acts)} only: other clips have other Gaussians. {VOLUME_HINT}"
    if reach.n_ending:
        where = f"{reach.n_ending:,} of {reach.n_picked:,} Gaussians are in {frames_text(reach.ending)} only"
        return f"{where}: other clips have other Gaussians. {VOLUME_HINT}"
    if reach.has_newcomers:
        return f"Other clips show what moves partly with their own Gaussians, which are not selected. {VOLUME_HINT}"
    return ""


def acting_text(scope: Scope, reach: Reach, clips: Sequence[Clip] = ()) -> str:
    """The frames in which an edit really acts, in a list of edits: "frames 20-29 only", "everywhere".

    Args:
        clips: See `scope_text`.
    """
    text = scope_text(scope, clips)
    if reach.is_nowhere:
        return f"acts in no frame ({text})"
    if not reach.is_whole:
        return f"{frames_text(reach.acts)} only"
    if not reach.n_ending:
        return text
    return f"{text}; {100 * reach.n_ending / reach.n_picked:.0f} % in {frames_text(reach.ending)} only"


def frames_text(runs: Frames) -> str:
    """Runs of frames: "frame 3", "frames 0-9 and 20-29"."""
    listed = [f"{first}-{stop - 1}" if stop - first > 1 else f"{first}" for first, stop in runs[:MAX_RUNS]]
    more = ["more"] if len(runs) > MAX_RUNS else []
    words = " and ".join(filter(None, (", ".join((listed + more)[:-1]), (listed + more)[-1])))
    return f"frame{'' if len(runs) == 1 and runs[0][1] - runs[0][0] == 1 else 's'} {words}"


def _nowhere_text(reach: Reach, scope: Scope) -> str:
    what = "the selection exists in" if reach.n_picked else "the capture has"
    return f"The edit can never act ({scope_text(scope)}): {what} {frames_text(reach.exists)} only."
