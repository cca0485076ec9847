"""Log files as lines: parsed, merged in the order of time, bounded, and never obeyed."""

from __future__ import annotations

from pathlib import Path

from app.background.log_reader import MAX_LINES, LogView, parse_log


def read(view: LogView, clip_log: Path | None = None) -> list[tuple[str, str]]:
    view.lines(3, clip_log)
    assert view.worker.wait_idle(300.0)
    return [(line.source, line.text) for line in view.lines(3, clip_log)]


def test_lines_have_time_level_and_source_and_tracebacks_stay_with_theirs() -> None:
    lines = parse_log(
        "left over from before\n"
        "2026-01-02 03:04:05,678 ERROR app.x: it broke: 50 % done\n"
        "Traceback:\n\n"
        "  line 3\x1b[31m\n"
        "2026-01-02 03:04:06,000 INFO app.x: on it goes\n",
        "program",
    )
    assert [(line.level, line.text) for line in lines] == [
        ("INFO", "left over from before"),
        ("ERROR", "app.x: it broke: 50 % done"),
        ("ERROR", "Traceback:"),
        ("ERROR", "  line 3\\x1b[31m"),
        ("INFO", "app.x: on it goes"),
    ]
    assert [line.time[11:] for line in lines[1:4]] == ["03:04:05,678"] * 3


def test_two_files_are_merged_by_time_and_new_lines_come(tmp_path: Path) -> None:
    program, clip = tmp_path / "program.log", tmp_path / "clip.log"
    program.write_text("2026-01-02 03:04:05,000 INFO app: one\n2026-01-02 03:04:09,000 INFO app: three\n")
    clip.write_text("2026-01-02 03:04:07,000 INFO app: two\n")
    view = LogView(program)
    assert read(view, clip) == [("program", "app: one"), ("clip 3", "app: two"), ("program", "app: three")]
    with clip.open("a") as file:
        file.write("2026-01-02 03:04:08,000 WARNING app: in between\n")
    assert read(view, clip)[2] == ("clip 3", "app: in between")
    assert [source for source, _ in read(view)] == ["program", "program"]
    view.close()


def test_missing_and_endless_files_cost_nothing(tmp_path: Path) -> None:
    view = LogView(tmp_path / "none.log")
    assert read(view, tmp_path / "nor this") == []
    long = tmp_path / "long.log"
    long.write_text("".join(f"2026-01-02 03:04:05,678 INFO app: line {n}\n" for n in range(3 * MAX_LINES)))
    lines = read(view, long)
    assert len(lines) == MAX_LINES
    assert lines[-1][1] == f"app: line {3 * MAX_LINES - 1}"
    view.close()
