"""Which anchors each clip of a project has, as edits name them."""

from __future__ import annotations

from collections.abc import Sequence

from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from engine.capture.clip import Clip
from engine.editing.reach import ClipAnchors


def clip_anchors(project: Project, clips: Sequence[Clip], catalog: ClipCatalog) -> tuple[ClipAnchors, ...]:
    """Of every clip; one that is not trained will inherit what the others do."""
    found = []
    for clip in clips:
        record = catalog[clip.clip_index]
        inherits = record.inherits
        if not record.origin:
            base = project.inherited_index(clip.clip_index)
            inherits = "" if base is None else catalog[base].origin
        found.append(ClipAnchors(clip.clip_index, clip.start, clip.stop, record.origin, inherits))
    return tuple(found)
