"""Commands about clips: cuts, reference clip, damage, and room on the disk."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CompareVersion:
    """Show an earlier version of a clip next to the present one, at the same frame and from the same view. The playhead
    goes into the clip where it is not in it. version: None ends that."""

    clip_index: int
    version: int | None


@dataclass(frozen=True, slots=True)
class SplitClip:
    """Let a clip begin at this frame. The trained clip that held it is out of use; asks first."""

    frame_index: int
    is_confirmed: bool = False


@dataclass(frozen=True, slots=True)
class MergeClips:
    """Make a clip and the one after it one clip. Both are out of use if trained; asks first."""

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
    """Ask how to continue with a damaged clip."""

    clip_index: int


@dataclass(frozen=True, slots=True)
class ApplyDeletions:
    """Write clips again without everything that edits delete everywhere; the old clips become versions. Asks first."""

    is_confirmed: bool = False


CutCommand = SplitClip | MergeClips | SetReferenceClip
"""Commands that change the document and can be undone."""
ClipCommand = CutCommand | AskFreeSpace | FreeSpace | AskAboutDamage | ApplyDeletions
"""Commands on clips other than training them."""
