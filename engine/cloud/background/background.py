"""The picture of each camera when nothing moves: the tightest cluster of colours over time, per pixel.

Not a model over space (engine.cloud.background.recheck compares with the other views) and not a mask.
A person who stands still for half of the frames makes a second cluster; skin and cloth still sway, so among clusters
the one with the least variance relative to the camera's noise at that brightness wins, and the pixel is marked
unstable wherever a sizeable share of the frames disagrees with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from engine.images.image_filters import dilate, erode, remove_small_blobs
from engine.parallel import map_ordered, row_spans

CLUSTER_SHARE = 0.3
"""Share of the frames that must agree; the mode of the shortest window with this share."""
STABLE_SHARE = 0.5
"""A pixel is stable when at least this share of frames lies within the noise of its background: a clear majority. In
short captures a larger share would also give up places that people merely cross often."""
TIE_SCORE = 4.0
"""Clusters whose variance is below this many noise variances are equally still. Among those the earliest wins: what
appears later and stays can be added to a clip, but what the reference clip's background shows cannot be taken away."""
N_BRIGHTNESS_BINS = 16
MIN_REACH = 48.0
"""Squared distance of colours, summed over RGB, within which frames always agree: 4 grey levels per channel, which
compression alone can cause."""


@dataclass(frozen=True, slots=True)
class Background:
    """One camera's empty scene.

    Attributes:
        image: [H, W, 3] uint8
        is_stable: True where the frames agree on one tight colour. [H, W] bool
    """

    image: np.ndarray
    is_stable: np.ndarray


def estimate_background(frames: np.ndarray, is_valid: np.ndarray | None = None) -> Background:
    """The densest colour over time per pixel.

    Args:
        frames: Frames of one motionless camera, spread over as much of the capture as possible. [T, H, W, 3] uint8
        is_valid: Pixels that the camera sees, None for all: the others are never stable. [H, W] bool
    Returns:
        Background. With fewer than 3 frames there is no majority: their mean, stable where they agree.

    Two passes: the first finds the least variance window and from it the camera's noise per brightness; the second
    compares windows by variance / noise variance, so that dark cloth, which is quiet, does not win over a bright wall.
    """
    n_frames, height = frames.shape[:2]
    if n_frames < 3:
        mean = frames.astype(np.float32).mean(0)
        is_agreed = (((frames - mean) ** 2).sum(-1) <= MIN_REACH).all(0)
        return Background((mean + 0.5).astype(np.uint8), _among(is_valid, _without_specks(is_agreed)))
    frames = np.ascontiguousarray(frames)
    window = max(3, int(np.ceil(CLUSTER_SHARE * n_frames)))
    flat = np.ones(N_BRIGHTNESS_BINS, dtype=np.float32)
    # every 16th pixel is plenty for a median noise per brightness; strided like rows below, so compiled once for both
    sampled = frames[:, ::4, ::4]
    colors, variances, _ = _clusters(sampled, window, flat, 0.0)
    if is_valid is not None and is_valid[::4, ::4].any():  # black where it sees nothing, and without any noise
        colors, variances = colors[is_valid[::4, ::4]], variances[is_valid[::4, ::4]]
    noise = _noise_by_brightness(colors, variances)

    def rows(span: tuple[int, int]):
        return _clusters(frames[:, span[0] : span[1]], window, noise, TIE_SCORE)

    parts = map_ordered(rows, row_spans(height))
    colors = np.concatenate([part[0] for part in parts])
    shares = np.concatenate([part[2] for part in parts])
    return Background((colors + 0.5).astype(np.uint8), _among(is_valid, _without_specks(shares >= STABLE_SHARE)))


def _among(is_valid: np.ndarray | None, mask: np.ndarray) -> np.ndarray:
    return mask if is_valid is None else mask & is_valid


def _without_specks(is_stable: np.ndarray) -> np.ndarray:
    """Single noisy pixels are stable after all; holes inside a person are not. Sizes follow the image width."""
    scale = is_stable.shape[1] / 640.0
    is_unstable = remove_small_blobs(~is_stable, max(4, round(60 * scale * scale)))
    close_px = max(1, round(5 * scale))
    return ~erode(dilate(is_unstable, close_px + 1), close_px)


