"""Comparing a clip with an earlier version of it."""

from __future__ import annotations

from app.playback.timeline import Timeline
from app.session.clips.clip_commands import CompareVersion
from app.status import CAPTURED, Overlays, version_name


def show_version(command: CompareVersion, timeline: Timeline, overlays: Overlays) -> None:
    """Carry out the command; a comparison in progress keeps its kind. An index that no clip has changes nothing."""
    if command.version is None:
        overlays.compare, overlays.compare_with = "off", CAPTURED
        return
    if not 0 <= command.clip_index < len(timeline.clips):
        return
    clip = timeline.clips[command.clip_index]
    if not clip.start <= timeline.frame_index < clip.stop:
        timeline.seek(clip.start)
    overlays.compare_with = version_name(command.version)
    if overlays.compare == "off":
        overlays.compare = "side"
