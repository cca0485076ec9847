"""GL contexts: made without a window, and asked what they run on. Windows are made in ui.shell.window."""

from __future__ import annotations

import moderngl

REQUIRED_VERSION = 330
"""OpenGL 3.3 core: the newest that every desktop of the last decade offers, macOS included."""
SOFTWARE_RENDERERS = ("llvmpipe", "softpipe", "swiftshader", "swrast", "software rasterizer", "microsoft basic render")


class ContextError(RuntimeError):
    """No usable OpenGL context can be made on this machine. The message says what was tried and what to install."""


def make_headless_context() -> moderngl.Context:
    """A context without a window or a display, through EGL. Current on the calling thread.

    Returns:
        An OpenGL 3.3 core context or newer. GL objects dropped without release() wait for free_dropped(), instead of
        being freed on whichever thread the garbage collector happens to run.
    Raises:
        ContextError: No EGL library, no driver, or a version below 3.3.
    """
    try:
        ctx = moderngl.create_context(standalone=True, require=REQUIRED_VERSION, backend="egl")  # pyright: ignore[reportArgumentType] - the stub is wrong
    except Exception as error:  # glcontext raises bare Exception, ImportError and OSError alike
        raise ContextError(
            f"No OpenGL 3.3 context without a window: {error}. "
            "Install Mesa's EGL driver (Debian, Ubuntu: libegl1 libgl1-mesa-dri)."
        ) from error
    ctx.gc_mode = "context_gc"
    return ctx


def free_dropped(ctx: moderngl.Context) -> int:
    """Release GL objects that were dropped without release(), here on the context's thread; returns how many.

    Instead of ctx.gc(), which fails on objects that had been released by hand before they were dropped
    (moderngl 5.13, its issue 695). Needs gc_mode "context_gc".
    """
    n_released = 0
    while ctx.objects:
        dropped = ctx.objects.popleft()
        if hasattr(dropped, "release"):
            dropped.release()
            n_released += 1
    return n_released


def renderer_name(ctx: moderngl.Context) -> str:
    """The driver's name for the renderer, such as "llvmpipe (LLVM 15.0.6, 256 bits)"."""
    return str(ctx.info["GL_RENDERER"])


def is_software(ctx: moderngl.Context) -> bool:
    """Does the CPU do the drawing? Then the CPU rasterizer's picture is the cheaper way to show many Gaussians."""
    return is_software_name(renderer_name(ctx))


def is_software_name(name: str) -> bool:
    """The same question asked of a renderer string."""
    return any(known in name.lower() for known in SOFTWARE_RENDERERS)
