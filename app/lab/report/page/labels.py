"""Names of figures as a reader of a report sees them; files and JSON keep the short ones."""

from __future__ import annotations

from app.lab.added import figures as added
from engine.metrics.columns import COLUMNS as MEASURED

COLUMNS = MEASURED | added.COLUMNS

_KINDS = {
    "psnr": "PSNR",
    "cc_psnr": "PSNR, colours corrected as gsplat does (cc_psnr)",
    "psnr_light": "PSNR, after the fit of colour and light",
    "ssim": "SSIM",
    "dssim1": "DSSIM1",
    "dssim_range2": "DSSIM, constants of range 2",
    "dssim_ms": "DSSIM, multi-scale",
    "flip": "FLIP",
    "lpips": "LPIPS",
    "lpips_unscaled": "LPIPS, inputs not scaled",
    "moving_share": "Share of moving pixels",
}
_PARTS = {"moving": "moving pixels", "rest": "pixels that do not move"}


def figure_label(name: str) -> str:
    """The label of a column of engine.metrics, as "PSNR, moving pixels, after the colour fit"; else the name itself."""
    if name not in COLUMNS:
        return name
    rest, words = name, []
    for part, said in _PARTS.items():
        if name not in _KINDS and rest.endswith(f"_{part}"):
            rest, words = rest.removesuffix(f"_{part}"), [said]
    if rest.endswith("_fit"):
        rest, words = rest.removesuffix("_fit"), [*words, "after the colour fit"]
    return ", ".join([_KINDS.get(rest, rest), *words])


FIGURE_LABELS = {name: figure_label(name) for name in COLUMNS}
