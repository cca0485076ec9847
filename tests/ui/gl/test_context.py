"""Which machine draws, and that nothing beyond OpenGL 3.3 is used."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import moderngl
import pytest

from ui.gl.context import (
    REQUIRED_VERSION,
    ContextError,
    is_software,
    is_software_name,
    make_headless_context,
    renderer_name,
)

ROOT = Path(__file__).resolve().parents[3]

DRAW_EVERYTHING = """
import sys
import numpy as np
from ui.gl import *
ctx = make_headless_context()
target = Target(ctx, (32, 24))
pose = np.eye(4); pose[2, 3] = 2
view = (pose, np.array([[20, 0, 16], [0, 20, 12], [0, 0, 1.0]]), 32, 24)
class One:
    means = np.zeros((1, 3)); quats = np.array([[1, 0, 0, 0]]); scales = np.full((1, 3), .2)
    opacities = np.ones(1); colors = np.ones((1, 3)); key = 0; n_still = 0; still_key = None
image = ImageTexture(ctx); image.set(np.full((5, 7, 3), 40, np.uint8)); target.draw_image(image)
splats = SplatRenderer(ctx); splats.upload(One()); splats.draw(target, *view)
lines = LineRenderer(ctx); lines.set(np.array([[-1, 0, 0], [1, 0, 0]]), np.ones(3)); lines.draw(target, *view)
points = PointRenderer(ctx); points.set(np.zeros((1, 3)), np.ones(3)); points.draw(target, *view, shape="diamond")
target.resolve()
shown = np.frombuffer(target.texture.read(), np.uint8).reshape(24, 32, 4)[..., :3]
assert shown[12, 16].min() > 200, shown[12, 16]
assert shown[0, 0].max() == 40
heavy = {"torch", "pyglet", "imgui_bundle"} & set(sys.modules)
assert not heavy, heavy
assert ctx.error == "GL_NO_ERROR", ctx.error
print(ctx.version_code)
"""


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("Google SwiftShader", True),
        ("softpipe", True),
        ("Microsoft Basic Render Driver", True),
        ("NVIDIA H200/PCIe/SSE2", False),
        ("Apple M2", False),
        ("Mesa Intel(R) UHD Graphics 620 (KBL GT2)", False),
        ("AMD Radeon RX 7800 XT (radeonsi, navi32, LLVM 17.0.6)", False),
    ],
)
def test_software_renderers_are_known_by_name(name: str, expected: bool) -> None:
    assert is_software_name(name) is expected


@pytest.mark.gl
def test_headless_context_is_new_enough_and_knows_its_renderer(ctx: moderngl.Context) -> None:
    assert ctx.version_code >= REQUIRED_VERSION
    assert is_software(ctx) is is_software_name(renderer_name(ctx))
    assert ctx.gc_mode == "context_gc"


@pytest.mark.slow
@pytest.mark.gl
def test_everything_draws_on_plain_3_3_without_heavy_imports(ctx: moderngl.Context) -> None:
    """Mesa can be told to offer no more than 3.3, forward-compatible; other drivers ignore the variables."""
    environment = os.environ | {
        "MESA_GL_VERSION_OVERRIDE": "3.3FC",
        "MESA_GLSL_VERSION_OVERRIDE": "330",
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run(
        [sys.executable, "-c", DRAW_EVERYTHING],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    if is_software(ctx):
        assert done.stdout.strip() == "330"


def test_missing_driver_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**_: object) -> None:
        raise Exception("eglInitialize failed")

    monkeypatch.setattr(moderngl, "create_context", refuse)
    with pytest.raises(ContextError, match=r"eglInitialize failed\. Install Mesa's EGL driver"):
        make_headless_context()
