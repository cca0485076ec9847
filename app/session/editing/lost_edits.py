"""LostEdits: which edits of the open project have lost what was picked, looked up again when clips or edits change."""

from __future__ import annotations

from collections.abc import Callable

from app.training.service import TrainingService
from engine.editing.edit import Edit
from engine.editing.lost_picks import LostPicks, lost_picks

_TRAINED = "trained-"
"""How revisions of finished clips begin; their fingerprint follows."""


class LostEdits:
    """For one thread. service: Gives the training of the open project, None without one."""

    def __init__(self, service: Callable[[], TrainingService | None]) -> None:
        self._service = service
        self._known: tuple[object, tuple[LostPicks, ...]] = (None, ())

    def of(self, edits: tuple[Edit, ...]) -> tuple[LostPicks, ...]:
        """Those among a stack."""
        service = self._service()
        if service is None or not edits:
            return ()
        catalog = service.catalog
        key = (id(edits), id(catalog), catalog.revision)
        if self._known[0] != key:
            revisions = ((index, catalog[index].revision) for index in range(len(catalog)))
            fingerprints = {
                index: revision.removeprefix(_TRAINED) for index, revision in revisions if revision.startswith(_TRAINED)
            }
            self._known = (key, lost_picks(edits, fingerprints))
        return self._known[1]
