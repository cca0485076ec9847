"""Others: the processes that train clips of the open project too, maybe on other computers: what is heard of them, and
what they are asked."""

from __future__ import annotations

from collections.abc import Mapping

from app.background.jobs import JobContext, Jobs
from app.project.claims.asks import Ask, ask_holder
from app.project.claims.claims import Elsewhere
from app.session.notices import Notices
from app.training.service import TrainingService


class Others:
    """For one thread, and nothing here waits.

    Attributes:
        heard: Clips that they train, with the number of what was said of each last; another value whenever one of them
            has said something new.

    Args:
        jobs, notices: Of the session.
    """

    def __init__(self, jobs: Jobs, notices: Notices) -> None:
        self._jobs, self._notices = jobs, notices
        self._known: Mapping[int, Elsewhere] = {}
        self.heard: dict[int, int | None] = {}

    def hear(self, service: TrainingService) -> None:
        """Take in what is known of them now."""
        known = service.elsewhere
        if known is self._known:
            return
        self._known = known
        heard = {index: None if one.holder is None else one.holder.beat for index, one in known.items()}
        if heard != self.heard:
            self.heard = heard

    def ask(self, service: TrainingService, clip_index: int | None, ask: Ask) -> bool:
        """Ask whoever trains a clip elsewhere, on a thread: the project's folder may lie on a slow network. Notices say
        how it went. Whether somebody trains it there.

        Args:
            clip_index: None for no certain one.
        """
        other = None if clip_index is None else service.elsewhere.get(clip_index)
        if clip_index is None or other is None:
            return False
        folder, key = service.project.folder, service.project.clip_name(clip_index)

        def work(context: JobContext) -> None:
            ask_holder(folder, key, ask)

        def done(_: None) -> None:
            detail = f"{other.who} trains it, and follows within seconds."
            self._notices.add("info", f"Asked to {ask} clip {clip_index}", detail)

        def failed(error: Exception) -> None:
            self._notices.add_failure(f"The training of clip {clip_index} could not be asked to {ask}", error)

        self._jobs.start(f"Asking to {ask} clip {clip_index}", work, done, failed)
        return True
