"""Places: where clips of the open project train, and how many at once."""

from __future__ import annotations

from app.training.service import Launch
from engine.parallel import n_cores


class Places:
    """This computer, or others instead.

    Args:
        launch: Starts a worker here.
    """

    def __init__(self, launch: Launch) -> None:
        self._launch = launch
        self._n_wanted = 1
        self._far: tuple[Launch, int] | None = None

    @property
    def launch(self) -> Launch:
        """Starts the next worker."""
        return self._launch if self._far is None else self._far[0]

    @property
    def n_workers(self) -> int:
        """How many clips may train at once; here at most one for each core."""
        return min(max(self._n_wanted, 1), n_cores()) if self._far is None else self._far[1]

    def want(self, n: int) -> None:
        """Let so many clips train side by side on this computer, if it can."""
        self._n_wanted = n

    def use(self, launch: Launch | None, n_workers: int = 1) -> None:
        """Start workers elsewhere from now on, at most so many at a time; here again when None."""
        self._far = None if launch is None else (launch, n_workers)
