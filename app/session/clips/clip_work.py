"""ClipWork: everything but training that is done to the clips of the open project, and the questions before it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime

from app.background.jobs import JobContext, Jobs
from app.document.changes.clip_changes import with_merge, with_reference, with_split
from app.document.project_document import ProjectDocument
from app.project.allowed_changes import is_other_cut
from app.project.clips.clip_catalog import ClipCatalog
from app.project.clips.clip_versions import best_version, list_versions, why_not
from app.project.disk.room import WHAT, make_room, room_of
from app.project.disk.use import DiskUse
from app.project.opening.opened_project import OpenedProject
from app.project.project import Project
from app.psnr_words import psnr_words
from app.session.clips.clip_commands import (
    ApplyDeletions,
    AskAboutDamage,
    AskFreeSpace,
    ClipCommand,
    CutCommand,
    FreeSpace,
    MergeClips,
    SetReferenceClip,
    SplitClip,
)
from app.session.clips.clip_questions import ClipQuestion, CutQuestion, DamagedQuestion, RoomQuestion
from app.session.clips.costs import expected_seconds
from app.session.clips.disk_reader import DiskReader
from app.session.clips.permanence import Permanence
from app.session.editing.kept_document import KeptDocument
from app.session.notices import Notices
from app.session.part import SessionPart
from app.session.training.live_training import LiveTraining
from app.status import DependencyStatus
from app.training.train_queue import needed_clips
from engine.capture.clip import Clip
from engine.errors import EngineError, ProjectError
from engine.text import size_text

MAX_KEPT = 64
"""Clips whose dependencies stay in memory."""


class ClipWork(SessionPart):
    """For one thread, and nothing here waits.

    Args:
        jobs, notices, live, document: Of the session.
        ask: Takes a question that came up later.
    """

    def __init__(
        self,
        jobs: Jobs,
        notices: Notices,
        live: LiveTraining,
        document: KeptDocument,
        ask: Callable[[ClipQuestion], None],
    ) -> None:
        self._jobs, self._notices, self._live, self._document, self._ask = jobs, notices, live, document, ask
        self._permanence = Permanence(jobs, notices, document, ask)
        self._opened: OpenedProject | None = None
        self._disk = DiskReader()
        self._dependencies: dict[int, DependencyStatus] = {}
        self._dependencies_of: tuple[int, int] = (0, 0)
        self._looked_for_damage: tuple[int, int] = (0, 0)
        self._asked_damage: set[int] = set()

    def open(self, opened: OpenedProject) -> None:
        """Take up a project, or the same one with other settings."""
        if self._opened is None or self._opened.generation != opened.generation:
            self._asked_damage = set()
        self._opened = opened
        self._dependencies_of = self._looked_for_damage = (0, 0)
        self._disk.note_change()

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self.open(opened)

    def check_idle(self) -> None:
        """Check that no clip is written again, so that clips may be cut otherwise. Raises ProjectError."""
        self._permanence.check_idle()

    def check_change(self, before: ProjectDocument, after: ProjectDocument) -> None:
        """Check that no clip is written again where clips are cut otherwise. Raises ProjectError."""
        if is_other_cut(before.settings, after.settings):
            self.check_idle()

    # ---------------------------------------------------------------- commands

    def obey(self, command: ClipCommand) -> ClipQuestion | None:
        """Carry out a command. Returns the question to answer first, if that is known at once.

        Raises:
            ProjectError: It cannot be done; states the cause.
        """
        opened, service = self._opened, self._live.service
        if opened is None or service is None:
            self._live.tell_nothing_open()
            return None
        match command:
            case SplitClip() | MergeClips() | SetReferenceClip():
                return self._cut(command, opened, service.catalog)
            case AskFreeSpace(what=what, clip_index=clip_index):
                self._ask_room(what, clip_index)
            case FreeSpace(what=what, clip_index=clip_index):
                self._free(what, clip_index)
            case AskAboutDamage(clip_index=clip_index):
                self._ask_about_damage(clip_index)
            case ApplyDeletions():
                self._permanence.obey(command, opened, service)
        return None

    def _cut(self, command: CutCommand, opened: OpenedProject, catalog: ClipCatalog) -> CutQuestion | None:
        project, n_frames = opened.project, opened.capture.n_frames
        after = changed_document(project.document, command, n_frames)
        if after == project.document:
            return None
        if not command.is_confirmed:
            question = cut_question(command, catalog, opened.clips, after.settings.clips(n_frames), opened)
            if question.n_unused or question.outdated:
                return question
        self._document.change(after, cut_words(command, opened.clips).lower())
        return None

    # ---------------------------------------------------------------- room on the disk

    def disk_use(self) -> DiskUse | None:
        """The project's use of the disk; None until that was looked up."""
        opened, service = self._opened, self._live.service
        if opened is None or service is None:
            return None
        basis = (opened.generation, id(service), service.catalog.revision)
        return self._disk.use(opened.project, len(opened.clips), basis)

    def _ask_room(self, what: str, clip_index: int | None) -> None:
        opened = self._opened
        assert opened is not None
        project, n_clips = opened.project, len(opened.clips)
        project.check_writable()

        def work(context: JobContext) -> RoomQuestion:
            room = room_of(project, n_clips, what, clip_index)
            of_clip = "" if clip_index is None else f" of clip {clip_index}"
            return RoomQuestion(what, clip_index, f"{WHAT[what]}{of_clip}", room.n_clips, room.n_bytes)

        def done(question: RoomQuestion) -> None:
            if question.n_bytes:
                self._ask(question)
            else:
                self._notices.add("info", "Nothing to free", f"Requested: {question.words}.")

        self._jobs.start("Looking for files to delete", work, done, self._failed("The disk use could not be read"))

    def _free(self, what: str, clip_index: int | None) -> None:
        opened, service = self._opened, self._live.service
        assert opened is not None
        assert service is not None
        project, n_clips = opened.project, len(opened.clips)
        project.check_writable()
        training = service.in_training
        if what == "checkpoints" and training and (clip_index is None or clip_index in training):
            running = min(training) if clip_index is None else clip_index
            raise ProjectError(
                f"Clip {running} is training and keeps its progress there.",
                hint="Wait until it is finished.",
            )

        def work(context: JobContext) -> int:
            return make_room(project, room_of(project, n_clips, what, clip_index))

        def done(n_bytes: int) -> None:
            self._disk.note_change()
            if what == "checkpoints":
                for index in range(n_clips) if clip_index is None else (clip_index,):
                    service.catalog.update(index)
            self._notices.add("info", f"{size_text(n_bytes / 1e6)} are free now")

        self._jobs.start("Freeing disk space", work, done, self._failed("The files could not be removed"))

    # ---------------------------------------------------------------- damage

    def poll(self) -> bool:
        """Ask about damage that was found."""
        self.look_for_damage()
        return False

    def look_for_damage(self) -> None:
        """Ask about a clip that was found to be damaged, once each."""
        opened, service = self._opened, self._live.service
        if opened is None or service is None or not opened.project.is_writable:
            return
        seen = (id(service), service.catalog.revision + 1)
        if seen == self._looked_for_damage:
            return
        self._looked_for_damage = seen
        damaged = [index for index in range(len(service.catalog)) if service.catalog[index].state == "damaged"]
        first = next((index for index in damaged if index not in self._asked_damage), None)
        if first is not None and first not in service.in_training:
            self._asked_damage.add(first)
            self._ask_about_damage(first)

    def _ask_about_damage(self, clip_index: int) -> None:
        opened, service = self._opened, self._live.service
        assert opened is not None
        assert service is not None
        catalog, project = service.catalog, opened.project
        if not 0 <= clip_index < len(catalog) or catalog[clip_index].state != "damaged":
            return
        reason = catalog[clip_index].reason
        outdated = tuple(
            index
            for index in range(len(catalog))
            if catalog[index].state == "stale" and clip_index in self._needs(index)
        )
        n_frames = [opened.clips[index].n_frames for index in (clip_index,)]
        seconds = expected_seconds(
            catalog, opened.clips, n_frames, n_references=int(clip_index == opened.reference_index)
        )

        def work(context: JobContext) -> DamagedQuestion:
            version, text, why = recoverable(project, clip_index)
            return DamagedQuestion(clip_index, reason, version, text, why, outdated, seconds)

        self._jobs.start(
            f"Looking for earlier versions of clip {clip_index}",
            work,
            self._ask,
            self._failed("The versions could not be read"),
        )

    # ---------------------------------------------------------------- dependencies

    def dependencies(self, clip_index: int) -> DependencyStatus:
        """The clips that a clip depends on, and those that depend on it."""
        opened, service = self._opened, self._live.service
        if opened is None or service is None or not 0 <= clip_index < len(opened.clips):
            return DependencyStatus()
        of = (id(service), service.catalog.revision)
        if of != self._dependencies_of or len(self._dependencies) > MAX_KEPT:
            self._dependencies, self._dependencies_of = {}, of
        if clip_index not in self._dependencies:
            config = opened.project.settings.config()
            needed_by = tuple(
                index for index in range(len(opened.clips)) if clip_index in needed_clips(opened.project, index, config)
            )
            trained_on_it = tuple(service.catalog.dependents(clip_index))
            lengths = [opened.clips[index].n_frames for index in trained_on_it]
            self._dependencies[clip_index] = DependencyStatus(
                self._needs(clip_index),
                needed_by,
                trained_on_it,
                expected_seconds(service.catalog, opened.clips, lengths) if lengths else None,
            )
        return self._dependencies[clip_index]

    def _needs(self, clip_index: int) -> tuple[int, ...]:
        assert self._opened is not None
        return needed_clips(self._opened.project, clip_index)

    # ---------------------------------------------------------------- ends

    @property
    def finished(self) -> object:
        """Differs when something was looked up."""
        newest = self._disk.worker.newest
        return None if newest is None else newest[0]

    def _failed(self, title: str) -> Callable[[Exception], None]:
        def failed(error: Exception) -> None:
            if isinstance(error, EngineError):
                self._notices.add_error(title, error)
            else:
                self._notices.add_failure(title, error)

        return failed

    def close(self) -> None:
        """End the thread."""
        self._disk.close()


