"""What the figures of one picture cost, and how far they are from independent implementations.

    python -m tests.benchmarks.bench_metrics
    python -m tests.benchmarks.bench_metrics --sizes 640x360,320x240 --runs 15 --threads 1

CPU milliseconds of this process, medians, ours and the slow truth in turn. The truth of FLIP is the authors' package,
of PSNR scikit-image, of SSIM our loss in float64, of MS-SSIM torchmetrics. Pictures: a frame of the sample, and the
same blurred and noisy.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import flip_evaluator
import numpy as np
import torch
from PIL import Image
from scipy import ndimage
from skimage.metrics import peak_signal_noise_ratio
from torchmetrics.functional.image import multiscale_structural_similarity_index_measure

from app.background.kernels import use_threads
from engine.assets import asset_path
from engine.backends.reference.loss import ssim_map
from engine.capture.capture import open_capture
from engine.images.psnr import psnr
from engine.metrics.pictures.flip import flip_map
from engine.metrics.pictures.picture import CHOICES, measure_picture
from engine.metrics.pictures.similarity import dssim_ms, ssim


class Compared(NamedTuple):
    """One figure, ours and the slow truth. Each gives what is compared: a number, or a map of them."""

    name: str
    ours: Callable[[], object]
    truth: Callable[[], object]


def pictures(width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Disturbed and true picture, [H, W, 3] float32 in 0..1."""
    frame = Image.fromarray(open_capture(asset_path("sample")).frame(0, 0))
    truth = np.asarray(frame.resize((width, height)), np.float32) / np.float32(255)
    noise = np.random.default_rng(0).normal(0, 0.02, truth.shape)
    image = np.clip(ndimage.gaussian_filter(truth, (1.5, 1.5, 0)) + noise, 0, 1)
    return image.astype(np.float32), truth


def figures(image: np.ndarray, truth: np.ndarray) -> list[Compared]:
    """All figures with an independent implementation."""
    a, b = (torch.from_numpy(picture).double() for picture in (image, truth))
    batch_a, batch_b = (picture.permute(2, 0, 1)[None] for picture in (a, b))

    def authors_flip() -> np.ndarray:
        return flip_evaluator.evaluate(truth, image, "LDR", applyMagma=False, computeMeanError=False)[0][..., 0]

    def ms_of_torchmetrics() -> float:
        return (1 - float(multiscale_structural_similarity_index_measure(batch_a, batch_b, data_range=1.0))) / 2  # type: ignore[arg-type]

    return [
        Compared("PSNR", lambda: psnr(image, truth), lambda: peak_signal_noise_ratio(truth, image, data_range=1.0)),
        Compared("SSIM", lambda: ssim(image, truth), lambda: float(ssim_map(a, b).mean())),
        Compared("MS-SSIM", lambda: dssim_ms(image, truth), ms_of_torchmetrics),
        Compared("FLIP", lambda: flip_map(image, truth), authors_flip),
        Compared("FLIP, mean", lambda: flip_map(image, truth).mean(dtype=np.float64), lambda: authors_flip().mean()),
    ]


def cpu_ms(work: Callable[[], object]) -> float:
    """Processor time of all threads of this process."""
    started_s = time.process_time()
    work()
    return 1e3 * (time.process_time() - started_s)


def main() -> None:
    """Print a table per size."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", default="640x360,320x240")
    parser.add_argument("--runs", type=int, default=9, help="runs that count")
    parser.add_argument("--threads", type=int, default=1, help="as many as an evaluation gives each camera by default")
    options = parser.parse_args()
    use_threads(options.threads)
    for size in options.sizes.split(","):
        width, height = (int(part) for part in size.split("x"))
        image, truth = pictures(width, height)
        levels, is_moving = (truth * 255).round().astype(np.uint8), truth[..., 0] > 0.6
        print(f"{size}, {options.threads} threads, medians of {options.runs}")
        print(f"{'figure':22} {'ours, ms':>10} {'truth, ms':>10} {'difference':>11}")
        for name, ours, slow in figures(image, truth):
            error = float(np.abs(np.asarray(ours()) - np.asarray(slow())).max())
            times = [(cpu_ms(ours), cpu_ms(slow)) for _ in range(options.runs)]
            fast_ms, slow_ms = (statistics.median(column) for column in zip(*times, strict=True))
            print(f"{name:22} {fast_ms:10.1f} {slow_ms:10.1f} {error:11.1e}")
        for choice in CHOICES:
            measure = partial(measure_picture, image, levels, is_moving, metrics=choice)
            measure()
            median_ms = statistics.median(cpu_ms(measure) for _ in range(options.runs))
            print(f"measure_picture, {choice:5} {median_ms:10.1f}")


if __name__ == "__main__":
    main()
