"""Drawing with moderngl into off-screen pictures: splats, pictures, lines, points. No window, no ImGui, no torch.

Whoever makes one of these objects releases it, on the thread of its context.
"""

from ui.gl.camera import NEAR, clip_matrix, resized_K
from ui.gl.changes import n_changes, note_change
from ui.gl.context import ContextError, free_dropped, is_software, make_headless_context, renderer_name
from ui.gl.image import ImageTexture, PixelRect, fit_rect
from ui.gl.lines import LineRenderer, frusta_lines
from ui.gl.points import INHERITED_ANCHOR_COLOR, RESIDUAL_ANCHOR_COLOR, PointRenderer
from ui.gl.splat_renderer import SplatRenderer
from ui.gl.targets import Target

__all__ = [
    "INHERITED_ANCHOR_COLOR",
    "NEAR",
    "RESIDUAL_ANCHOR_COLOR",
    "ContextError",
    "ImageTexture",
    "LineRenderer",
    "PixelRect",
    "PointRenderer",
    "SplatRenderer",
    "Target",
    "clip_matrix",
    "fit_rect",
    "free_dropped",
    "frusta_lines",
    "is_software",
    "make_headless_context",
    "n_changes",
    "note_change",
    "renderer_name",
    "resized_K",
]
