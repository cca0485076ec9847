"""Words about a job that runs: something is told from the first moment."""

from app.status import JobStatus
from ui.style.numbers import format_count, parsed_count
from ui.style.progress_words import job_words


def test_a_job_tells_stage_share_time_and_time_left():
    assert job_words(None, 5.0) == "Starting"
    assert job_words(JobStatus("Calibrating", began_s=100.0), 102.0) == "Starting, 0:02"
    half = JobStatus("Calibrating", 0.4, "Key points", began_s=100.0)
    assert job_words(half, 132.0) == "Key points, 40 %, 0:32, about 0:48 left"
    assert job_words(JobStatus("Calibrating", 0.01, "Key points", 100.0), 145.0) == "Key points, 1 %, 0:45"
    assert job_words(JobStatus("Saving", 0.5, "0003"), 145.0) == "0003, 50 %"  # nobody noted when it began


def test_counts_are_read_as_they_are_written():
    assert parsed_count(format_count(22_000)) == 22_000
    assert parsed_count("22000") == 22_000
    assert parsed_count("many") is None
