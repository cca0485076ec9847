"""Notices: what the user can act on, and what is a bug in the program."""

from __future__ import annotations

import logging

import pytest

from app.session.notices import MAX_NOTICES, Notices
from engine.errors import ProjectError


def test_a_failure_that_the_user_can_act_on_keeps_its_hint():
    notices = Notices()
    error = ProjectError("The file is damaged.", hint="Restore it.")
    assert not notices.has_told(error)
    notice = notices.add_failure("The clip cannot be shown", error)
    assert (notice.kind, notice.hint) == ("error", "Restore it.")
    assert notices.has_told(error)
    assert not notices.has_told(ProjectError("Another cause."))


def test_a_fault_of_the_program_says_so_and_is_logged(caplog: pytest.LogCaptureFixture):
    notices = Notices()
    with caplog.at_level(logging.ERROR):
        notice = notices.add_failure("The picture could not be drawn", ValueError("shapes differ"))
    assert notice.detail == "ValueError: shapes differ"
    assert "bug in the program" in notice.hint
    assert "shapes differ" in caplog.text
    assert not notices.has_told(ValueError("shapes differ")), "each of them is worth a look"


def test_the_oldest_make_room_and_every_change_is_counted():
    notices = Notices()
    for index in range(MAX_NOTICES + 2):
        notices.add("info", f"notice {index}")
    assert (len(notices), notices[0].title, notices.revision) == (MAX_NOTICES, "notice 2", MAX_NOTICES + 2)
    first = notices[0]
    notices.withdraw(first)
    notices.withdraw(first)  # gone already
    assert (len(notices), notices.revision) == (MAX_NOTICES - 1, MAX_NOTICES + 3)


def test_an_unknown_kind_is_refused():
    with pytest.raises(ValueError, match="info, warn or error"):
        Notices().add("fatal", "x")
