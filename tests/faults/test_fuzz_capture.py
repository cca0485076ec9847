"""The short version of the damaged and hostile captures; `python -m tests.faults.fuzz_capture` is the long one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.fuzz_capture import run_case
from tests.faults.tally import run_cases


@pytest.mark.slow
def test_no_damaged_capture_is_more_than_a_message(tmp_path: Path) -> None:
    tally = run_cases("fuzz_capture", run_case, n_cases=80, seed=7, work_dir=tmp_path)
    assert [f"{outcome.verdict}: {outcome.what}: {outcome.detail}" for outcome in tally.faults] == []
    assert {outcome.verdict for outcome in tally.outcomes} == {"typed", "accepted"}
