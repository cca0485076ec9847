"""When a training fails: the words for the error, and the progress that can be kept."""

from __future__ import annotations

import numpy as np

from app.training.worker.interface import Training
from app.training.worker.keeper import Keeper
from engine.clip_files.clip_state import ClipState
from engine.errors import EngineError


def words_of(error: Exception) -> tuple[str, str]:
    """Message and hint for the user."""
    if isinstance(error, EngineError):
        return error.parts()
    if isinstance(error, MemoryError):
        return "There is not enough memory.", "Use a smaller scale or fewer points."
    return f"{type(error).__name__}: {error}", "This is a bug in the program; the log has the details."


def keep_last_good(training: Training, keeper: Keeper) -> str:
    """Keep progress from before a failure, if it is valid. Says what is kept now."""
    try:
        is_good = _is_finite(training.state())
    except EngineError:
        is_good = False
    step = training.steps_done
    if is_good and (keeper.checkpoint_step == step or keeper.write_checkpoint(training)):
        return f"Step {step} is kept; training again with the same command resumes from there."
    kept = keeper.checkpoint_step
    why = "could not be kept" if is_good else "holds numbers that are not finite"
    if kept is None:
        return f"Step {step} {why}; training again starts from the beginning."
    return f"Step {step} {why}; training again with the same command resumes from step {kept}."


def _is_finite(state: ClipState) -> bool:
    """Whether every number of the state is finite."""
    return all(np.isfinite(a).all() for a in state.arrays.values() if np.issubdtype(a.dtype, np.floating))
