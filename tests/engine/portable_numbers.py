"""Digests of numbers from every library on the way of a training, and with --training of a tiny one, stage by stage.

    python -m tests.engine.portable_numbers [--training [FOLDER]]

FOLDER keeps what is prepared: whoever runs next with it, perhaps emulated and a hundred times slower, only takes the
steps. Where two processors print the same lines, they train the same. Run it with the variables of
engine.portable.portable_environment, on other machines or under `qemu-x86_64 -cpu EPYC`. PYTHON_BELOW names what
starts children in place of the interpreter, so that these are emulated too.
"""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import torch


def digest(*arrays: np.ndarray) -> str:
    """Of the bits of arrays."""
    found = hashlib.blake2b(digest_size=8)
    for array in arrays:
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def of_libraries() -> Iterator[tuple[str, str]]:
    """Names and digests of what libraries compute of the same random numbers."""
    import cv2
    import scipy.linalg
    import torch

    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    x = rng.standard_normal((300, 300))
    f = x.astype(np.float32)
    t = torch.from_numpy(f)
    yield "numpy products", digest(x @ x, f @ f, np.einsum("ij,kj->ik", f, f))
    yield (
        "numpy functions",
        digest(np.exp(f), np.log(np.abs(f)), np.sin(x), np.abs(x) ** 0.3, np.sqrt(np.abs(f)), 1 / f),
    )
    yield "numpy sums", digest(f.sum(), x.sum(0), f.mean(1), np.cumsum(f))
    yield "numpy algebra", digest(np.linalg.solve(x, x[:, 0]), *np.linalg.svd(x[:50, :50]), *np.linalg.eigh(x[:9, :9]))
    yield "scipy algebra", digest(scipy.linalg.lstsq(x[:, :40], x[:, 0])[0])  # pyright: ignore
    yield "torch products", digest((t @ t).numpy(), (t[:, :3] @ t[:3]).numpy(), (t.double() @ t.double()).numpy())
    functions = (torch.exp, torch.sigmoid, torch.sin, torch.tanh, torch.nn.functional.softplus)
    yield "torch functions", digest(*(call(t).numpy() for call in functions), torch.rsqrt(t.abs()).numpy())
    yield "torch sums", digest(t.sum().numpy(), t.sum(0).numpy(), t.norm(dim=1).numpy(), t.softmax(1).numpy())
    yield "torch algebra", digest(torch.linalg.svdvals(t[:40, :40]).numpy(), torch.linalg.solve(t, t[:, :1]).numpy())
    yield "torch convolution", digest(torch.nn.functional.conv2d(t[None, None], t[None, None, :5, :5]).numpy())
    yield "torch random", digest(torch.randn(1000, generator=torch.Generator().manual_seed(0)).numpy())
    noise = (rng.random((160, 200)) * 255).astype(np.uint8)
    picture = cv2.GaussianBlur(noise, (9, 9), 2)
    yield "opencv pictures", digest(picture, cv2.resize(noise, (101, 77), interpolation=cv2.INTER_AREA))
    flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)  # pyright: ignore
    yield "opencv flow", digest(flow.calc(picture, np.roll(picture, 2, 1), None))
    from engine.assets import asset_path
    from engine.capture.capture import open_capture

    capture = open_capture(asset_path("sample"), scale=0.75)
    yield "decoded pictures", digest(*(capture.frame(camera, frame) for camera in (0, 7) for frame in (0, 4)))


