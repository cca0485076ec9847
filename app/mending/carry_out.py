"""Carries out a request on the files of a project: reads clips, mends, and leaves drafts. Replaces no file."""

from __future__ import annotations

import time
from pathlib import Path

from app.background.kernels import use_threads, warm_up_reporting
from app.evaluation.headless import open_trained
from app.mending.request import MendJob, MendResult
from app.project.clips.clip_versions import read_finished
from app.project.mends.record import MendedClip, MendRecord, now_text
from app.project.opening.project_access import open_project
from app.project.project import Project
from app.training.worker.build import clip_training
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.clip_files.compact import write_compact_clip
from engine.errors import ProjectError
from engine.mending.stretch import Stretch
from engine.parallel import n_cores
from engine.progress import Progress, ReportProgress
from engine.training.config import TrainConfig


def mend(job: MendJob, report: ReportProgress) -> MendResult:
    """Mend, and leave the clips that changed as drafts.

    Args:
        job: The request, and the folder for drafts.
        report: Receives progress; an exception from it ends the work.
    Raises:
        EngineError: It cannot be mended; states why.
    """
    from engine.mending.measuring import Threads  # torch takes a second to import
    from engine.mending.mend import StretchMending
    from engine.training.clip_training import ClipTraining

    started_s = time.monotonic()
    report(Progress("Starting", 0.0))
    warm_up_reporting(lambda progress: report(Progress(progress.stage, 0.0, progress.message)))
    project = open_project(job.project, is_writable=False)
    opened = open_trained(project)
    settings, capture = project.settings, opened.capture.without(project.document.exclusions)
    stretch = job.request.stretch(opened.clips)
    reference = _checked_reference(project, opened.reference)
    states = _states(project, opened.clips, opened.trained, stretch)
    holdout = capture.camera_indices(settings.holdout)

    def make(clip_index: int, config: TrainConfig) -> ClipTraining:
        clip, seed = opened.clips[clip_index], settings.seed
        quiet = lambda progress: report(Progress(progress.stage, 0.0, progress.message))  # noqa: E731
        return clip_training(
            capture,
            clip,
            config,
            holdout=holdout,
            seed=seed,
            reference=reference,
            prep_dir=project.prep_dir,
            regions=project.document.regions,
            report=quiet,
        )

    n_threads = n_cores() if job.n_threads is None else job.n_threads
    mended = StretchMending(
        capture,
        stretch,
        opened.clips,
        states,
        reference,
        holdout=holdout,
        make_training=make,
        backend=opened.backend,
        threads=Threads(n_threads, lambda: use_threads(1)),
        report=report,
    ).run(job.request.method)
    drafts = {}
    for index, clip in mended.clips.items():
        path = Path(job.folder) / f"mended-{index:04d}.safetensors"
        write_compact_clip(path, clip)
        if read_clip_state(path).fingerprint != clip.state.fingerprint:
            raise ProjectError("A mended clip read back differs from the one written; the disk may be damaged.")
        drafts[index] = str(path)
    changed = tuple(
        MendedClip(index, states[index].header.fingerprint, clip.state.header.fingerprint)
        for index, clip in mended.clips.items()
    )
    record = MendRecord(
        words=stretch.words,
        first=stretch.first,
        stop=stretch.stop,
        clips=changed,
        before=mended.before,
        after=mended.after,
        attempts=mended.attempts,
        diagnosis=mended.diagnosis.words,
        advice=mended.advice,
        seconds=round(time.monotonic() - started_s, 1),
        made=now_text(),
    )
    return MendResult(record, drafts)


def _checked_reference(project: Project, reference: ClipState | None) -> ClipState:
    config = project.settings.config()
    if config.independent or reference is None:
        raise ProjectError(
            "The clips of this project share nothing, so they cannot be mended.",
            hint="Train them again, perhaps with more steps.",
        )
    if config.field != "per_clip":
        raise ProjectError(
            "Several clips of this project share one field, so none can be mended alone.",
            hint="Train with field=per_clip in another project.",
        )
    return reference


def _states(project: Project, clips: list[Clip], trained: list[int], stretch: Stretch) -> dict[int, ClipState]:
    """Clips of the stretch, and their neighbours that can be read."""
    indices = stretch.clip_indices
    states = {}
    for index in range(indices[0] - 1, indices[-1] + 2):
        if index in indices:
            if index not in trained:
                raise ProjectError(f"Clip {index} is not trained.", hint="Train it before it is mended.")
            states[index] = read_finished(project, index)
        elif index in trained and 0 <= index < len(clips):
            try:
                states[index] = read_finished(project, index)
            except ProjectError:
                continue  # a damaged one does not count as a neighbour
    base = project.inherited_index(indices[-1])
    fingerprint = None if base is None else read_clip_state(project.clip_path(base)).header.fingerprint
    for index in [one for one in states if states[one].header.reference_fingerprint not in (None, fingerprint)]:
        if index in indices:
            raise ProjectError(f"Clip {index} is out of date.", hint="Train it again first.")
        del states[index]
    return states
