"""No kernel reads or writes outside its arrays: every array lies between pages that may not be touched.

Inputs, outputs, scratch memory and the packed arguments themselves; once right in front of a forbidden page, once right
behind one. The kernels that build clouds are plain numba, and run with numba's own bounds checking.
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
from collections.abc import Callable, Iterator
from importlib import import_module

import numpy as np
import pytest

from tests.guarded_memory import SEGMENTATION_FAULT, GuardedMemory, needs_page_rights, run_child

pytestmark = pytest.mark.slow

Say = Callable[[str], None]
MODULES = (
    "engine.kernels.jobs",
    "engine.backends.cpu.decode.decode",
    "engine.backends.cpu.decode.layout",
    "engine.backends.cpu.decode.joining",
    "engine.backends.cpu.raster.rasterize",
    "engine.backends.cpu.raster.binning",
    "engine.backends.cpu.raster.camera_row",
    "engine.backends.cpu.raster.tile_boxes",
    "engine.backends.cpu.step.adam",
    "engine.backends.cpu.step.fused_loss",
    "engine.backends.cpu.step.photometric",
    "engine.backends.cpu.step.tile_squares",
)
"""Modules that make arrays for kernels."""
FUNCTIONS = ("camera_row", "mask_sums", "_bands")
"""Functions in them whose results come from methods of arrays."""


def rasterize_cases(memory: GuardedMemory) -> Iterator[str]:
    """Forward and backward, masks, frozen rows, depth, and without gradients."""
    import torch

    from app.lab.synthetic.gaussian_scenes import layered_scene
    from engine.backends.cpu.raster.rasterize import POOL
    from engine.backends.table import backend_called
    from engine.raster import Gaussians, rasterize, tile_boxes

    sizes = ((0, 40, 33), (1, 1, 1), (15, 31, 65), (16, 64, 32), (17, 33, 5), (161, 70, 50))
    background = memory.tensor(torch.ones(3))
    for n_rows, width, height in sizes:
        for size_px in (0.5, 30.0):
            scene = layered_scene(n_rows, width, height, size_px)
            rows, columns = -(-height // 32), -(-width // 32)
            some = memory.tensor(torch.arange(rows * columns).view(rows, columns) % 2 == 0)
            for mask, share in ((None, 0), (None, 2), (some, 2))[0 if size_px > 1 else 2 :]:
                masked = "all" if mask is None else "some"
                yield f"rasterize {n_rows} of {size_px} px in {width} x {height}, {share} of 3 frozen, {masked} tiles"
                POOL.clear()
                leaves = Gaussians(
                    *(memory.tensor(tensor.float()).requires_grad_() for tensor in scene.gaussians.tensors()),
                    is_frozen=memory.tensor(torch.arange(n_rows) % 3 < share),
                )
                options = {"tile_mask": mask, "want_depth": True, "background": background}
                rendering = rasterize(
                    leaves, *scene.arguments, **options, want_means2d=True, backend=backend_called("cpu")
                )
                assert rendering.depth is not None
                gradients = [memory.tensor(torch.ones_like(t)) for t in (rendering.image, rendering.alpha)]
                torch.autograd.backward([rendering.image, rendering.alpha], gradients, retain_graph=True)
                rendering.depth.sum().backward()
                with torch.no_grad():
                    rasterize(leaves, *scene.arguments, **options, backend=backend_called("cpu"))
            yield f"tile_boxes {n_rows} of {size_px} px in {width} x {height}"
            viewmats, Ks, *_ = scene.arguments
            floats = Gaussians(*(memory.tensor(tensor.float()) for tensor in scene.gaussians.tensors()))
            boxes = tile_boxes(floats, viewmats[0], Ks[0], width, height, backend=backend_called("cpu"))
            boxes.mask()
            boxes.meeting(some, memory.tensor(torch.arange(n_rows)))


def decode_cases(memory: GuardedMemory) -> Iterator[str]:
    """Forward and backward of three sets with a field, one set decoded before, one knot and two."""
    import torch

    from engine.backends.table import backend_called
    from engine.model.decoding import ChosenAnchors, decode_anchors
    from engine.raster import Gaussians
    from tests.decode_scenes import ODD, PRESET, SINGLE, Scene

    def decode(sizes: dict, n: int, knots: list[tuple[int, float]], **options) -> None:
        scene = Scene(**sizes, n=n, **options)
        for module in scene.modules():
            for tensor in (*module.parameters(), *module.buffers()):
                tensor.data = memory.tensor(tensor)
        rows = scene.rows()
        k = scene.decoder.gaussians_per_anchor
        n_static = len(scene.sets["static"])
        decoded = [memory.tensor(torch.rand(n_static * k, *width)) for width in ((3,), (4,), (3,), (), (3,))]
        for is_decoded in (False, True):
            chosen = []
            for role, anchors in scene.sets.items():
                corners = scene.field.corners(anchors.positions) if anchors.is_dynamic else None
                if corners is not None:
                    indices, weights = memory.tensor(corners.indices), memory.tensor(corners.weights)
                    corners = dataclasses.replace(corners, indices=indices, weights=weights)
                before = Gaussians(*decoded) if is_decoded and role == "static" else None
                chosen.append(ChosenAnchors(anchors, memory.tensor(rows[role]), corners, before))
            gaussians = decode_anchors(chosen, scene.decoder, scene.field, knots, backend=backend_called("cpu"))
            learning = [tensor for tensor in gaussians.tensors() if tensor.requires_grad]
            if learning:
                torch.autograd.backward(learning, [memory.tensor(torch.randn(t.shape)) for t in learning])
            with torch.no_grad():
                decode_anchors(chosen, scene.decoder, scene.field, knots, backend=backend_called("cpu"))

    for n in (0, 1, 17, 200):
        yield f"decode_anchors of {n}"
        decode(ODD, n, [(1, 0.3), (2, 0.7)])
    for name, sizes in {"preset": PRESET, "single": SINGLE}.items():
        yield f"decode_anchors, {name}"
        decode(sizes, 70, [(2, 1.0)])
    for channels, is_shared in ((1, False), (5, True)):
        yield f"decode_anchors with {channels} channels, one table {is_shared}"
        decode(ODD, 70, [(1, 0.3), (2, 0.7)], channels=channels, is_shared=is_shared)


def join_cases(memory: GuardedMemory) -> Iterator[str]:
    """Chosen rows of frozen Gaussians in front of learning ones."""
    import torch

    from engine.backends.table import backend_called
    from engine.model.joining import join_frozen
    from engine.raster import Gaussians

    def some(n: int) -> Gaussians:
        return Gaussians(*(memory.tensor(torch.rand(n, *width)) for width in ((3,), (4,), (3,), (), (3,))))

    for n_frozen, n_learning in ((1, 0), (1, 1), (70, 33), (1030, 5)):
        for step in (1, 3):
            yield f"join_frozen {n_frozen} and {n_learning}, one of {step}"
            learning = Gaussians(*(tensor.requires_grad_() for tensor in some(n_learning).tensors()))
            rows = memory.tensor(torch.arange(0, n_frozen, step).flip(0))
            joined = join_frozen(some(n_frozen), rows, learning, backend=backend_called("cpu"))
            torch.stack([tensor.sum() for tensor in joined.tensors()]).sum().backward()


def loss_cases(memory: GuardedMemory) -> Iterator[str]:
    """Value and gradients with every argument in every combination; squares of tiles."""
    import torch

    from engine.backends.cpu.step import fused_loss
    from engine.backends.table import backend_called
    from engine.raster.pinhole_view import n_tiles
    from engine.training.step.losses import photometric_loss

    # without its slack for alignment, which would hide a stray access: the rows are whole cache lines
    fused_loss._aligned_zeros = lambda shape: memory.bytes(4 * int(np.prod(shape))).view(np.float32).reshape(shape)
    random, cpu = np.random.default_rng(0), backend_called("cpu")
    for height, width in ((1, 1), (40, 1), (3, 5), (50, 65), (26, 700)):
        for bits in range(16):
            has_gain, has_counted, has_tiles, is_float = (bool(bits >> i & 1) for i in range(4))
            yield f"photometric_loss of {width} x {height}: {has_gain=}, {has_counted=}, {has_tiles=}, {is_float=}"
            truth = random.integers(0, 256, (height, width, 3), dtype=np.uint8)
            image = memory.tensor(torch.from_numpy(random.random((height, width, 3), np.float32))).requires_grad_()
            tiles = random.random(n_tiles(width, height)) < 0.5
            rest = memory.tensor(torch.from_numpy(random.random((height, width, 3), np.float32)))
            gain = memory.tensor(torch.ones(3)).requires_grad_()
            result = photometric_loss(
                image,
                memory.tensor(torch.from_numpy(truth / np.float32(255) if is_float else truth)),
                backend=cpu,
                ssim_weight=0.2,
                gain=gain if has_gain else None,
                is_counted=memory.tensor(torch.from_numpy(random.random((height, width)) < 0.7))
                if has_counted
                else None,
                tile_mask=memory.tensor(torch.from_numpy(tiles)) if has_tiles else None,
                rest=rest if has_tiles and has_gain else None,
            )
            result.loss.backward()
            cpu.tile_squares(image.detach(), memory.tensor(torch.from_numpy(truth)), gain.detach())


def adam_cases(memory: GuardedMemory) -> Iterator[str]:
    """Sizes around the edges of blocks and chunks."""
    import torch

    from engine.backends.table import backend_called

    sizes = (1, 63, 64, 65, (1 << 14) - 1, (1 << 14) + 1, 40_000)
    yield f"Adam of {sizes}"
    parameters = {str(n): memory.tensor(torch.rand(n)) for n in sizes}
    adam = backend_called("cpu").adam(parameters)
    for kept in (parameters, dict.fromkeys(("1", "65"))):
        gradients = {name: memory.tensor(torch.rand(int(name))) for name in kept}
        rates = dict.fromkeys(parameters, 0.1)
        adam.step(gradients, rates, max_norm=0.5, is_sound=torch.tensor(True))
    for name, arrays in adam.state().items():
        adam.restore(name, arrays)


def _run_beside_forbidden_pages(say: Say) -> None:
    from engine.backends.cpu.decode import decode as backend
    from engine.backends.table import backend_called

    backend_called("cpu").warm_up(is_training=True)
    for is_behind in (True, False):
        memory = GuardedMemory(is_behind=is_behind)
        memory.take_over([import_module(name) for name in MODULES], FUNCTIONS)
        backend._ORDINALS = memory.array(backend._ORDINALS)
        for cases in (rasterize_cases, decode_cases, join_cases, loss_cases, adam_cases):
            for case in cases(memory):
                say(f"{case}; pages {'behind' if is_behind else 'in front'}")


def _build_clouds(say: Say) -> None:
    from engine.kernels.cache import use_kernel_cache

    use_kernel_cache()  # that of kernels that look at bounds: before any of them is imported
    from engine.camera.projection import projection_matrices
    from engine.camera.rig import CameraRig
    from engine.cloud.background.background import estimate_background
    from engine.cloud.background.masks import motion_mask
    from engine.cloud.motion.hull import Grid, _integrate, carve, hull_colors, hull_visibility
    from engine.cloud.stereo.depth.consistency import check_depths
    from engine.cloud.stereo.depth.smoothing import smooth_inverse_depth
    from engine.cloud.stereo.depth.sweep import matching_costs
    from engine.images.image_filters import dilate

    with pytest.raises(IndexError):  # or nothing is checked
        _integrate(np.ones((2, 3), bool), np.zeros((3, 3), np.int32))  # one column too few
    random = np.random.default_rng(0)
    poses = np.stack([np.eye(4)] * 2)
    poses[1, :3, 3] = -0.1, 0.05, 0.2
    for height, width in ((1, 1), (2, 9), (11, 7), (40, 31)):
        say(f"pictures of {width} x {height}")
        frames = random.integers(0, 255, (3, height, width, 3)).astype(np.uint8)
        background = estimate_background(frames)
        motion_mask(frames[0], background.image)
        for radius in (1, 3):
            dilate(~background.is_stable, radius)
        K = np.array([[width, 0.0, 0.4 * width], [0.0, width, 0.6 * height], [0.0, 0.0, 1.0]])
        sizes = np.tile(np.array([width, height], dtype=np.int64), (2, 1))
        rig = CameraRig(("left", "right"), poses, np.stack([K, K]), sizes)
        planes = np.linspace(0.05, 9.0, 5, dtype=np.float32)
        greys = frames[:2].mean(-1).astype(np.float32)
        is_usable = random.random(greys.shape) < 0.9
        costs = matching_costs(greys, is_usable, rig, camera=0, sources=[1], inverse_depths=planes)
        smooth_inverse_depth(costs, greys[0], planes)
        check_depths(random.uniform(0.01, 3.0, greys.shape), rig, camera=0, others=[1], tolerance=0.1)
        projections = projection_matrices(rig)
        grid = Grid.over(np.full(3, -1.0), np.full(3, 1.5), 0.15)  # around the cameras, in front of them and behind
        voxels = carve(is_usable, projections, grid, near=0.01, n_misses=1, min_hits=0)
        pixel, is_visible = hull_visibility(grid.centers(voxels), grid.size, is_usable, projections, near=0.01)
        hull_colors(frames[:2], pixel, is_visible, np.ones((2, 3)))


def _touch_the_next_byte(_say: Say, *, is_behind: bool) -> None:
    address = GuardedMemory(is_behind=is_behind).bytes(100).ctypes.data
    ctypes.c_char.from_address(address + (100 if is_behind else -1)).value = b"x"


@needs_page_rights
@pytest.mark.parametrize("is_behind", [True, False], ids=["behind", "in front"])
def test_the_guard_bites(is_behind):
    code, _ = run_child(functools.partial(_touch_the_next_byte, is_behind=is_behind))
    assert code == SEGMENTATION_FAULT


@needs_page_rights
def test_no_kernel_leaves_its_arrays():
    code, case = run_child(_run_beside_forbidden_pages)
    assert code == 0, f"{SEGMENTATION_FAULT} is an access outside an array; the last case was: {case}"


def test_kernels_of_clouds_stay_inside_their_arrays(monkeypatch):
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")  # their machine code lies in a cache folder of its own
    code, case = run_child(_build_clouds)
    assert code == 0, f"the traceback says where; the last case was: {case}"