def of_kernels() -> Iterator[tuple[str, str]]:
    """Names and digests of what our kernels compute of random scenes, gradients too."""
    import torch

    from app.lab.synthetic.gaussian_scenes import layered_scene
    from engine.backends.table import backend_called
    from engine.cloud.background.background import estimate_background
    from engine.cloud.background.exposure import Exposure
    from engine.cloud.stereo.depth.slanted import refine_slanted
    from engine.cloud.stereo.depth.smoothing import smooth_inverse_depth
    from engine.cloud.stereo.depth.sweep import matching_costs
    from engine.cloud.warm import _two_cameras
    from engine.kernels.threads import configure_threads
    from engine.raster import Gaussians, rasterize
    from tests.decode_scenes import PRESET, Scene, backward

    configure_threads()
    cpu, generator = backend_called("cpu"), torch.Generator().manual_seed(0)
    scene = layered_scene(600, 170, 140, 3.0)
    gaussians = Gaussians(*(tensor.float().requires_grad_() for tensor in scene.gaussians.tensors()))
    image = rasterize(gaussians, *scene.arguments, backend=cpu).image
    image.backward(torch.randn(image.shape, generator=generator))
    yield "rasterizer", _digest_of(image, *(tensor.grad for tensor in gaussians.tensors()))
    anchors = Scene(**PRESET)
    decoded = anchors.decode(anchors.rows(), [(1, 0.3), (2, 0.7)], "cpu")
    backward(decoded)
    yield "decoder", _digest_of(*decoded.tensors(), *(parameter.grad for parameter in anchors.parameters().values()))
    truth = torch.randint(0, 255, image.shape[1:], generator=generator, dtype=torch.uint8)
    seen, gain = image[0].detach().clone().requires_grad_(), torch.full((3,), 1.1, requires_grad=True)
    found = cpu.photometric_loss(seen, truth, ssim_weight=0.2, gain=gain, is_counted=None, tile_mask=None, rest=None)
    found.loss.backward()
    yield "loss", _digest_of(found.loss, seen.grad, gain.grad)
    assert seen.grad is not None
    values = {"image": seen.detach().clone()}
    adam = cpu.adam(values)
    for n in range(1, 4):
        adam.step({"image": seen.grad * n}, {"image": 1e-3}, max_norm=0.5, is_sound=torch.tensor(True))
    yield "optimizer", _digest_of(values["image"])
    rng, rig = np.random.default_rng(0), _two_cameras()
    frames = rng.integers(0, 255, (3, 16, 16, 3)).astype(np.uint8)
    yield "background", digest(estimate_background(Exposure.of_frames(frames).applied_to(frames)).image)
    greys, planes = frames[:2].mean(-1).astype(np.float32), np.linspace(0.2, 1.0, 64, dtype=np.float32)
    usable, prior = np.ones(greys.shape, bool), np.full(greys[0].shape, 0.5)
    costs = matching_costs(greys, usable, rig, camera=0, sources=[1], inverse_depths=planes)
    yield "depth sweep", digest(costs)
    yield "smoothing", digest(smooth_inverse_depth(costs, greys[0], planes))
    slanted = refine_slanted(greys, usable, rig, camera=0, sources=[1], seeds=prior[None], prior=prior, low=0.2, high=1)
    yield "slanted patches", digest(*slanted)


def _digest_of(*tensors: torch.Tensor | None) -> str:
    """Of those that are there: not every parameter has a gradient."""
    return digest(*(tensor.detach().numpy() for tensor in tensors if tensor is not None))


def of_training(folder: str | None = None) -> Iterator[tuple[str, str]]:
    """Names and digests of the arrays of a tiny reference clip and a source clip: prepared, and after steps."""
    from engine.assets import asset_path
    from engine.capture.capture import open_capture
    from engine.capture.clip import split_clips
    from engine.kernels.threads import configure_threads
    from engine.training.preparation import stages
    from tests.engine.training.tiny_training import CLIP_LENGTH, N_CAMERAS, make_training

    configure_threads()
    capture = open_capture(asset_path("sample"), scale=0.25)
    others = [camera for camera in range(len(capture.rig)) if camera % 5 in (1, 3, 4)]
    holdout = others[: len(capture.rig) - N_CAMERAS]
    reference = None
    stages.WRITE_AFTER_S = 0.0
    with nullcontext(folder) if folder else tempfile.TemporaryDirectory() as folder:
        for clip in split_clips(capture.n_frames, CLIP_LENGTH)[:2]:
            training = make_training(capture, holdout, clip=clip, reference=reference, prep_dir=Path(folder) / "prep")
            training.prepare()
            n_steps, name = 0, f"clip {clip.clip_index}"
            yield f"{name} prepared", digest(*_arrays(training))
            while not training.is_finished:
                training.step()
                n_steps += 1
                if n_steps in (1, 5):
                    yield f"{name} step {n_steps}", digest(*_arrays(training))
            yield f"{name} step {n_steps}, the last", digest(*_arrays(training))
            reference = training.state()
            training.finish()


def _arrays(training) -> list[np.ndarray]:
    return [array for _, array in sorted(training.state().arrays.items())]


def main() -> None:
    """Print name and digest, a line each."""
    from engine.kernels.cache import use_kernel_cache

    use_kernel_cache()
    sys.executable = os.environ.get("PYTHON_BELOW", sys.executable)
    is_training, *folder = sys.argv[1:] or [""]
    for part in [of_libraries(), of_kernels(), *([of_training(*folder)] if is_training == "--training" else [])]:
        for name, found in part:
            sys.stdout.write(f"{name:30} {found}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
