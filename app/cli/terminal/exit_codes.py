"""The exit code of a training, whatever command it was."""

from __future__ import annotations

from collections.abc import Sequence

from app.cli.arguments import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_OK, EXIT_STOPPED
from app.evaluation.headless import BAD_INPUT_KINDS, ClipOutcome


def exit_code(outcomes: Sequence[ClipOutcome]) -> int:
    """Of a training that ended like this: bad input, which trying again does not change, only where nothing else went
    wrong. A clip whose file is damaged counts as such."""
    wrong = [outcome for outcome in outcomes if outcome.state in ("failed", "damaged")]
    if wrong:
        is_input = all(outcome.state == "damaged" or outcome.kind in BAD_INPUT_KINDS for outcome in wrong)
        return EXIT_BAD_INPUT if is_input else EXIT_FAILED
    return EXIT_STOPPED if any(outcome.state == "stopped" for outcome in outcomes) else EXIT_OK
