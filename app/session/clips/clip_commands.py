"""Commands about clips: where they are cut, what they inherit from, what is out of date, and room on the disk."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CompareVersion:
    """Put an earlier version of a clip beside what it is now, at the same frame and from the same view. The playhead
    goes into the clip where it is not in it. version: None ends that."""

    clip_index: int
    version: int | None


@dataclass(frozen=True, slots=True)
class SplitClip:
    """Let a clip begin at this frame. What is trained of the clip that held it is out of use; asks first."""

    frame_index: int
    is_confirmed: bool = False


@dataclass(frozen=True, slots=True)
class MergeClips:
    """Make a clip and the one after it one clip. What is trained of both is out of use; asks first."""

    clip_index: int
    is_confirmed: bool = False


@dataclass(frozen=True, slots=True)
class SetReferenceClip:
    """Let the other clips inherit from this one. All that is trained is out of date then; asks first."""

    clip_index: int
    is_confirmed: bool = False


@dataclass(frozen=True, slots=True)
class AskFreeSpace:
    """Ask whether files may go. what: A name of app.project.disk.room.WHAT. clip_index: Of one clip; None for all."""

    what: str
    clip_index: int | None = None


@dataclass(frozen=True, slots=True)
class FreeSpace:
    """Delete these files for good; see AskFreeSpace."""

    what: str
    clip_index: int | None = None


@dataclass(frozen=True, slots=True)
class AskAboutDamage:
    """Ask what is to become of a damaged clip."""

    clip_index: int


@dataclass(frozen=True, slots=True)
class ApplyDeletions:
    """Write clips again without what the edits delete everywhere; the clips of before become versions. Asks first."""

    is_confirmed: bool = False


CutCommand = SplitClip | MergeClips | SetReferenceClip
"""Commands that change the document and can be undone."""
ClipCommand = CutCommand | AskFreeSpace | FreeSpace | AskAboutDamage | ApplyDeletions
"""Commands on clips other than training them."""