def changed_document(document: ProjectDocument, command: CutCommand, n_frames: int) -> ProjectDocument:
    """The document as the command wants it.

    Raises:
        ProjectError: That cannot be.
    """
    match command:
        case SplitClip(frame_index=frame_index):
            return with_split(document, frame_index, n_frames)
        case MergeClips(clip_index=clip_index):
            return with_merge(document, clip_index, n_frames)
        case SetReferenceClip(clip_index=clip_index):
            return with_reference(document, clip_index, n_frames)


def cut_words(command: CutCommand, clips: Sequence[Clip]) -> str:
    """The command in a few words."""
    match command:
        case SplitClip(frame_index=frame_index):
            clip = next((clip for clip in clips if clip.start <= frame_index < clip.stop), None)
            return f"Split clip {'' if clip is None else clip.clip_index} at frame {frame_index}"
        case MergeClips(clip_index=clip_index):
            return f"Merge clips {clip_index} and {clip_index + 1}"
        case SetReferenceClip(clip_index=clip_index):
            return f"Make clip {clip_index} the reference"


def cut_question(
    command: CutCommand, catalog: ClipCatalog, before: Sequence[Clip], after: Sequence[Clip], opened: OpenedProject
) -> CutQuestion:
    """The question before clips are cut otherwise.

    Args:
        before, after: The clips.
    """
    spans = {(clip.start, clip.stop) for clip in after}
    trained = [index for index in range(len(catalog)) if catalog[index].state in ("trained", "stale")]
    gone = [clip.clip_index for clip in before if (clip.start, clip.stop) not in spans]
    if isinstance(command, SetReferenceClip):
        outdated = {index for index in trained if catalog[index].state == "trained"}
    else:
        outdated = {other for index in gone for other in catalog.outdated_by(index)} - set(gone)
    known = {(clip.start, clip.stop) for clip in before}
    lengths = [clip.n_frames for clip in after if (clip.start, clip.stop) not in known]
    lengths += [before[index].n_frames for index in sorted(outdated)]
    is_reference_new = isinstance(command, SetReferenceClip) or opened.reference_index in gone
    return CutQuestion(
        command,
        cut_words(command, before),
        len(set(gone) & set(trained)),
        tuple(sorted(outdated)),
        expected_seconds(catalog, before, lengths, n_references=int(is_reference_new)),
    )


def recoverable(project: Project, clip_index: int) -> tuple[int | None, str, str]:
    """The version with which a damaged clip could be replaced: its number, a description, and why there is none."""
    version = best_version(project, clip_index)
    if version is None or version.header is None:
        found = list_versions(project, clip_index)
        if not found:
            return None, "", "The clip was trained only once and has no earlier version."
        header = found[0].header
        return None, "", found[0].damage if header is None else why_not(project, clip_index, header)
    figures = version.header.figures
    psnr = figures.held_out_psnr
    figure = "" if psnr is None else f", {psnr_words(psnr, is_whole=figures.held_out_whole)}"
    trained = datetime.fromtimestamp(version.trained_s).strftime("%Y-%m-%d %H:%M")
    return version.number, f"trained {trained}{figure}", ""
