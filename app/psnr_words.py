"""Words for the held-out PSNR of a clip: what it is over is part of the figure."""

from __future__ import annotations

WHOLE_NOTE = "Held-out PSNR: mean over every frame of the clip and every held-out camera"
PART_NOTE = (
    "Held-out PSNR of at most three pictures, as training measures it (~); replaced once every frame is measured"
)


def psnr_label(psnr: float, *, is_whole: bool) -> str:
    """The figure without its unit, for labels; ~ before one that is of a few pictures only."""
    return f"{psnr:.1f}" if is_whole else f"~{psnr:.1f}"


def psnr_note(*, is_whole: bool) -> str:
    """The pictures that the figure covers, as one sentence without its full stop."""
    return WHOLE_NOTE if is_whole else PART_NOTE


def psnr_words(psnr: float, *, is_whole: bool) -> str:
    """The figure in a line of text."""
    return f"held-out PSNR {psnr:.2f} dB, every frame" if is_whole else f"held-out PSNR ~{psnr:.2f} dB, few pictures"
