"""What README answers in a sentence: the words are here, the figures are cells of the ledger."""

from __future__ import annotations

from tests.documents.ledger import ClipsEntry, clips_entry, entry, table_entry
from tests.documents.table import table

_LATER = "later clips against the first, fit"


def answers_table() -> str:
    """Questions that a reader asks first. Raises LookupError where the ledger has no such cell any more."""
    return table(("question", "answer"), [("Does quality last?", _lasting()), (_METHOD, _published())])


def _lasting() -> str:
    far, made = entry("far-clips"), table_entry("long-captures")
    if isinstance(far, ClipsEntry):
        near, late = (f"{far.rows[clip_index].psnr_fit_rest:.2f}" for clip_index in (1, 3))
    else:  # copied, before clips had files of their own
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


_METHOD = (
    "How does it compare with the method as published (`--preset paper`, its whole schedule), on the same kernels?"
)


def _published() -> str:
    theirs, ours = clips_entry("paper-sample"), clips_entry("paper-equal-steps")
    their_ball, our_ball = clips_entry("paper-basketball"), clips_entry("paper-basketball-default")

    def both(found: ClipsEntry, name: str) -> str:
        return " and ".join(f"{getattr(row, name):.1f}" for row in found.rows)

    times = theirs.total("training_s") / ours.total("training_s")
    return (
        f"On the sample with as many steps: {both(ours, 'psnr')} dB in the reference clip and the next one, published "
        f"{both(theirs, 'psnr')}; where things move {both(ours, 'psnr_moving')}, published "
        f"{both(theirs, 'psnr_moving')}; elsewhere {both(ours, 'psnr_rest')}, published {both(theirs, 'psnr_rest')}. "
        f"Published, training took about {times:.0f} times as long (one thread of a busy machine each), and the clips "
        f"take {theirs.total('n_bytes') / 1e6:.0f} MB instead of {ours.total('n_bytes') / 1e6:.1f}. On the reference "
        f"clip of the basketball at half size the defaults reach {our_ball.mean('psnr'):.1f} dB "
        f"({our_ball.mean('psnr_fit'):.1f} after the colour fit), the published method, which does not model that "
        f"cameras differ, {their_ball.mean('psnr'):.1f} ({their_ball.mean('psnr_fit'):.1f})"
    )
