"""Which cameras have matches with which, as lines of a table; and what to do where these are too few or contradict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

MAX_LINES = 12
"""Pairs that are listed; of more, those with most matches."""
FEW_MATCHES = 30
"""Fewer than so many do not join two cameras."""
WHAT_TO_DO = (
    "Put neighbouring cameras closer together, less than about 20 degrees apart, so that they see the same finely "
    "patterned things, and let somebody walk through the whole scene while all film; docs/calibration.md explains what "
    "to film. Or film a board and use --board. Or calibrate in another program and open its files: TOML of Caliscope, "
    "Pose2Sim or anipose, intri.yml and extri.yml of EasyMocap, COLMAP, transforms.json (docs/capture_formats.md)."
)


@dataclass(frozen=True, slots=True)
class PairCounts:
    """Matches of two cameras that fit one motion.

    Attributes:
        first, second: Names of the cameras.
        n_matches: How many.
        n_explained: Those that the cameras found explain; None where none were found.
    """

    first: str
    second: str
    n_matches: int
    n_explained: int | None = None


def pair_lines(pairs: Sequence[PairCounts]) -> list[str]:
    """A table of pairs, most matches first."""
    most = sorted(pairs, key=lambda pair: -pair.n_matches)[:MAX_LINES]
    width = max((len(name) for pair in most for name in (pair.first, pair.second)), default=0)
    lines = []
    for pair in most:
        line = f"  {pair.first:<{width}}  {pair.second:<{width}}  {pair.n_matches:6,} matches"
        if pair.n_explained is not None:
            line += f", {100 * pair.n_explained / max(pair.n_matches, 1):3.0f} % explained"
        lines.append(line)
    n_joined, n_more = sum(pair.n_matches >= FEW_MATCHES for pair in pairs), len(pairs) - len(most)
    lines.append(
        f"  {f'and {n_more:,} more pairs; ' if n_more else ''}{n_joined:,} of {len(pairs):,} pairs have {FEW_MATCHES} "
        "matches or more"
    )
    return lines
