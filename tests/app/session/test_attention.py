from __future__ import annotations

import pytest

import app.session.showing.recent_input
from app.session.showing.recent_input import LASTS_S, Attention


def test_attention_ends_a_while_after_the_last_change(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]
    monkeypatch.setattr(app.session.showing.recent_input.time, "monotonic", lambda: now_s[0])
    attention = Attention()
    assert attention.follow("here")
    now_s[0] += 0.9 * LASTS_S
    assert attention.follow("here")
    assert attention.follow("there")
    now_s[0] += 0.9 * LASTS_S
    assert attention.follow("there")
    now_s[0] += 0.2 * LASTS_S
    assert not attention.follow("there")
