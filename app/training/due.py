"""Clips that can be trained, and those that must be trained before them: from the files on disk, without a queue."""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Set

from app.project.clips.clip_catalog import ClipCatalog
from app.project.clips.clip_versions import recovery_hint
from app.project.project import Project
from app.training.train_queue import needed_clips
from engine.errors import ProjectError


def is_due(catalog: ClipCatalog, clip_index: int) -> bool:
    """Whether a clip is due, see ClipRecord.is_due."""
    return clip_index in catalog.due


def due_clips(catalog: ClipCatalog) -> list[int]:
    """All that are due, in the order of training."""
    return [index for index in catalog.order if is_due(catalog, index)]


def stale_clips(catalog: ClipCatalog) -> list[int]:
    """Those that are due because they are out of date."""
    return [index for index in due_clips(catalog) if catalog[index].state == "stale"]


def check_needed(project: Project, catalog: ClipCatalog, clip_index: int, coming: Set[int]) -> None:
    """Check that the clips which a clip needs are trained, or come before it.

    Args:
        coming: Clips that train or wait.
    Raises:
        ProjectError: Something it needs is missing or damaged.
    """
    for base in needed_clips(project, clip_index):
        kind = "the reference clip" if base == project.settings.reference_clip else "clip"
        if base in coming:
            continue
        if catalog[base].state == "damaged":
            raise ProjectError(
                f"Clip {clip_index} needs {kind} {base}, whose file is damaged.",
                hint=recovery_hint(project, base),
                path=project.clip_path(base),
            )
        if not project.is_trained(base):
            raise ProjectError(
                f"Clip {clip_index} needs {kind} {base}, which is not trained.", hint=f"Train clip {base} first."
            )


def with_needed(
    project: Project, catalog: ClipCatalog, clip_indices: Iterable[int], coming: Set[int]
) -> tuple[Sequence[int], list[int]]:
    """The unfinished ones of these clips, in the order of training, each after the clips it needs.

    Args:
        coming: Clips that train or wait.
    Returns:
        Them, and clips left out because they or clips they need are damaged.
    """
    due, order, left_out = set(due_clips(catalog)), dict[int, None](), list[int]()
    config = project.settings.config()
    rank = {index: place for place, index in enumerate(catalog.order)}  # a clip comes after all that it needs
    for index in sorted({index for index in clip_indices if index in rank}, key=rank.__getitem__):
        chain, open_ends = set[int](), [index]
        while open_ends:
            one = open_ends.pop()
            if catalog[one].state != "trained" and one not in chain and one not in coming and one not in order:
                chain.add(one)
                open_ends += needed_clips(project, one, config)
        if due.issuperset(chain):
            order |= dict.fromkeys(sorted(chain, key=rank.__getitem__))
        else:
            left_out.append(index)
    return list(order), left_out
