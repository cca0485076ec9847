"""Transfer curves: from values as a camera recorded them, in a log curve or for HDR, to the display-encoded values that
everything else works with.

A curve leads to linear light, in which 1 is a surface that reflects everything (of HLG and PQ: the reference white of
203 cd/m2); that is cut off at 1 and encoded as sRGB. Nothing is tone-mapped, and primaries stay those of the camera.

Log curves are defined on code values of ten bits (code / 1023), wherever black and white lie in the file. Of video with
levels 64 to 940, which decoding stretches to 0..1, they are brought back first. Sources: the makers' published
formulas; ITU-R BT.2100 for HLG and PQ, BT.2408 for their reference white.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Literal, NamedTuple, get_args

import numpy as np

from engine.images.srgb import encoded_of

CurveName = Literal["slog3", "vlog", "logc3", "logc4", "clog3", "flog", "hlg", "pq", "linear"]
CURVE_NAMES: tuple[CurveName, ...] = get_args(CurveName)
MAX_LEVEL = 65_535
_CODES, _BLACK, _RANGE = 1023.0, 64.0, 876.0
_WHITE_CD_M2 = 203.0
_PEAK_CD_M2 = 10_000.0


class TransferCurve(NamedTuple):
    """One curve.

    Attributes:
        title: Its name for users.
        linear: Linear light of values. [N] float64 each
        is_of_codes: Whether it is defined on code values, see above.
    """

    title: str
    linear: Callable[[np.ndarray], np.ndarray]
    is_of_codes: bool = True


def _slog3(x: np.ndarray) -> np.ndarray:
    cut = 171.2102946929
    code = x * _CODES
    bright = 10.0 ** ((code - 420.0) / 261.5) * (0.18 + 0.01) - 0.01
    return np.where(code >= cut, bright, (code - 95.0) * 0.01125 / (cut - 95.0))


def _vlog(x: np.ndarray) -> np.ndarray:
    return np.where(x < 0.181, (x - 0.125) / 5.6, 10.0 ** ((x - 0.598206) / 0.241514) - 0.00873)


def _logc3(x: np.ndarray) -> np.ndarray:
    """Of an exposure index of 800."""
    a, b, c, d, e, f = 5.555556, 0.052272, 0.247190, 0.385537, 5.367655, 0.092809
    return np.where(x > e * 0.010591 + f, (10.0 ** ((x - d) / c) - b) / a, (x - f) / e)


def _logc4(x: np.ndarray) -> np.ndarray:
    a, b, c = (2.0**18 - 16.0) / 117.45, (1023.0 - 95.0) / 1023.0, 95.0 / 1023.0
    s = 7.0 * np.log(2.0) * 2.0 ** (7.0 - 14.0 * c / b) / (a * b)
    t = (2.0 ** (14.0 * -c / b + 6.0) - 64.0) / a
    return np.where(x >= 0.0, (2.0 ** (14.0 * (x - c) / b + 6.0) - 64.0) / a, x * s + t)


def _clog3(x: np.ndarray) -> np.ndarray:
    dark = -(10.0 ** ((0.12783901 - x) / 0.36726845) - 1.0) / 14.98325
    bright = (10.0 ** ((x - 0.12240537) / 0.36726845) - 1.0) / 14.98325
    middle = (x - 0.12512219) / 1.9754798
    return 0.9 * np.where(x < 0.097465473, dark, np.where(x <= 0.15277891, middle, bright))


def _flog(x: np.ndarray) -> np.ndarray:
    a, b, c, d, e, f = 0.555556, 0.009468, 0.344676, 0.790453, 8.735631, 0.092864
    return np.where(x >= 0.100537775223865, (10.0 ** ((x - d) / c) - b) / a, (x - f) / e)


def _hlg(x: np.ndarray) -> np.ndarray:
    a, b, c = 0.17883277, 0.28466892, 0.55991073
    scene = np.where(x <= 0.5, x**2 / 3.0, (np.exp((x - c) / a) + b) / 12.0)
    return scene / ((np.exp((0.75 - c) / a) + b) / 12.0)  # the reference white has three quarters of the signal


def _pq(x: np.ndarray) -> np.ndarray:
    m1, m2 = 2610.0 / 16384.0, 2523.0 / 32.0
    c1, c2, c3 = 3424.0 / 4096.0, 2413.0 / 128.0, 2392.0 / 128.0
    root = np.clip(x, 0.0, 1.0) ** (1.0 / m2)
    return _PEAK_CD_M2 / _WHITE_CD_M2 * (np.maximum(root - c1, 0.0) / (c2 - c3 * root)) ** (1.0 / m1)


CURVES: dict[CurveName, TransferCurve] = {
    "slog3": TransferCurve("Sony S-Log3", _slog3),
    "vlog": TransferCurve("Panasonic V-Log", _vlog),
    "logc3": TransferCurve("ARRI LogC3 (EI 800)", _logc3),
    "logc4": TransferCurve("ARRI LogC4", _logc4),
    "clog3": TransferCurve("Canon Log 3", _clog3),
    "flog": TransferCurve("Fujifilm F-Log", _flog),
    "hlg": TransferCurve("HLG", _hlg, is_of_codes=False),
    "pq": TransferCurve("PQ", _pq, is_of_codes=False),
    "linear": TransferCurve("linear light", lambda x: x, is_of_codes=False),
}
"""By the name that capture.json has for it."""
STATED: dict[int, CurveName] = {16: "pq", 18: "hlg", 8: "linear"}
"""Curves that a video states, by ITU-T H.273's number of its transfer characteristics. No log curve has one."""


@cache
def display_levels(curve: CurveName, *, is_stretched: bool) -> np.ndarray:
    """Display-encoded level of each of 65,536 levels. [65536] uint8, read-only

    Args:
        is_stretched: Whether values are those of video whose levels 64 to 940 were stretched to all of the range.
    """
    known = CURVES[curve]
    x = np.arange(MAX_LEVEL + 1, dtype=np.float64) / MAX_LEVEL
    if known.is_of_codes and is_stretched:
        x = (x * _RANGE + _BLACK) / _CODES
    levels = np.round(255.0 * encoded_of(np.clip(known.linear(x), 0.0, 1.0))).astype(np.uint8)
    levels.setflags(write=False)
    return levels
