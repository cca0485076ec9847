"""Flags of `clipgstream inspect` that correct a capture, and corrections as such flags."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path

from app.cli.arguments import path_argument
from engine.capture.capture import Capture
from engine.capture.layout.limits import MAX_NAME_LENGTH
from engine.capture.pixels.frame_fit import FITS, FrameFit
from engine.capture.pixels.transfer_curves import CURVE_NAMES
from engine.capture.writers.capture_json import Corrections, write_corrections
from engine.doctor.finding import Finding
from engine.errors import CaptureError

APPLY_CERTAINTY = 0.8
"""Least certainty of the corrections of --apply; it ignores mere notes."""
NONE = "none"


def add_correction_arguments(command: argparse.ArgumentParser) -> None:
    """The flags; each may be given several times where it names a camera."""
    group = command.add_argument_group("corrections", "Written to capture.json; nothing else of the capture changes.")
    group.add_argument("--exclude", metavar="CAM", action="append", default=[], help="do not use this camera")
    group.add_argument("--include", metavar="CAM", action="append", default=[], help="use this camera again")
    group.add_argument(
        "--shift",
        metavar="CAM=FRAMES",
        action="append",
        default=[],
        type=_shift,
        help="its own frame is the capture's frame plus FRAMES; replaces its earlier offset",
    )
    group.add_argument(
        "--hold-out", metavar="CAM", action="append", default=[], help='keep it out of training; "none" for none'
    )
    group.add_argument(
        "--mask",
        metavar="CAM=FILES",
        action="append",
        default=[],
        type=_mask,
        help="masks of what moves: a pattern such as masks/cam00/*.png, or a video",
    )
    group.add_argument(
        "--fit",
        choices=tuple(fit.replace("_", "-") for fit in FITS),
        help="how frames whose shape differs from their calibration were made: scaled, or cropped at the right and "
        "lower "
        "border (end), at the left and upper one (start), or at both by the same (middle)",
    )
    group.add_argument(
        "--curve",
        choices=CURVE_NAMES,
        help="the log or HDR curve that all frames were recorded in, to be converted for display",
    )
    group.add_argument("--apply", action="store_true", help="apply the fixes the doctor is sure of, except notes")
    group.add_argument("--out", metavar="FOLDER", type=path_argument, help="write capture.json there instead")


def asked_corrections(options: argparse.Namespace) -> Corrections | None:
    """The corrections that flags other than --apply ask for; None where none was given."""
    names = ("exclude", "include", "shift", "hold_out", "mask", "fit", "curve")
    if not any(getattr(options, name) for name in names):
        return None
    holdout = [name for name in options.hold_out if name.lower() != NONE] if options.hold_out else None
    return Corrections(
        is_excluded={**dict.fromkeys(options.exclude, True), **dict.fromkeys(options.include, False)},
        offset_frames=dict(options.shift),
        holdout=holdout,
        masks=dict(options.mask),
        fit=None if options.fit is None else as_fit(options.fit),
        curve=options.curve,
    )


def as_fit(word: str) -> FrameFit:
    """A value of --fit as capture.json has it."""
    return next(fit for fit in FITS if fit.replace("_", "-") == word)


def sure_corrections(findings: Sequence[Finding]) -> Corrections | None:
    """The corrections of --apply: of errors and warnings that are certain enough; None where there are none."""
    fixes = [
        finding.fix
        for finding in findings
        if finding.fix is not None and finding.severity != "note" and finding.certainty >= APPLY_CERTAINTY
    ]
    if not fixes:
        return None
    holdouts = [fix.holdout for fix in fixes if fix.holdout is not None]
    return Corrections(
        is_excluded={name: value for fix in fixes for name, value in fix.is_excluded.items()},
        offset_frames={name: value for fix in fixes for name, value in fix.offset_frames.items()},
        holdout=holdouts[0] if holdouts else None,
        masks={name: value for fix in fixes for name, value in fix.masks.items()},
    )


def write_asked(capture: Capture, corrections: Corrections, target: Path | None) -> Path:
    """Write them; returns the file.

    Raises:
        CaptureError: A camera is unknown, or too few would be left.
        DiskError: The folder cannot be written.
    """
    left = [name for name in capture.rig.names if not corrections.is_excluded.get(name, False)]
    if len(left) < 2:
        text = f"Only {len(left)} of {len(capture.rig)} cameras would be left."
        raise CaptureError(text, hint="Training needs two; leave out fewer.", path=capture.path)
    return write_corrections(capture.layout, capture.path, corrections, target=target)


def correction_flags(corrections: Corrections) -> str:
    """The flags that ask for these corrections, as they are typed."""
    words: list[str] = []
    for name, is_excluded in corrections.is_excluded.items():
        words += ["--exclude" if is_excluded else "--include", name]
    for name, offset in corrections.offset_frames.items():
        words += ["--shift", f"{name}={offset:g}"]
    if corrections.holdout is not None:
        for name in corrections.holdout or (NONE,):
            words += ["--hold-out", name]
    for name, files in corrections.masks.items():
        words += ["--mask", f"{name}={files}"]
    if corrections.fit is not None:
        words += ["--fit", corrections.fit.replace("_", "-")]
    if corrections.curve is not None:
        words += ["--curve", corrections.curve]
    return shlex.join(words)


def _shift(text: str) -> tuple[str, float]:
    name, number = _assigned(text, "CAM=FRAMES, such as cam03=-2")
    try:
        return name, float(number)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{number!r} is not a number of frames") from None


def _mask(text: str) -> tuple[str, str]:
    return _assigned(text, "CAM=FILES, such as cam03=masks/cam03/*.png")


def _assigned(text: str, form: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not (name and sign and value) or len(name) > MAX_NAME_LENGTH:
        raise argparse.ArgumentTypeError(f"write {form}")
    return name, value
