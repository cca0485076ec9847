"""Fuzzy matching: how well a few typed letters stand for a text. Pure; knows neither actions nor drawing.

The typed words may come in any order; the letters of each have to come in the text in their order. Letters at the start
of words and letters that follow each other count most, so that "tnc" finds "Train the next clip" and "clip 12" finds
"Go to clip 12" before "Go to clip 112".
"""

from __future__ import annotations

from dataclasses import dataclass

LETTER, WORD_START, FOLLOWS, TEXT_START, WHOLE_WORD, WHOLE_TEXT = 1.0, 6.0, 5.0, 3.0, 6.0, 10.0
GAP = 0.15
"""Lost per letter that is skipped between two that match, up to MOST_GAP of them."""
MOST_GAP = 12
LENGTH = 0.01
"""Lost per letter of the text: of two that match equally well, the shorter one is meant."""
MAX_TYPED = 80
_NEVER = float("-inf")


@dataclass(frozen=True, slots=True)
class Match:
    """A text that the typed letters stand for.

    Attributes:
        score: Higher is better; compares matches of the same typed letters only.
        positions: Of the letters of the text that were meant, ascending.
    """

    score: float
    positions: tuple[int, ...] = ()


def match(typed: str, text: str) -> Match | None:
    """How well the typed letters stand for a text; None where they do not. Nothing typed stands for everything."""
    plain = folded(text)
    total, positions = -LENGTH * len(text), set()
    words = folded(typed[:MAX_TYPED]).split()
    if not all(_is_within(word, plain) for word in words):  # most texts end here
        return None
    for word in words:
        found = _best(word, plain)
        total += found.score
        positions.update(found.positions)
    if words and " ".join(words) == plain:
        total += WHOLE_TEXT
    return Match(total, tuple(sorted(positions)))


def folded(text: str) -> str:
    """The text in lower case, with as many characters as before."""
    return "".join(lower if len(lower := sign.lower()) == 1 else sign for sign in text)


def _is_within(word: str, text: str) -> bool:
    """Do the letters of a word come in a text in their order?"""
    at = -1
    for letter in word:
        at = text.find(letter, at + 1)
        if at < 0:
            return False
    return True


def _best(word: str, text: str) -> Match:
    """The best way to find the letters of a word in a text in which they come in their order."""
    n = len(text)
    bonus = [
        LETTER + (WORD_START if _starts_word(text, i) else 0.0) + (TEXT_START if i == 0 else 0.0) for i in range(n)
    ]
    scores = [bonus[i] if text[i] == word[0] else _NEVER for i in range(n)]
    came_from: list[list[int]] = []
    for letter in word[1:]:
        new, origins = [_NEVER] * n, [-1] * n
        best, best_at = _NEVER, -1  # of those further back, as seen from i
        for i in range(1, n):
            if i >= 2 and scores[i - 2] >= best:
                best, best_at = scores[i - 2], i - 2
            if text[i] != letter:
                continue
            follows, skips = scores[i - 1] + FOLLOWS, best - GAP * min(i - best_at - 1, MOST_GAP)
            if max(follows, skips) > _NEVER:
                new[i] = bonus[i] + max(follows, skips)
                origins[i] = i - 1 if follows >= skips else best_at
        scores = new
        came_from.append(origins)
    end = max(range(n), key=lambda i: scores[i])
    score, positions = scores[end], [end]
    for origins in reversed(came_from):
        positions.append(origins[positions[-1]])
    positions.reverse()
    is_one_piece = positions[-1] - positions[0] == len(word) - 1
    if is_one_piece and _starts_word(text, positions[0]) and (end + 1 == n or not text[end + 1].isalnum()):
        score += WHOLE_WORD
    return Match(score, tuple(positions))


def _starts_word(text: str, i: int) -> bool:
    return text[i].isalnum() and (i == 0 or not text[i - 1].isalnum())
