"""Keys of a volume that follows an object through the clips of a project. For the window, which looks on a thread, the
command line and scripts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from app.evaluation.headless import open_trained
from app.project.project import Project
from engine.capture.capture import Capture
from engine.editing.edit import KeyedVolume, Target
from engine.editing.scene_object import SceneObject
from engine.editing.volumes.keyed_volume import volume_of
from engine.errors import ProjectError

if TYPE_CHECKING:
    from engine.editing.volumes.following import Crowd

Report = Callable[[int, int], None]
"""Receives how many frames are done, and of how many; its exceptions end the work."""


def follow_in_project(
    project: Project,
    capture: Capture,
    one: SceneObject,
    target: Target,
    report: Report = lambda n_done, n_all: None,
) -> KeyedVolume:
    """Look where an object is, and make the keys of a volume that stays around it. The document is not changed.

    Args:
        capture: Of the project, open.
        target: What the edit acts on now: a volume gives its kind, see engine.editing.volumes.following.
        report: See Report.
    Raises:
        ProjectError: The object was found nowhere, or a clip is damaged.
    """
    from engine.editing.volumes.following import crowd_of, followed, frames_to_follow

    opened = open_trained(project, capture)
    trained = set(opened.trained)
    wanted = [(clip, frames_to_follow(one, clip)) for clip in opened.clips if clip.clip_index in trained]
    n_all = sum(len(frames) for _, frames in wanted)
    if not n_all:
        raise ProjectError(
            f'"{one.name}" was found in none of the trained clips.', hint="Find the object, or correct it."
        )

    def crowds() -> Iterator[Crowd]:
        n_done = 0
        for clip, frames in wanted:
            report(n_done, n_all)
            edited = opened.edited(opened.load(clip.clip_index)) if frames else None
            for frame_index in frames:
                assert edited is not None
                yield crowd_of(one, edited, frame_index)
                n_done += 1
                report(n_done, n_all)

    first = wanted[0][0].start
    return followed(crowds(), volume_of(target, first))
