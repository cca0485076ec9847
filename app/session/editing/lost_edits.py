"""LostEdits: which edits of the open project have lost their picks, looked up again when clips or edits change."""

from __future__ import annotations

from collections.abc import Callable

from app.training.service import TrainingService
from engine.editing.edit import Edit
from engine.editing.lost_picks import LostPicks, lost_picks


class LostEdits:
    """For one thread. service: Gives the training of the open project, None without one."""

    def __init__(self, service: Callable[[], TrainingService | None]) -> None:
        self._service = service
        self._edits: tuple[Edit, ...] = ()
        self._known: tuple[object, tuple[LostPicks, ...]] = (None, ())

    def of(self, edits: tuple[Edit, ...]) -> tuple[LostPicks, ...]:
        """Those among a stack."""
        service = self._service()
        if service is None or not edits:
            return ()
        catalog = service.catalog
        key = (catalog, catalog.revision)
        if self._edits is not edits or self._known[0] != key:  # held, so that nothing else gets their place in memory
            self._edits = edits
            origins = {index: origin for index in range(len(catalog)) if (origin := catalog[index].origin)}
            self._known = (key, lost_picks(edits, origins))
        return self._known[1]
