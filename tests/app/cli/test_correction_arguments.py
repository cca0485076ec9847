"""Corrections as flags, and which of them --apply takes."""

from __future__ import annotations

import argparse
import shlex

import pytest

from app.cli.captures.correction_arguments import (
    add_correction_arguments,
    asked_corrections,
    correction_flags,
    sure_corrections,
)
from engine.capture.writers.capture_json import Corrections
from engine.doctor.finding import Finding


def parsed(text: str) -> Corrections | None:
    parser = argparse.ArgumentParser()
    add_correction_arguments(parser)
    return asked_corrections(parser.parse_args(shlex.split(text)))


@pytest.mark.parametrize(
    "corrections",
    [
        Corrections(is_excluded={"cam 1": True, "cam2": False}),
        Corrections(offset_frames={"cam2": -2.25, "cam3": 5.0}),
        Corrections(holdout=["a", "b's"]),
        Corrections(holdout=[]),
        Corrections(masks={"cam1": "masks/cam1/*.png"}),
    ],
)
def test_flags_ask_for_what_they_were_made_of(corrections) -> None:
    assert parsed(correction_flags(corrections)) == corrections


def test_without_flags_nothing_is_asked_for() -> None:
    assert parsed("") is None
    assert parsed("--apply") is None


def test_apply_takes_what_is_certain_and_no_notes() -> None:
    def finding(severity, certainty, fix) -> Finding:
        return Finding("x", severity, (), (), "", certainty, "", fix)

    fixes = [Corrections(is_excluded={name: True}) for name in "abc"]
    shift = Corrections(offset_frames={"d": 2.0})
    findings = [
        finding("error", 0.9, fixes[0]),
        finding("warning", 0.5, fixes[1]),
        finding("note", 1.0, fixes[2]),
        finding("warning", 0.95, shift),
        finding("error", 1.0, None),
    ]
    assert sure_corrections(findings) == Corrections(is_excluded={"a": True}, offset_frames={"d": 2.0})
    assert sure_corrections(findings[1:3]) is None
