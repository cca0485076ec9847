"""Following the training: the playhead goes to the clip with the newest state, and stays where it is inside of it."""

from __future__ import annotations

from app.playback.timeline import Timeline
from app.session.training.live_training import LiveTraining


def follow_training(timeline: Timeline, live_training: LiveTraining) -> None:
    """Take the playhead along, if the user wants that and something is trained."""
    if not timeline.is_following:
        return
    newest = live_training.newest_clip
    if newest is not None and timeline.clip != timeline.clips[newest]:
        timeline.go_to(timeline.clips[newest].start)
