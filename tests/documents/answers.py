"""What README answers in a sentence: the words are here, the figures are cells of the ledger."""

from __future__ import annotations

from tests.documents.ledger import table_entry
from tests.documents.table import table

_LATER = "later clips against the first, fit"


def answers_table() -> str:
    """Questions that a reader asks first. Raises LookupError where the ledger has no such cell any more."""
    return table(("question", "answer"), [("Does quality last?", _lasting()), (_SIZES, _sizes())])


def _lasting() -> str:
    far, made = table_entry("far-clips"), table_entry("long-captures")
    near, late = far.cell("1 (10 to 19)", "still, fit"), far.cell("3 (110 to 119)", "still, fit")
    nothing = float(made.cell("nothing", _LATER))
    more = {row[0]: nothing - float(row[made.columns.index(_LATER)]) for row in made.rows}
    shadow = more.pop("a shadow crosses the floor")
    return (
        "A basketball clip 110 frames from the reference clip, after two seconds in which cameras darken by 3 to 5 %, "
        f"has held-out still pixels of {late} dB after the colour fit; the clip next to the reference clip has {near} "
        f"dB ({far.day}). Over 300 frames of generated captures with changing exposure or light, later clips lose at "
        f"most {max(more.values()):.2f} dB more than over one without, {shadow:.2f} dB more under a moving shadow "
        f"(smallest preset, one seed, {made.day})"
    )


_SIZES = "How does it compare with the model sizes of ClipGStream's paper and released code, on the same kernels?"


def _sizes() -> str:
    found = table_entry("paper-sizes")

    def cells(way: str, steps: int) -> tuple[str, str]:
        row = next(row for row in found.rows if row[0] == way and row[1] == str(steps))
        return row[found.columns.index("PSNR")], row[found.columns.index("seconds")]

    ours, theirs = cells("basketball, this scheme", 405), cells("basketball, published, with the fused decode", 405)
    small, large = cells("sample, this scheme", 2160), cells("sample, published, with the fused decode", 2160)
    return (
        f"A later clip of the basketball reaches {ours[0]} dB in {ours[1]} s, with the published sizes {theirs[0]} dB "
        f"in {theirs[1]} s. The larger sizes end higher: on the sample {large[0]} dB in {large[1]} s, against "
        f"{small[0]} dB in {small[1]} s ({found.day})"
    )
