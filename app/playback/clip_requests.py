"""ClipRequests: what to load and decode of an opened project, with its edits, copies of objects and reference."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from app.playback.frame_decoder import FrameKey, FrameRequest, changes_digest
from app.playback.modes.view_modes import PLAIN, ShownAs, decoded_as
from app.project.opening.opened_project import OpenedProject
from app.training.clip_run import ShownState
from engine.capture.clip import Clip
from engine.editing.copies.copy_moments import CopyMoments, FrameCopies
from engine.editing.effects import EditStack

StateOf = Callable[[int], ShownState | None]
"""The state of a clip to look at; None where it has none."""


class ClipRequests:
    """Requests of one project after the other, without reading anything. For one thread.

    Args:
        state_of: Of the clips of the opened project.
    """

    def __init__(self, state_of: StateOf) -> None:
        self._opened: OpenedProject | None = None
        self._copies = CopyMoments(EditStack())
        self._state_of = state_of
        self._inherited: dict[int, Path | None] = {}

    def take_up(self, opened: OpenedProject) -> None:
        """Requests are of this project from now on."""
        self._opened, self._inherited = opened, {}

    def request(
        self, clip: Clip, frame_index: int, shown_as: ShownAs = PLAIN, state_of: StateOf | None = None
    ) -> FrameRequest | None:
        """The file and frame to load and decode for a frame of a clip; None where the clip has no state.

        Args:
            state_of: Other states than those of the project.
        """
        opened = self._opened
        state = None if opened is None else (state_of or self._state_of)(clip.clip_index)
        if opened is None or state is None:
            return None
        effects, copies = self.edits().at(frame_index), self._copies.at(frame_index)
        bare = self._bare(opened, clip, state)
        return replace(
            bare,
            frame_index=frame_index,
            shown_as=decoded_as(shown_as),
            effects=effects,
            copies=copies,
            sources=self._sources(copies),
        )

    def _sources(self, copies: FrameCopies) -> tuple[FrameRequest, ...]:
        """The clips that copies come from, as far as they have a state."""
        opened = self._opened
        if opened is None or not copies:
            return ()
        places = {bisect_right(opened.clips, frame, key=lambda clip: clip.start) - 1 for frame in copies.frames}
        wanted = (opened.clips[place] for place in sorted(places) if place >= 0)
        found = ((clip, self._state_of(clip.clip_index)) for clip in wanted)
        return tuple(self._bare(opened, clip, state) for clip, state in found if state is not None)

    def _bare(self, opened: OpenedProject, clip: Clip, state: ShownState) -> FrameRequest:
        """The first frame of a clip as it was trained."""
        return FrameRequest(
            clip_index=clip.clip_index,
            revision=state.revision,
            frame_index=clip.start,
            path=state.file,
            generation=opened.generation,
            reference_path=state.reference_file or self._inherited_path(opened, clip.clip_index),
            clip=clip,
            is_live=state.is_live,
        )

    def is_current(self, key: FrameKey) -> bool:
        """Whether a frame is of the project, and of its clip and edits as they are now."""
        generation, path, clip_index, revision, digest, _, frame_index = key
        state = self._state_of(clip_index)
        is_open = self._opened is not None and self._opened.generation == generation
        effects, copies = self.edits().at(frame_index), self._copies.at(frame_index)
        is_edited_so = digest == changes_digest(effects, copies, self._sources(copies))
        return is_open and is_edited_so and state is not None and (str(state.file), state.revision) == (path, revision)

    def edits(self) -> EditStack:
        """The document's current edits; frames that a change of them does not touch are kept."""
        document = None if self._opened is None else self._opened.project.document
        known = self._copies.stack
        if document is None:
            wanted: tuple[object, ...] = ((), (), (), ())
        else:
            wanted = (document.edits, document.objects, document.copies, document.camera_paths)
        if any(one is not other for one, other in zip(wanted, known.parts, strict=True)):
            known = EditStack() if document is None else document.stack()
            self._copies = CopyMoments(known)
        return known

    def _inherited_path(self, opened: OpenedProject, clip_index: int) -> Path | None:
        """Kept: it is asked for many times in every turn of the loop, and follows from all settings."""
        if clip_index not in self._inherited:
            self._inherited[clip_index] = opened.inherited_path(clip_index)
        return self._inherited[clip_index]
