"""Curves and preferences: one bad byte costs at most that row or file, and is never believed."""

import os
from pathlib import Path

import pytest

from app.project.clips.metrics_file import read_metrics
from app.project.recents import RecentProject
from app.session.projects.settings import Settings
from engine.storage.json_files import checked_line


def test_a_bad_byte_costs_one_row_of_a_curve_and_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "0000.jsonl"
    rows = [{"step": 10 * i, "loss": 0.25 * i} for i in range(4)]
    lines = [checked_line(row).encode() for row in rows]
    lines[1] = lines[1].replace(b"0.25", b"\xff.25")
    lines[2] = lines[2].replace(b"0.5", b"9.5")
    path.write_bytes(b"".join(lines))
    assert read_metrics(path) == [rows[0], rows[3]]
    assert "2 damaged rows" in caplog.text
    assert str(path) in caplog.text


@pytest.mark.parametrize("step", ["1" + "0" * 400, "9" * 5000, '"word"', "null", "-1", "1.5", "true", "[1]"])
def test_rows_with_an_odd_step_are_left_out(tmp_path: Path, step: str) -> None:
    path = tmp_path / "0000.jsonl"
    path.write_text(f'{{"step": {step}, "loss": 1}}\n{{"step": 2, "loss": 1}}\n')
    assert [row["step"] for row in read_metrics(path)] == [2]


def test_preferences_that_cannot_be_read_count_as_empty(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "settings.json"
    settings = Settings(path)
    kept = RecentProject(str(tmp_path), str(tmp_path / "capture"), "p")
    settings.add_recent(kept)
    assert Settings(path).recent == [kept]
    for bad in (path.read_bytes().replace(b"recent", b"resent"), b"\xff", b"[" * 10_000, b'{"recent": "all"}', b"null"):
        path.write_bytes(bad)
        assert Settings(path).recent == []
        assert str(path) in caplog.text
        caplog.clear()
    path.unlink()
    os.mkfifo(path)
    assert Settings(path).recent == []
