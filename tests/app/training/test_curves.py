"""Curves of a training: bounded, and read again only where their file has changed."""

import json
import time

import pytest

from app.training import curves
from app.training.curves import MAX_POINTS, CurveReader, Curves, append_thinned, is_number, thinned
from tests.app.conftest import DEADLINE_S


def test_a_curve_that_grows_too_long_loses_every_second_point_but_the_ends():
    history: list[tuple[int, float]] = []
    for step in range(5 * MAX_POINTS):
        append_thinned(history, (step, 0.5))
    assert len(history) <= MAX_POINTS
    steps = [step for step, _ in history]
    assert steps == sorted(set(steps))
    assert (steps[0], steps[-1]) == (0, 5 * MAX_POINTS - 1)


def test_a_short_curve_stays_and_a_long_one_keeps_its_ends():
    assert thinned([(1, 0.5), (2, 0.5)]) == [(1, 0.5), (2, 0.5)]
    points = thinned([(step, 0.0) for step in range(3 * MAX_POINTS)])
    assert len(points) <= MAX_POINTS
    assert (points[0][0], points[-1][0]) == (0, 3 * MAX_POINTS - 1)


@pytest.mark.parametrize(
    ("value", "expected"), [(1, True), (0.5, True), (True, False), (float("nan"), False), (None, False), ("1", False)]
)
def test_what_can_be_drawn(value, expected):
    assert is_number(value) is expected


def read(reader: CurveReader, path) -> Curves:
    """Ask until the thread has read it."""
    until_s = time.monotonic() + DEADLINE_S
    while (found := reader.curves(path)) is None:
        assert time.monotonic() < until_s, "the curves were not read"
        time.sleep(0.001)
    return found


def test_a_file_is_read_once_until_it_changes(tmp_path, monkeypatch):
    n_read = 0
    original = curves.read_curves

    def counted(path):
        nonlocal n_read
        n_read += 1
        return original(path)

    monkeypatch.setattr(curves, "read_curves", counted)
    path = tmp_path / "0000.jsonl"
    reader = CurveReader()
    try:
        assert reader.curves(path) == Curves()  # no such file
        path.write_text(json.dumps({"step": 1, "loss": 0.5}) + "\n")
        assert read(reader, path).loss == [(1, 0.5)]
        assert read(reader, path).loss == [(1, 0.5)]
        assert n_read == 1
        rows = [{"step": 1, "loss": 0.5}, {"step": 2, "loss": None}, {"step": 3, "held_out_psnr": 20.0}]
        path.write_text("".join(json.dumps(row) + "\n" for row in rows))
        found = read(reader, path)
        assert (found.loss, found.psnr, n_read) == ([(1, 0.5)], [(3, 20.0)], 2)
    finally:
        reader.close()
