"""Tables 1 to 6 of the ClipGStream paper (Liang et al. 2026) as printed, to stand next to figures of this program.

Copied from the paper's own source. Its ablations are of one capture, which is not that of a user: such rows are always
marked as another capture. Definitions differ too, see docs/method.md.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple


class PaperFigure(NamedTuple):
    """A column. n_digits: After the point; None for as many as it takes."""

    title: str
    unit: str = ""
    n_digits: int | None = 3

    def text(self, value: float) -> str:
        """A value as the paper prints it."""
        return f"{value:g}" if self.n_digits is None else f"{value:.{self.n_digits}f}"


FIGURES = {
    "psnr": PaperFigure("PSNR", "dB", 2),
    "ssim": PaperFigure("SSIM"),
    "dssim1": PaperFigure("DSSIM1"),
    "dssim2": PaperFigure("DSSIM2"),
    "lpips": PaperFigure("LPIPS"),
    "fps": PaperFigure("FPS", "", None),
    "hours": PaperFigure("Time", "h", None),
    "megabytes": PaperFigure("Size", "MB", None),
}
"""All columns of the tables, by name."""


@dataclass(frozen=True, slots=True)
class PaperCapture:
    """What the paper measured on, and what tells such a capture: its layout, cameras, stored sizes and folder.

    Attributes:
        title: As a table names it.
        layout: Of the capture, as `clipgstream inspect` prints it.
        n_cameras: None for any number.
        sizes: Stored sizes of the pictures, px; none for any size.
        folder: Part of the folder's name.
    """

    title: str
    layout: str
    n_cameras: int | None = None
    sizes: tuple[tuple[int, int], ...] = ()
    folder: str = ""

    def is_like(self, layout: str, n_cameras: int, sizes: Collection[tuple[int, int]], path: Path) -> bool:
        """Whether a capture may be this one."""
        return (
            layout == self.layout
            and self.n_cameras in (None, n_cameras)
            and (not self.sizes or set(sizes) <= set(self.sizes))
            and self.folder in path.name.lower()
        )


@dataclass(frozen=True, slots=True)
class PaperRow:
    """One method.

    Attributes:
        family: static, frame-stream, clip or clip-stream; empty where the table does not say.
        method: As the table calls it.
        values: One for each column of the table; None where it has none.
        variants: Variants of `clipgstream ablate` that stand for it.
        lower_bounds: Columns in which the paper prints "more than".
    """

    family: str
    method: str
    values: tuple[float | None, ...]
    variants: tuple[str, ...] = ()
    lower_bounds: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PaperTable:
    """One table. columns: Of FIGURES."""

    number: int
    capture: PaperCapture
    columns: tuple[str, ...]
    rows: tuple[PaperRow, ...]

    def figures(self, row: PaperRow) -> dict[str, float | None]:
        """The values of one of its rows by column."""
        return dict(zip(self.columns, row.values, strict=True))

    def texts(self, row: PaperRow) -> list[str]:
        """The values of one of its rows as printed; empty where there are none."""
        return [
            "" if value is None else ("> " if column in row.lower_bounds else "") + FIGURES[column].text(value)
            for column, value in self.figures(row).items()
        ]


LONG_360 = PaperCapture("Long 360, 1,400 frames", "colmap frames", 36)
_GZ = PaperCapture("VRU GZ, 250 frames", "colmap frames", 34, ((1920, 1080),))
_N3DV_SIZES = ((2704, 2028), (1352, 1014))
_N3DV = PaperCapture("N3DV, five scenes of 300 frames", "n3dv", None, _N3DV_SIZES)
_SALMON = PaperCapture("flame salmon of N3DV, 1,200 frames", "n3dv", None, _N3DV_SIZES, "salmon")
_QUALITY = ("psnr", "dssim1", "dssim2", "lpips")
_WITH_SSIM = ("psnr", "ssim", "lpips")
_OURS = PaperRow("clip-stream", "ClipGStream", (24.54, 0.079, 0.036, 0.146), ("full",))

PAPER_TABLES = (
    PaperTable(
        1,
        LONG_360,
        _QUALITY,
        (
            PaperRow("static", "2DGS", (23.80, 0.085, 0.042, 0.181)),
            PaperRow("static", "3DGS", (24.13, 0.087, 0.040, 0.159)),
            PaperRow("static", "ScaffoldGS", (23.53, 0.096, 0.048, 0.203)),
            PaperRow("frame-stream", "3DGStream", (21.94, 0.105, 0.053, 0.200)),
            PaperRow("frame-stream", "iFVC", (22.35, 0.101, 0.050, 0.192)),
            PaperRow("clip", "4DGaussian", (22.01, 0.103, 0.052, 0.198)),
            PaperRow("clip", "Swift4D", (23.01, 0.094, 0.048, 0.180)),
            PaperRow("clip", "LocalDyGS", (23.11, 0.093, 0.046, 0.178)),
            _OURS,
        ),
    ),
    PaperTable(
        2,
        _GZ,
        _WITH_SSIM,
        (
            PaperRow("static", "GOF", (30.39, 0.949, 0.141)),
            PaperRow("static", "2DGS", (30.78, 0.949, 0.187)),
            PaperRow("static", "3DGS", (30.50, 0.949, 0.171)),
            PaperRow("", "4DGaussian", (28.32, 0.930, 0.186)),
            PaperRow("", "SpaceTimeGS", (27.42, 0.926, 0.193)),
            PaperRow("", "LocalDyGS", (30.58, 0.944, 0.173)),
            PaperRow("", "ClipGStream", (30.67, 0.946, 0.137)),
        ),
    ),
    PaperTable(
        3,
        _N3DV,
        ("psnr", "dssim1", "dssim2", "fps", "hours", "megabytes"),
        (
            PaperRow("frame-stream", "StreamRF", (28.26, None, None, 10.9, None, 5310)),
            PaperRow("frame-stream", "3DGStream", (31.67, None, None, 215, 1.0, 1230)),
            PaperRow("frame-stream", "4DGC", (31.58, None, None, None, None, None)),
            PaperRow("frame-stream", "HiCoM", (31.17, None, None, None, None, None)),
            PaperRow("clip", "NeRFPlayer", (30.69, 0.034, None, 0.05, 6.0, 5130)),
            PaperRow("clip", "HyperReel", (31.10, 0.036, None, 2, None, 360)),
            PaperRow("clip", "K-Planes", (31.63, None, 0.018, 0.3, 5.0, 311)),
            PaperRow("clip", "HexPlane", (31.70, None, 0.014, 0.21, 12.0, 240)),
            PaperRow("clip", "MixVoxels", (31.73, None, 0.015, 4.6, None, 500)),
            PaperRow("clip", "4DGaussian", (31.02, 0.030, None, 30, 0.67, 90)),
            PaperRow("clip", "RealTimeGS", (32.01, None, 0.014, 114, 9.0, 1000), lower_bounds=("megabytes",)),
            PaperRow("clip", "SpaceTimeGS", (32.05, 0.026, 0.014, 140, 5, 200), lower_bounds=("hours",)),
            PaperRow("clip", "LocalDyGS", (32.28, 0.028, 0.014, 105, 0.58, 100)),
            PaperRow("clip-stream", "ClipGStream", (32.53, 0.024, 0.012, 106, 0.5, 98)),
        ),
    ),
    PaperTable(
        4,
        _SALMON,
        _WITH_SSIM,
        (
            PaperRow("", "4DGaussian", (28.89, 0.952, 0.196)),
            PaperRow("", "4K4D", (21.29, 0.826, 0.196)),
            PaperRow("", "ENeRF", (23.48, 0.894, 0.259)),
            PaperRow("", "3DGS", (28.61, 0.949, 0.210)),
            PaperRow("", "Dy3DGS", (25.91, 0.880, 0.255)),
            PaperRow("", "LocalDyGS", (28.15, 0.912, 0.153)),
            PaperRow("", "ClipGStream", (29.40, 0.917, 0.144)),
        ),
    ),
    PaperTable(
        5,
        LONG_360,
        _QUALITY,
        (
            PaperRow("", "w/o DI", (24.34, 0.081, 0.038, 0.152), ("decoder-new",)),
            PaperRow("", "w/o RAC", (23.62, 0.083, 0.044, 0.160), ("residual-none", "residual-full")),
            _OURS,
        ),
    ),
    PaperTable(
        6,
        LONG_360,
        _QUALITY,
        (
            PaperRow("", "Independent Training", (21.85, 0.142, 0.068, 0.316), ("independent",)),
            PaperRow("", "Shared STF", (23.11, 0.093, 0.046, 0.178), ("field-continue",)),
            _OURS,
        ),
    ),
)

_ABLATIONS = [table for table in PAPER_TABLES if any(row.variants for row in table.rows if row is not _OURS)]
OWN_FIGURES = {
    "psnr": ("psnr",),
    "dssim1": ("dssim1",),
    "dssim2": ("dssim_range2", "dssim_ms"),
    "lpips": ("lpips",),
}
"""Columns of the ablation tables, and the figures here that they may be: the paper does not define its DSSIM2."""
ANOTHER_CAPTURE = (
    f"Paper: tables 5 and 6 of the paper, of {LONG_360.title}, another capture, with models and schedules of another "
    "length. Compare the differences between rows, not the values. Its row of a shared STF equals that of LocalDyGS in "
    "its table 1."
)


def tables_like(layout: str, n_cameras: int, sizes: Collection[tuple[int, int]], path: Path) -> list[PaperTable]:
    """Tables 1 to 4 as far as they are of a capture like this one, see PaperCapture."""
    return [
        table
        for table in PAPER_TABLES
        if table not in _ABLATIONS and table.capture.is_like(layout, n_cameras, sizes, path)
    ]


def beside_ablations(lines: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of the ablation tables next to the variants that stand for them; none where there is only one of these.

    Args:
        lines: Variants, with their figures by the names of OWN_FIGURES.
    Returns:
        variant, tables, paper_row, own figures, and those of the paper as `paper_` and the column's name.
    """
    found = []
    for line in lines:
        of_variant = [(table, row) for table in _ABLATIONS for row in table.rows if line["variant"] in row.variants]
        if not of_variant:
            continue
        table, row = of_variant[0]
        numbers = ", ".join(str(table.number) for table, _ in of_variant)
        entry = {"variant": line["variant"], "tables": numbers, "paper_row": row.method}
        for column, value in table.figures(row).items():
            entry |= {name: line.get(name) for name in OWN_FIGURES[column]} | {f"paper_{column}": value}
        found.append(entry)
    return found if len(found) > 1 else []
