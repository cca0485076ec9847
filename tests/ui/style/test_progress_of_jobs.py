"""Words about a job that runs: something is told from the first moment."""

import re

from app.status import JobStatus
from ui.style.numbers import format_count, parsed_count
from ui.style.progress_words import job_words


def test_a_job_tells_stage_share_time_and_time_left():
    def times(job: JobStatus | None, now_s: float) -> list[str]:
        words = job_words(job, now_s)
        assert words
        return re.findall(r"\d+:\d\d", words)

    assert times(None, 5.0) == []
    assert times(JobStatus("Calibrating", began_s=100.0), 102.0) == ["0:02"]
    half = JobStatus("Calibrating", 0.4, "Key points", began_s=100.0)
    assert "40 %" in job_words(half, 132.0)
    assert job_words(JobStatus("Finding"), 0.0) == "Starting"
    assert job_words(JobStatus("Finding", 0.25), 0.0) == "25 %", "it has started"
    assert times(half, 132.0) == ["0:32", "0:48"]
    assert times(JobStatus("Calibrating", 0.01, "Key points", 100.0), 145.0) == ["0:45"], "too early to tell"
    assert times(JobStatus("Saving", 0.5, "0003"), 145.0) == []  # nobody noted when it began


def test_counts_are_read_as_they_are_written():
    assert parsed_count(format_count(22_000)) == 22_000
    assert parsed_count("22000") == 22_000
    assert parsed_count("many") is None
