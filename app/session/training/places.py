"""TrainingPlaces: where clips of the open project train, and how many at once."""

from __future__ import annotations

from collections.abc import Mapping

from app.plan.forecasts import Kind
from app.plan.side_by_side import SideBySide, side_by_side
from app.training.service import Launch, TrainingService
from engine.errors import ProjectError
from engine.machine import free_memory_bytes
from engine.parallel import n_cores
from engine.training.plan.plan import TrainingPlan


class TrainingPlaces:
    """This computer, or others instead.

    Args:
        launch: Starts a worker here.
    """

    def __init__(self, launch: Launch) -> None:
        self._launch = launch
        self._n_wanted = 1
        self._here = SideBySide(1)
        self._decided_of: tuple[object, ...] = ()
        self._far: tuple[Launch, int] | None = None

    @property
    def launch(self) -> Launch:
        """Starts the next worker."""
        return self._launch if self._far is None else self._far[0]

    @property
    def n_workers(self) -> int:
        """How many clips may train at once."""
        return self._here.n_workers if self._far is None else self._far[1]

    @property
    def why_fewer(self) -> str:
        """Why that is less than was asked for, one sentence; empty where it is not."""
        return self._here.why_fewer if self._far is None else ""

    def want(self, n: int) -> None:
        """Let so many clips train side by side on this computer, as far as its cores and memory allow."""
        self._n_wanted = n

    def use(self, launch: Launch | None, n_workers: int = 1) -> None:
        """Start workers elsewhere from now on, at most so many at a time; here again when None."""
        self._far = None if launch is None else (launch, n_workers)

    def decide(self, service: TrainingService, kinds: Mapping[Kind, TrainingPlan]) -> None:
        """Decide anew how many train here, where something has changed.

        Args:
            kinds: A plan of every kind of clip; none before they are made.
        """
        decided_of = (self._n_wanted, service, kinds, len(service.runs))
        if decided_of != self._decided_of:
            self._decided_of = decided_of
            self._here = _side_by_side(max(self._n_wanted, 1), service, kinds)


def _side_by_side(n: int, service: TrainingService, kinds: Mapping[Kind, TrainingPlan]) -> SideBySide:
    """As many as fit. Clips that train already have their memory."""
    plans = [plan for (is_source, _), plan in kinds.items() if is_source] or list(kinds.values())
    clip_mb = max((plan.memory_mb for plan in plans), default=0.0)
    free = free_memory_bytes() if plans else None
    free_mb, too_many = None if free is None else free / 1e6 + clip_mb * len(service.runs), ""
    while True:
        try:
            found = side_by_side(
                n,
                n_ready=max(len(service.clips) - 1, 1),
                is_chain=service.project.settings.config().follows_previous,
                n_cores=n_cores(),
                clip_mb=clip_mb,
                free_mb=free_mb,
            )
        except ProjectError as error:
            n, too_many = min(n, n_cores()) - 1, too_many or error.message
        else:
            return SideBySide(found.n_workers, too_many or found.why_fewer)
