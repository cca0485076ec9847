"""TrainingVerbs: carries out commands on the training, its queue and the versions of clips."""

from __future__ import annotations

from dataclasses import replace

from app.session.notices import Notices
from app.session.projects.settings import Settings
from app.session.questions import Question
from app.session.training.clip_versions import Versions
from app.session.training.live_training import LiveTraining
from app.session.training.own_settings_question import settings_question
from app.session.training.train_commands import (
    AskTrainSettings,
    HoldCommand,
    MoveInQueue,
    PauseTraining,
    RemoveFromQueue,
    RemoveVersion,
    RestoreVersion,
    ResumeTraining,
    SetLiveView,
    SetWorkers,
    StopAfterClip,
    StopTraining,
    TrainAll,
    TrainClip,
    TrainClips,
    TrainCommand,
    TrainNextClip,
    TrainStale,
)
from app.session.training.training_notices import listed, tell_dropped
from app.training.due import stale_clips
from app.training.messages import LIVE_VIEWS


class TrainingVerbs:
    """For one thread, and nothing here waits.

    Args:
        live, versions, notices, settings: Of the session.
    """

    def __init__(self, live: LiveTraining, versions: Versions, notices: Notices, settings: Settings) -> None:
        self._live, self._versions, self._notices, self._settings = live, versions, notices, settings

    def obey(self, command: TrainCommand | HoldCommand) -> Question | None:
        """Carry out a command. Returns the question to answer first, if any.

        Raises:
            EngineError: It cannot be done; states the cause.
        """
        live, service = self._live, self._live.service
        match command:
            case TrainNextClip():
                live.train_next()
            case PauseTraining(clip_index=clip_index):
                live.pause(clip_index)
            case ResumeTraining(clip_index=clip_index):
                live.resume(clip_index)
            case StopTraining(clip_index=clip_index):
                live.stop(clip_index)
            case SetWorkers(n=n):
                live.set_workers(n)
            case TrainClip(clip_index=clip_index, is_confirmed=is_confirmed, settings=settings):
                question = live.train(clip_index, is_confirmed=is_confirmed, own=dict(settings))
                return None if question is None else replace(question, settings=settings)
            case SetLiveView(mode=mode):
                if mode not in LIVE_VIEWS:
                    raise ValueError(f"the live view is one of {', '.join(LIVE_VIEWS)}, not {mode!r}")
                self._settings.set_live_view(mode)
                live.set_live_view(mode)
            case _ if service is None:
                live.tell_nothing_open()
            case TrainAll():
                self._train_all(range(len(service.clips)))
            case TrainClips(clip_indices=clip_indices):
                self._train_all(clip_indices)
            case TrainStale():
                service.enqueue_all(stale_clips(service.catalog))
            case AskTrainSettings(clip_index=clip_index):
                return settings_question(live.opened_project, service.catalog, clip_index)
            case MoveInQueue(clip_index=clip_index, position=position):
                service.queue.move(clip_index, position)
                tell_dropped(service.drop_hopeless(), self._notices)
            case RemoveFromQueue(clip_index=clip_index):
                service.queue.remove(clip_index)
                tell_dropped(service.drop_hopeless(), self._notices)
            case StopAfterClip(is_wanted=is_wanted):
                service.stop_after_clip(is_wanted)
            case RestoreVersion(clip_index=clip_index, version=version):
                self._versions.restore(clip_index, version)
            case RemoveVersion(clip_index=clip_index, version=version):
                self._versions.remove(clip_index, version)
        return None

    def _train_all(self, clip_indices: range | tuple[int, ...]) -> None:
        service = self._live.service
        assert service is not None
        left_out = service.enqueue_all(clip_indices)
        if left_out:
            self._notices.add(
                "warn",
                f"{len(left_out)} {'clip is' if len(left_out) == 1 else 'clips are'} left out of training",
                f"Damaged, or in need of a damaged clip: {listed(left_out)}.",
                "Restore the damaged file from a backup, or train that clip again: right-click it in the timeline.",
            )
        elif not service.is_busy and not service.queue:
            self._notices.add("info", "All of these clips are trained")
