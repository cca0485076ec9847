"""ScriptedProject: an open project as a program uses it. It holds nothing of its own but what is open: everything it
does is done by the functions that the window and the command line use.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from app.document.changes.edit_changes import edit_with
from app.document.changes.object_changes import object_with
from app.document.changes.reach_words import check_acts, reach_note
from app.document.changes.timing_changes import segments_of, time_edit_called, timing_changed
from app.document.history import Changed, DocumentHistory, Event, Redone, Undone
from app.document.project_document import ProjectDocument
from app.document.storing.stored_document import document_of, plain_document
from app.export.export_progress import ExportProgress, ExportResult
from app.export.jobs.table import formats_of, named_job
from app.project.allowed_changes import check_change, discard_unfitting
from app.project.clips.clip_anchors import clip_anchors
from app.project.clips.clip_catalog import ClipCatalog
from app.project.clips.clip_versions import restore_version
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.scripting.actions import action_called
from app.scripting.object_copying import ObjectCopying
from app.scripting.scripted_objects import ScriptedObjects
from app.session.editing.edit_commands import (
    AddEdit,
    ChangeEdit,
    EditCommand,
    MoveEdit,
    RemoveEdit,
    RenameEdit,
    ToggleEdit,
)
from app.session.editing.edits import changed
from app.status import TrainingStatus
from app.training.process import ProcessWorker
from app.training.service import Launch
from engine.capture.capture import Capture
from engine.capture.clip import Clip
from engine.editing.actions import Action
from engine.editing.edit import EVERYWHERE, Edit, Everything, ObjectTarget, Picked, Scope, Target, Volume
from engine.editing.reach import ClipAnchors, Reach, reach_of_edit
from engine.errors import EngineError, ProjectError
from engine.kernels.cache import use_kernel_cache
from engine.storage.typed_json import EntryError
from engine.timing.segment import Segment

if TYPE_CHECKING:
    from app.evaluation.headless import ClipOutcome, TrainedProject
    from app.mending.mend_project import MendOutcome
    from engine.filling.finding import FillFigures
    from engine.progress import ReportProgress

TellTraining = Callable[[TrainingStatus], None]
TellExport = Callable[[ExportProgress], None]
TellNote = Callable[[str], None]
FILL_VERB = "fill behind"


class ScriptedProject(ScriptedObjects, ObjectCopying):
    """An open project; made by `app.scripting.open_project`, and closed by `close` or at the end of a `with` block.

    Args:
        project: The open project.
        launch: Starts a training; a process by default.
    """

    def __init__(self, project: Project, *, launch: Launch = ProcessWorker) -> None:
        self._project, self._launch = project, launch
        self._capture: Capture | None = None
        self._is_closed = False

    def __enter__(self) -> ScriptedProject:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the project, so that others can write to it. May be called twice."""
        self._is_closed = True
        if self._capture is not None:
            self._capture.close()
            self._capture = None
        self._project.close()

    # ---------------------------------------------------------------- what is open

    @property
    def folder(self) -> Path:
        """Of the project."""
        return self._project.folder

    @property
    def is_writable(self) -> bool:
        """Whether it can be changed and trained."""
        return self._project.is_writable

    @property
    def document(self) -> ProjectDocument:
        """Everything that is decided about the project; an immutable value."""
        return self._project.document

    @property
    def history(self) -> DocumentHistory:
        """The document with the steps that can be taken back and done again."""
        return self._project.history

    @property
    def edits(self) -> tuple[Edit, ...]:
        """The stack of edits, bottom first."""
        return self.document.edits

    @property
    def capture(self) -> Capture:
        """The capture; opened when it is first asked for.

        Raises:
            CaptureError: It is gone or damaged.
            ProjectError: Another one is in its place, or the project is closed.
        """
        self._check_open()
        if self._capture is None:
            self._capture = open_capture_of(self._project.settings, self.folder)
        return self._capture

    @property
    def n_frames(self) -> int:
        """Frames of the capture that the project works on. Raises what `capture` raises."""
        return self.capture.n_frames

    @property
    def clips(self) -> list[Clip]:
        """The clips in their order: their index and frames. Raises what `capture` raises."""
        return self._project.clips(self.n_frames)

    @property
    def training_order(self) -> list[int]:
        """Indices of all clips in the order in which they can be trained: the reference first. Raises what `capture`
        raises."""
        return self._project.training_order(len(self.clips))

    @property
    def trained_clips(self) -> list[int]:
        """Indices of the clips that are finished. Raises what `capture` raises."""
        return [clip.clip_index for clip in self.clips if self._project.is_trained(clip.clip_index)]

    def clip(self, clip_index: int) -> Clip:
        """One of the clips.

        Raises:
            ProjectError: There is no such clip.
        """
        clips = self.clips
        if not 0 <= clip_index < len(clips):
            raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {len(clips) - 1}.")
        return clips[clip_index]

    def scope_of_clip(self, clip_index: int) -> Scope:
        """The frames of a clip, for an edit. Raises what `clip` raises."""
        clip = self.clip(clip_index)
        return Scope(clip.start, clip.stop)

    # ---------------------------------------------------------------- the document

    def change(self, document: ProjectDocument, name: str) -> None:
        """Replace the document, as one step that can be taken back; on the disk when it returns.

        Args:
            document: The new one; made of `document` with dataclasses.replace or the functions of app.document.
            name: The change, as a word or two that can follow "Undo".
        Raises:
            ProjectError: The project is read-only, or such a change is not allowed.
            DiskError: The disk refused; nothing has changed.
        """
        self._happen(Changed(name, document))

    def put(self, entries: Mapping[str, Any]) -> None:
        """Replace entries of the document by plain data, as project.json holds it.

        Args:
            entries: By name: "markers", "labels", "camera_paths" and so on.
        Raises:
            ProjectError: An entry is not known or is not valid, or what `change` raises.
        """
        try:
            document = document_of(plain_document(self.document) | dict(entries))
        except EntryError as error:
            raise ProjectError(f"The document is not valid ({error}).") from error
        self.change(document, f"change {', '.join(name.replace('_', ' ') for name in entries)}")

    def undo(self) -> str:
        """Undo the last step. Returns its name; empty where there was none. Raises what `change` raises."""
        name = self.history.undo_name
        if name:
            self._happen(Undone())
        return name

    def redo(self) -> str:
        """Redo the last undone step. Returns its name; empty where there was none. Raises what `change` raises."""
        name = self.history.redo_name
        if name:
            self._happen(Redone())
        return name

    def _happen(self, event: Event) -> None:
        self._check_open()
        self._project.check_writable()
        before, after = self.document, self.history.after(event).present
        if after.settings != before.settings:  # the capture may be gone, which is nothing to an edit
            check_change(self._project, self.capture, before, after)
        self._project.happen(event)
        discard_unfitting(self._project, before.settings, after.settings)

    # ---------------------------------------------------------------- edits

    def apply_edit(
        self,
        action: Action | str,
        target: Target | None = None,
        *,
        scope: Scope = EVERYWHERE,
        is_inverted: bool = False,
        name: str = "",
        on_note: TellNote | None = None,
        **values: Any,
    ) -> Edit:
        """Put an edit on top of the stack.

        Args:
            action: The effect: a value such as Delete() or Expose(0.5), or its name with the `values` of its entries,
                such as "expose", stops=0.5. "isolate" hides everything but the target.
            target: The part to act on, such as a Box, a Sphere or the result of `select`; None for everything.
            scope: In which frames.
            is_inverted: Whether it acts on everything but the target.
            name: For people; an empty one is put into words where the edit is shown.
            on_note: Notified, before it is made, of surprises about where it acts; a warning of Python by default.
        Returns:
            The edit with its number.
        Raises:
            ProjectError: A value is out of range or not known, the edit can act in no frame, or what `change` raises.
        """
        chosen, inverts = action_called(action, values)
        target = Everything() if target is None else target
        if isinstance(target, ObjectTarget):
            object_with(self.document, target.object_id)
        command = AddEdit(chosen, target, scope, is_inverted=is_inverted != inverts, name=name)
        made = changed(self.document, command).document.edits[-1]
        reach = reach_of_edit(made, self.anchors, self.document.objects)
        check_acts(reach, scope)
        self._tell(reach_note(reach, scope), on_note)
        self._carry_out(command)
        return self.edits[-1]

    def replace_edit(self, edit: Edit, *, on_note: TellNote | None = None) -> None:
        """Put an edit in the place of the one with its number. on_note: See `apply_edit`. Raises ProjectError."""
        self._tell(reach_note(reach_of_edit(edit, self.anchors, self.document.objects), edit.scope), on_note)
        self._carry_out(ChangeEdit(edit))

    @property
    def reaches(self) -> dict[int, Reach]:
        """In which frames each edit of the stack acts, by its number."""
        anchors = self.anchors
        return {edit.edit_id: reach_of_edit(edit, anchors, self.document.objects) for edit in self.edits}

    @property
    def anchors(self) -> tuple[ClipAnchors, ...]:
        """Which anchors each clip has; none while the capture cannot be opened, which is nothing to an edit."""
        try:
            clips = self.clips
        except EngineError:
            return ()
        return clip_anchors(self._project, clips, ClipCatalog(self._project, len(clips)))

    @staticmethod
    def _tell(note: str, on_note: TellNote | None) -> None:
        if note and on_note is not None:
            on_note(note)
        elif note:
            warnings.warn(note, stacklevel=3)

    def switch_edit(self, edit_id: int, *, is_on: bool) -> None:
        """Let an edit count or not. Raises ProjectError."""
        if edit_with(self.document, edit_id).is_on != is_on:
            self._carry_out(ToggleEdit(edit_id))

    def remove_edit(self, edit_id: int) -> None:
        """Take an edit out of the stack. Raises ProjectError."""
        self._carry_out(RemoveEdit(edit_id))

    def move_edit(self, edit_id: int, position: int) -> None:
        """Bring an edit to a position of the stack, counted from 0 at the bottom. Raises ProjectError."""
        self._carry_out(MoveEdit(edit_id, position))

    def rename_edit(self, edit_id: int, name: str) -> None:
        """Give an edit another name. Raises ProjectError."""
        self._carry_out(RenameEdit(edit_id, name))

    def fill(self, edit_id: int, on_progress: Callable[[int, int], None] | None = None) -> FillFigures:
        """Fill what was behind something that an edit deletes or hides: take traces of it away, too, and continue
        surfaces that no camera ever saw.

        Args:
            edit_id: Of the edit, which has the fill afterwards.
            on_progress: Told how many steps are done, of how many.
        Returns:
            What was found.
        Raises:
            ProjectError: There is no such edit, it takes nothing away, or the project is read-only.
        """
        from app.filling.fill_edit import fill_behind

        self._check_open()
        self._project.check_writable()
        edit_with(self.document, edit_id)
        tell = (lambda done, total: None) if on_progress is None else on_progress
        filled, figures = fill_behind(self.open_trained(), self.document.stack(), edit_id, tell)
        self._carry_out(ChangeEdit(filled, verb=FILL_VERB))
        return figures

    def _carry_out(self, command: EditCommand) -> None:
        """Carry out a command as the window does."""
        change = changed(self.document, command)
        self.change(change.document, change.name)

    # ---------------------------------------------------------------- time

    def time_edit(self, verb: str, **entries: Any) -> None:
        """Change which frames the take plays, when and how fast; videos, pictures, players and exports follow.

        Args:
            verb: One of app.document.changes.timing_changes.TIME_EDITS: "trim", "split", "speed", "reverse", "freeze",
                "loop", "order" or "reset-time".
            entries: Of that, such as frames=(20, 40), by=0.5.
        Raises:
            ProjectError: There is no such verb or entry, it is not possible, or what `change` raises.
        """
        edit = time_edit_called(verb, entries)
        self.change(timing_changed(self.document, edit, self.n_frames), edit.title)

    @property
    def segments(self) -> tuple[Segment, ...]:
        """What the take plays, in order; one segment where it is as captured. Raises what `capture` raises."""
        return segments_of(self.document, self.n_frames)

    # ---------------------------------------------------------------- selecting

    def select(
        self,
        where: str = "",
        *,
        frame_index: int = 0,
        volume: Volume | None = None,
        is_inverted: bool = False,
    ) -> Picked:
        """Pick Gaussians of a frame, as edits have left them: a target for an edit, in all frames.

        Args:
            where: Conditions joined by "and" that all have to hold, such as "opacity<0.05 and motion=static".
                Attributes are opacity, size (scene units), clip (of birth), birth and motion.
            volume: Only what lies in it.
            is_inverted: Pick everything else.
        Raises:
            ProjectError: The frame is not trained, a condition is not valid, or nothing is picked.
        """
        from app.scripting.selecting import select

        self._check_open()
        opened = self.open_trained()
        return select(opened, self.document.stack(), frame_index, volume=volume, where=where, is_inverted=is_inverted)

    def apply_permanently(self, on_progress: Callable[[int, int], None] | None = None) -> tuple[int, ...]:
        """Take deleted anchors out of the clips for good; earlier clips become versions.

        Args:
            on_progress: Told how many clips are done, of how many.
        Returns:
            Indices of the clips that have changed.
        Raises:
            ProjectError: There is nothing to apply, the project is read-only, or a clip is damaged; nothing has
                changed.
            DiskError: The disk refused.
        """
        from app.applying.applying import apply_permanently

        self._check_open()
        tell = (lambda n_done, n_all: None) if on_progress is None else on_progress
        return tuple(apply_permanently(self._project, self.clips, tell).clip_indices)

    # ---------------------------------------------------------------- jobs

    def mend(
        self,
        *,
        boundary: int | None = None,
        frames: range | None = None,
        method: str = "auto",
        on_progress: ReportProgress | None = None,
    ) -> MendOutcome:
        """Make the flicker at a boundary, or in a stretch of frames, smaller; what clips were becomes versions.

        Args:
            boundary: The clip that begins at the boundary; None for frames.
            frames: Of the capture, without gaps; None for a boundary.
            method: "auto" or one of engine.mending.figures.METHODS.
            on_progress: Told how far it is.
        Returns:
            The outcome, with figures before and after; `record.has_helped` says whether anything was kept.
        Raises:
            ProjectError: It cannot be mended; all clips are as they were.
        """
        from app.mending.mend_project import mend_project
        from app.mending.request import MendRequest

        self._check_open()
        if (boundary is None) == (frames is None) or (frames is not None and frames.step != 1):
            raise ProjectError("Name what to mend: a boundary, or frames without gaps.")
        span = None if frames is None else (frames.start, frames.stop)
        request = MendRequest(after=boundary, frames=span, method=method)
        tell = (lambda progress: None) if on_progress is None else on_progress
        return mend_project(self._project, request, report=tell)

    def train_clip(
        self,
        clip_index: int,
        *,
        on_progress: TellTraining | None = None,
        is_again: bool = False,
        settings: Mapping[str, int | float | str | bool] | None = None,
    ) -> ClipOutcome:
        """Train a clip in a process of its own, and wait for it. One that was stopped resumes where it was.

        Args:
            on_progress: Notified some twenty times a second of progress; its exception stops the training, and what was
                learned is kept.
            is_again: Train it also when it is finished or damaged; its earlier result becomes a version.
            settings: Training settings that it alone is to have.
        Returns:
            How it ended: "trained", or "skipped" where it was finished already.
        Raises:
            ProjectError: It cannot be trained, or another program trains into the project.
            TrainingError: The training failed; progress is kept.
        """
        from app.scripting.training import train_one

        self._check_open()
        self._project.check_writable()
        self.clip(clip_index)
        return train_one(
            self._project,
            self.capture,
            clip_index,
            launch=self._launch,
            on_progress=on_progress,
            is_again=is_again,
            own=settings,
        )

    def restore_version(self, clip_index: int, number: int) -> None:
        """Bring back a clip's result from before it was trained again; its present result becomes a version.

        Args:
            number: Of the version, as `clipgstream versions` lists them.
        Raises:
            ProjectError: There is no such version, or it does not go with the reference clip as it is now.
        """
        self._check_open()
        self.clip(clip_index)
        restore_version(self._project, clip_index, number)

    def render(
        self,
        out: Path | str,
        *,
        format: str | None = None,
        on_progress: TellExport | None = None,
        **options: Any,
    ) -> ExportResult:
        """Write a video, or a folder of pictures, from a camera, along a camera path or on a turntable.

        Args:
            out: A file, or a new folder for pictures.
            format: "mp4", "webm", "png" or "exr"; None goes by the name.
            on_progress: Notified of progress; its exceptions end the work, and then nothing is left.
            options: Entries of app.export.jobs.video.VideoJob, such as camera="cam00" or turntable=Turntable(2).
        Raises:
            EngineError: It cannot be rendered; nothing is left.
        """
        from app.export.video.formats import format_of

        format_name = format_of(Path(out)) if format is None else format
        if format_name not in (known := formats_of("render")):
            raise ProjectError(f"'{format_name}' is not a format.", hint=f"Formats are {', '.join(known)}.")
        return self._run_job(format_name, out, on_progress, options)

    def export(
        self,
        out: Path | str,
        *,
        format: str = "ply",
        on_progress: TellExport | None = None,
        **options: Any,
    ) -> ExportResult:
        """Write files for other programs.

        Args:
            out: A new or empty folder; of a player and of figures a file.
            format: One of app.export.jobs.table.formats_of(), such as "spz", "player" or "metrics-csv".
            on_progress: Notified of progress; its exceptions end the work, and then nothing is left.
            options: Entries of the format's job, such as frames=range(10).
        Raises:
            EngineError: It cannot be written; nothing is left.
        """
        return self._run_job(format, out, on_progress, options)

    def _run_job(
        self, format_name: str, out: Path | str, on_progress: TellExport | None, options: dict[str, Any]
    ) -> ExportResult:
        report = on_progress if on_progress is not None else _tell_nobody
        job = named_job(format_name, out, **options)
        return job.load().run(self.open_trained(), job, report)

    def open_trained(self) -> TrainedProject:
        """The finished clips as they are now, for reading. Raises what `capture` raises."""
        from app.evaluation.headless import open_trained

        return open_trained(self._project, self.capture)

    def _check_open(self) -> None:
        if self._is_closed:
            raise ProjectError("The project is closed.", hint="Open it again.", path=self.folder)


def _tell_nobody(progress: ExportProgress) -> None:
    pass


def open_scripted(folder: Path | str, *, read_only: bool = False, launch: Launch = ProcessWorker) -> ScriptedProject:
    """Open a project folder; see `app.scripting.open_project`."""
    use_kernel_cache()  # before anything imports kernels
    return ScriptedProject(open_project(Path(folder), is_writable=not read_only), launch=launch)