def _noise_by_brightness(colors: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """Median in-cluster variance (sum over RGB) per brightness bin; empty bins take the median over all. [bins]"""
    bins = np.minimum(colors.sum(-1) / (765.0 / N_BRIGHTNESS_BINS), N_BRIGHTNESS_BINS - 1).astype(int)
    overall = max(float(np.median(variances)), 0.25)
    noise = np.full(N_BRIGHTNESS_BINS, overall)
    for i in range(N_BRIGHTNESS_BINS):
        members = variances[bins == i]
        if len(members) >= 50:
            noise[i] = np.median(members)
    # a quarter grey level squared is rounding noise: below it a cluster is not "tighter", it is only quantised
    return np.maximum(noise, 0.25).astype(np.float32)


def _clusters(
    frames: np.ndarray, window: int, noise: np.ndarray, tie_score: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Best window per pixel: mean colour [H, W, 3] f32, variance summed over RGB [H, W], share of agreeing frames."""
    n_frames, height, width, _ = frames.shape
    colors = np.empty((height, width, 3), np.float32)
    variances, shares = np.empty((2, height, width), np.float32)
    order, keys = np.empty((2, n_frames), np.int64)
    sums = np.zeros((n_frames + 1, 4), np.int64)
    _cluster_rows(frames, window, noise, tie_score, order, keys, sums, colors, variances, shares)
    return colors, variances, shares


@njit(cache=True, nogil=True, error_model="numpy")
def _cluster_rows(frames, window, noise, tie_score, order, keys, sums, colors, variances, shares):
    """Writes the results of `_clusters`. sums [T + 1, 4]: of R, G, B and squares before each, in brightness order."""
    n_frames, height, width, _ = frames.shape
    n_bins = len(noise)
    for y in range(height):
        for x in range(width):
            for t in range(n_frames):
                key = np.int64(frames[t, y, x, 0]) + np.int64(frames[t, y, x, 1]) + np.int64(frames[t, y, x, 2])
                j = t
                while j > 0 and keys[j - 1] > key:
                    keys[j] = keys[j - 1]
                    order[j] = order[j - 1]
                    j -= 1
                keys[j] = key
                order[j] = t
            for i in range(n_frames):
                squares = np.int64(0)
                for c in range(3):
                    value = np.int64(frames[order[i], y, x, c])
                    sums[i + 1, c] = sums[i, c] + value
                    squares += value * value
                sums[i + 1, 3] = sums[i, 3] + squares
            best_score = np.inf
            best_time = np.inf
            best_start = 0
            best_variance = 0.0
            for start in range(n_frames - window + 1):
                stop = start + window
                mean_square = 0.0
                brightness = 0.0
                for c in range(3):
                    mean = (sums[stop, c] - sums[start, c]) / window
                    mean_square += mean * mean
                    brightness += mean
                variance = max((sums[stop, 3] - sums[start, 3]) / window - mean_square, 0.0)
                score = variance / noise[min(int(brightness * n_bins / 765.0), n_bins - 1)]
                times = 0.0
                if score < tie_score:
                    score = tie_score
                    for i in range(start, stop):
                        times += order[i]
                if score < best_score or (score == best_score and times < best_time):
                    best_score = score
                    best_time = times
                    best_start = start
                    best_variance = variance
            mean_r = (sums[best_start + window, 0] - sums[best_start, 0]) / window
            mean_g = (sums[best_start + window, 1] - sums[best_start, 1]) / window
            mean_b = (sums[best_start + window, 2] - sums[best_start, 2]) / window
            level = noise[min(int((mean_r + mean_g + mean_b) * n_bins / 765.0), n_bins - 1)]
            # a frame agrees within four standard deviations (window variances are short of the full noise: x 2)
            reach = max(32.0 * level, MIN_REACH)
            n_agree = 0
            total_r = 0.0
            total_g = 0.0
            total_b = 0.0
            for t in range(n_frames):
                r, g, b = float(frames[t, y, x, 0]), float(frames[t, y, x, 1]), float(frames[t, y, x, 2])
                if (r - mean_r) ** 2 + (g - mean_g) ** 2 + (b - mean_b) ** 2 <= reach:
                    n_agree += 1
                    total_r += r
                    total_g += g
                    total_b += b
            if n_agree >= window:  # average everything that agrees: less noise than the window alone
                mean_r, mean_g, mean_b = total_r / n_agree, total_g / n_agree, total_b / n_agree
            colors[y, x, 0] = mean_r
            colors[y, x, 1] = mean_g
            colors[y, x, 2] = mean_b
            variances[y, x] = best_variance
            shares[y, x] = n_agree / n_frames
