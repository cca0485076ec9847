"""Questions before clips or their files change: plain values with all that the answer depends on."""

from __future__ import annotations

from dataclasses import dataclass

from app.session.clips.clip_commands import CutCommand


@dataclass(frozen=True, slots=True)
class CutQuestion:
    """Are clips to be cut otherwise, or another one made the reference, although something was trained?

    Attributes:
        command: That cuts or changes the reference.
        words: The same, as "Split clip 3 at frame 35".
        n_unused: Trained clips that are out of use then; their files stay, and are there again after undo.
        outdated: Trained clips that are out of date then.
        seconds: Expected for training all of it again; None where unknown.
    """

    command: CutCommand
    words: str
    n_unused: int
    outdated: tuple[int, ...]
    seconds: float | None


@dataclass(frozen=True, slots=True)
class RoomQuestion:
    """May files go for good?

    Attributes:
        what, clip_index: See clip_commands.FreeSpace.
        words: For these files, in the middle of a sentence.
        n_clips: How many versions or clips that is.
        n_bytes: That it frees.
    """

    what: str
    clip_index: int | None
    words: str
    n_clips: int
    n_bytes: int


@dataclass(frozen=True, slots=True)
class DamagedQuestion:
    """How to continue with a clip whose file is damaged?

    Attributes:
        reason: The damage.
        version: The version that could come back; None without one.
        version_text: When that was trained, and how good it is; empty without one.
        why_no_version: Why none can come back; empty where one can.
        outdated: Trained clips that are out of date without the damaged one, whatever is done.
        seconds: Expected for training it again; None where unknown.
    """

    clip_index: int
    reason: str
    version: int | None
    version_text: str
    why_no_version: str
    outdated: tuple[int, ...]
    seconds: float | None


@dataclass(frozen=True, slots=True)
class DeletionsQuestion:
    """Are deletions to be applied permanently?

    Attributes:
        n_anchors: Anchors that go, counted in every clip that shows them.
        n_clips: Clips that are written again.
        n_untrained: Clips that are not trained; while there are some, edits that delete stay in the stack.
    """

    n_anchors: int
    n_clips: int
    n_untrained: int


ClipQuestion = CutQuestion | RoomQuestion | DamagedQuestion | DeletionsQuestion
