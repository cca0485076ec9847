"""A report as text: one table of kernels, speed next to error, and one of training steps by stage."""

from __future__ import annotations

from collections.abc import Sequence

from app.lab.bench.raster import limit_shares
from app.lab.bench.rows import IterationRow, KernelRow, Trade
from app.lab.bench.suite import Report
from app.lab.bench.timing import Timing

_KERNEL_HEAD = (
    "scene",
    "size",
    "forward ms",
    "backward ms",
    "G pairs/s",
    "% of limit",
    "checked at",
    "value err",
    "gradient err",
    "vs torch",
    "peak MB",
)
_TRADE_HEAD = ("setting", "s", "MB", "PSNR dB", "moving dB")
_STEP_ERROR_HEAD = ("checked at", "pixel err", "loss err", "gradient err", "update err", "vs torch")


def report_text(report: Report) -> str:
    """All tables with the line of the machine. Times are medians with minima in brackets."""
    parts = [
        str(report.machine),
        f"Limit: {report.fma_per_s / 1e9:.1f} G multiply-adds of sixteen lanes per second. Times are medians of the "
        "runs (minima). Errors are against float64; torch is plain torch in float32 at the size of the check. A "
        "training step is checked in the middle of its picture, with all its anchors and by the same camera.",
    ]
    if report.kernels:
        parts.append(_aligned([_KERNEL_HEAD, *(_kernel_cells(row, report.fma_per_s) for row in report.kernels)]))
    if report.iterations:
        names = [name for name, _ in report.iterations[0].stages]
        head = ("training step, ms", *names, "sum", "whole step", "Gaussians", *_STEP_ERROR_HEAD)
        parts.append(_aligned([head, *(_iteration_cells(row) for row in report.iterations)]))
    if report.trades:
        parts.append(_aligned([_TRADE_HEAD, *dict.fromkeys(map(_trade_cells, report.trades))]))
    return "\n\n".join(parts)


def _kernel_cells(row: KernelRow, fma_per_s: float) -> tuple[str, ...]:
    shares = limit_shares(row, fma_per_s)
    pairs = "-"
    if row.forward_pairs_per_s is not None and row.backward_pairs_per_s is not None:
        pairs = f"{row.forward_pairs_per_s / 1e9:.2f} / {row.backward_pairs_per_s / 1e9:.2f}"
    return (
        f"{row.operation} {row.scene}",
        row.size,
        _timing(row.forward),
        _timing(row.backward),
        pairs,
        "-" if shares is None else f"{100 * shares[0]:.0f} / {100 * shares[1]:.0f}",
        "same" if row.checked_at == row.size else row.checked_at,
        f"{row.value_error:.1e}",
        f"{row.gradient_error:.1e}",
        f"{row.reference_ratio:.3g}x",
        "-" if row.peak_mb is None else f"{row.peak_mb:.0f}",
    )


def _iteration_cells(row: IterationRow) -> tuple[str, ...]:
    stages = [f"{timing.median_ms:.2f}" for _, timing in row.stages]
    total = sum(timing.median_ms for _, timing in row.stages)
    errors = row.errors
    return (
        f"{row.scene}, {row.size}",
        *stages,
        f"{total:.1f}",
        _timing(row.total),
        str(row.n_gaussians),
        errors.checked_at,
        f"{errors.value_error:.1e}",
        f"{errors.loss_error:.1e}",
        f"{errors.gradient_error:.1e}",
        f"{errors.update_error:.1e}",
        f"{row.reference_ratio:.3g}x",
    )


def _trade_cells(trade: Trade) -> tuple[str, ...]:
    moving = "-" if trade.psnr_moving_db is None else f"{trade.psnr_moving_db:.2f}"
    size = f"{trade.n_bytes / 1e6:.2f}"
    return f"{trade.operation}, {trade.setting}", f"{trade.seconds:.4g}", size, f"{trade.psnr_db:.2f}", moving


def _timing(timing: Timing) -> str:
    return f"{timing.median_ms:.2f} ({timing.min_ms:.2f})"


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    """Columns of equal width; the first one to the left, numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append("  ".join(cells).rstrip())
    return "\n".join([lines[0], "-" * max(map(len, lines)), *lines[1:]])
