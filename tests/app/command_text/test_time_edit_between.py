"""Steps of time are found again from what they did, as commands to copy."""

from pathlib import Path

from app.command_text.step_command import step_command
from app.command_text.time_edit_between import time_edit_between
from app.document.changes.timing_changes import TIME_EDITS, ChangeSegment, Order, ResetTime, timing_changed
from tests.app.document.documents import EMPTY
from tests.app.document.test_timing_changes import N_FRAMES, STEPS


def test_steps_are_found_again_from_what_they_did() -> None:
    document = EMPTY
    for step in (*STEPS, ResetTime()):
        after = timing_changed(document, step, N_FRAMES)
        found = time_edit_between(document.timing, after.timing, N_FRAMES)
        assert (found is None) == isinstance(step, ChangeSegment)
        if found is not None:
            assert timing_changed(document, found, N_FRAMES) == after
        document = after
    assert set(TIME_EDITS) == {"trim", "split", "speed", "reverse", "freeze", "loop", "order", "reset-time"}


def test_a_step_is_copied_as_its_verb_and_others_in_full(tmp_path: Path) -> None:
    after = timing_changed(EMPTY, STEPS[0], N_FRAMES)
    command = step_command(tmp_path, EMPTY, after, N_FRAMES)
    assert command is not None
    assert command.arguments == ("edit", str(tmp_path), "trim", "--frames", "5:55")
    assert command.statement == "project.time_edit('trim', frames=(5, 55))"
    in_full = step_command(tmp_path, EMPTY, after)
    assert in_full is not None
    assert in_full.arguments[2:] == ("--put", "-")
    ordered = timing_changed(timing_changed(after, STEPS[1], N_FRAMES), Order((1, 0)), N_FRAMES)
    command = step_command(tmp_path, timing_changed(after, STEPS[1], N_FRAMES), ordered, N_FRAMES)
    assert command is not None
    assert command.arguments[2:] == ("order", "1,0")
