"""Typed letters and the texts they stand for."""

from __future__ import annotations

import pytest

from ui.panels.actions.table import ACTIONS
from ui.shell.finding.fuzzy import MAX_TYPED, folded, match


def best(typed: str, *texts: str) -> list[str]:
    """Those that match, best first."""
    found = [(found.score, text) for text in texts if (found := match(typed, text)) is not None]
    return [text for _, text in sorted(found, key=lambda pair: -pair[0])]


def test_letters_have_to_come_in_their_order() -> None:
    assert match("tnc", "Train the next clip") is not None
    assert match("cnt", "Train the next clip") is None
    assert match("xyz", "Train the next clip") is None
    assert match("nn", "n") is None


def test_starts_of_words_come_before_letters_inside() -> None:
    assert best("fr", "Draw for free", "Frame the whole scene", "offer") == [
        "Frame the whole scene",
        "Draw for free",
        "offer",
    ]


def test_words_may_come_in_any_order() -> None:
    assert best("clip next", "Train the next clip", "Next camera") == ["Train the next clip"]


def test_a_whole_word_comes_before_the_beginning_of_a_longer_one() -> None:
    assert best("clip 1", "Go to clip 12", "Go to clip 1", "Go to clip 111")[0] == "Go to clip 1"
    assert best("clip 12", "Go to clip 112", "Go to clip 12", "Go to clip 1 of 2")[0] == "Go to clip 12"


def test_letters_together_come_before_letters_apart() -> None:
    assert best("home", "How one may end", "Home")[0] == "Home"


def test_positions_are_those_of_the_letters_meant() -> None:
    found = match("tnc", "Train the next clip")
    assert found is not None
    assert [("Train the next clip"[i]).lower() for i in found.positions] == ["t", "n", "c"]
    assert found.positions == (0, 10, 15)
    both = match("clip next", "Train the next clip")
    assert both is not None
    assert "".join("Train the next clip"[i] for i in both.positions) == "nextclip"


def test_nothing_typed_stands_for_everything_and_case_for_nothing() -> None:
    assert match("", "Quit") is not None
    assert match("   ", "Quit") is not None
    assert match("q", "") is None
    assert match("QUIT", "quit") is not None


@pytest.mark.parametrize("text", ["İstanbul ß ﬁ", "100% ##a\nb", "\u202eabc\u05d0\u05d1", "\U0001f600 smile"])
def test_any_text_can_be_searched(text: str) -> None:
    assert len(folded(text)) == len(text)
    found = match(text, text)
    assert found is not None
    assert all(0 <= i < len(text) for i in found.positions)


def test_endless_input_is_cut() -> None:
    assert match("a" * 10_000, "a" * MAX_TYPED) is not None
    assert match("a" * 10_000, "a" * (MAX_TYPED - 1)) is None


@pytest.mark.slow
def test_each_action_is_the_first_that_its_own_words_find() -> None:
    texts = [action.text for action in ACTIONS]
    for text in texts:
        assert best(text, *texts)[0] == text
