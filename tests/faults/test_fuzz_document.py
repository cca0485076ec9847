"""The short version of the damaged documents; `python -m tests.faults.fuzz_document` is the long one."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.fuzz_document import run_case
from tests.faults.tally import run_cases


@pytest.mark.slow
def test_no_damaged_document_is_believed_and_no_loss_is_silent(tmp_path: Path) -> None:
    tally = run_cases("fuzz_document", run_case, n_cases=80, seed=7, work_dir=tmp_path)
    assert [f"{outcome.verdict}: {outcome.what}: {outcome.detail}" for outcome in tally.faults] == []
    assert {outcome.verdict for outcome in tally.outcomes} == {"typed", "accepted"}
