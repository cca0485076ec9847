"""Words, signs and colours of findings: severity is shown by a sign and a word as well as by its colour."""

from __future__ import annotations

from collections.abc import Sequence

from engine.capture.writers.capture_json import Corrections
from engine.doctor.finding import Finding
from ui.style import theme
from ui.style.colors import Color
from ui.style.theme import Icon

SEVERITY_ICONS = {"error": Icon.ERROR, "warning": Icon.WARNING, "note": Icon.INFO}
SEVERITY_WORDS = {"error": "Error", "warning": "Warning", "note": "Note"}


def severity_color(severity: str) -> Color:
    """Of the theme in use."""
    return {"error": theme.VERMILLION, "warning": theme.ORANGE, "note": theme.SKY}[severity]


def certainty_text(finding: Finding) -> str:
    """As "very likely, 88 %"."""
    return f"{finding.certainty_word}, {100 * finding.certainty:.0f} %"


def fix_words(fix: Corrections) -> tuple[str, str]:
    """Label of a button, and the same with names for a question."""
    excluded = [name for name, value in fix.is_excluded.items() if value]
    if excluded:
        return "Exclude", f"Exclude {_named(excluded)}"
    if fix.offset_frames:
        shifts = [f"{name} by {offset:+g} frames" for name, offset in fix.offset_frames.items()]
        return "Shift", f"Shift {_named(shifts)}"
    if fix.masks:
        return "Use masks", f"Use masks of {_named(list(fix.masks))}"
    return "Hold out", f"Hold out {_named(list(fix.holdout or ())) or 'no camera'}"


def summary_text(findings: Sequence[Finding]) -> str:
    """How many of each severity there are."""
    counts = {word: sum(SEVERITY_WORDS[f.severity] == word for f in findings) for word in SEVERITY_WORDS.values()}
    parts = [f"{n} {word.lower()}{'' if n == 1 else 's'}" for word, n in counts.items() if n]
    return ", ".join(parts) if parts else "Nothing found"


def _named(names: Sequence[str]) -> str:
    if len(names) > 4:
        return f"{', '.join(names[:3])} and {len(names) - 3} more"
    return names[0] if len(names) == 1 else " and ".join([", ".join(names[:-1]), names[-1]]) if names else ""
