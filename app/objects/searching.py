"""Where an object is in the clips of a project: the search of engine.objects over its files. For the window, which runs
it on a thread, the command line and scripts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from msgspec import structs

from app.evaluation.headless import open_trained
from app.project.clips.clip_catalog import ClipCatalog
from app.project.project import Project
from engine.capture.capture import Capture
from engine.editing.scene_object import ObjectInClip, ObjectSeed, SceneObject

Report = Callable[[float, float], None]
"""Receives how much is done, and of how much; its exceptions end the search."""
Search = Callable[[SceneObject, Sequence[Any], Report], tuple[ObjectInClip, ...]]
"""Of the form of engine.objects.finding.find_object."""


def find_in_project(
    project: Project,
    capture: Capture,
    one: SceneObject,
    report: Report = lambda done, total: None,
    *,
    search: Search | None = None,
) -> tuple[ObjectInClip, ...]:
    """Look for an object in all finished clips. Takes a second or two for each; the document is not changed.

    Args:
        capture: Of the project, open.
        report: See Report.
        search: Another search; None for that of engine.objects.
    Returns:
        Where it is in each of them, in the order of time; clips that are not trained are missing.
    Raises:
        ProjectError: A clip is damaged, or nothing is trained.
    """
    from engine.objects.finding import SearchedClip, find_object

    opened = open_trained(project, capture)
    catalog = ClipCatalog(project, len(opened.clips))
    trained = [clip for clip in opened.clips if catalog[clip.clip_index].state == "trained"]
    clips = [SearchedClip(clip, lambda index=clip.clip_index: opened.edited(opened.load(index))) for clip in trained]
    origins = {clip.start: catalog[clip.clip_index].origin for clip in trained}
    present = {*origins.values(), *(catalog[clip.clip_index].inherits for clip in trained)} - {""}
    meant = structs.replace(one, seeds=living_seeds(one, origins, present))
    found = (find_object if search is None else search)(meant, clips, report)
    return tuple(structs.replace(clip, origin=origins.get(clip.start, "")) for clip in found)


def living_seeds(one: SceneObject, origins: Mapping[int, str], present: Collection[str]) -> tuple[ObjectSeed, ...]:
    """What is known of an object by Gaussians that there are: a clip that is trained anew has others, so that what was
    selected in it is lost. Then the nearest clip that is still the same stands for it, with the object found there.

    Args:
        origins: Of the trained clips as they are now, by first frame.
        present: All origins of Gaussians that there are.
    """
    seeds = [seed for seed in one.seeds if any(part.origin in present for part in (*seed.added, *seed.removed))]
    if seeds and seeds[0] is one.seeds[0]:
        return tuple(seeds)
    first = one.seeds[0].frame_index if one.seeds else 0
    known = [clip for clip in one.clips if clip.sets and clip.seen and clip.origin == origins.get(clip.start)]
    nearest = min(known, key=lambda clip: abs((clip.start + clip.stop) / 2 - first), default=None)
    if nearest is None:
        return one.seeds
    return (ObjectSeed(nearest.seen[0][0], nearest.sets), *seeds)
