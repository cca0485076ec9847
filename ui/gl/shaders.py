"""Loads GLSL from assets/shaders and injects the shared constants, so that no shader repeats a number.

A program `name` is the pair `name.vert` and `name.frag`. Not a cache: whoever draws owns its program and releases it.
"""

from __future__ import annotations

import re

import moderngl

from engine import conventions
from engine.assets import asset_path

INJECTED = ("ALPHA_MIN", "ALPHA_MAX", "EPS2D_PX2", "FRUSTUM_MARGIN")
"""Names of engine.conventions that every shader sees as #define."""

_ERROR_LINE = re.compile(r"\b0[:(](\d+)")  # Mesa and Apple say 0:12, NVIDIA says 0(12)


class ShaderError(RuntimeError):
    """A shipped shader is missing or does not compile: a bug or a driver limit, never the user's data."""


def load_program(ctx: moderngl.Context, name: str) -> moderngl.Program:
    """Compile and link `assets/shaders/<name>.vert` and `.frag`.

    Args:
        ctx: Current context.
        name: File name without extension.
    Returns:
        A program owned by the caller.
    Raises:
        ShaderError: A file is missing, or the driver refused it. Carries the driver's words and the lines they mean.
    """
    vertex, fragment = source_of(f"{name}.vert"), source_of(f"{name}.frag")
    try:
        return ctx.program(vertex_shader=vertex, fragment_shader=fragment)
    except moderngl.Error as error:
        raise ShaderError(readable_error(name, str(error), vertex=vertex, fragment=fragment)) from error


def source_of(file_name: str) -> str:
    """Text of one shader with the constants put in after its #version line. Line numbers stay those of the file."""
    path = asset_path("shaders", file_name)
    try:
        source = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ShaderError(f"The shader {file_name} cannot be read ({error.strerror}) - {path}") from error
    return inject_constants(source, {name: float(getattr(conventions, name)) for name in INJECTED})


def inject_constants(source: str, constants: dict[str, float]) -> str:
    """Put `#define NAME value` after the #version line.

    Args:
        source: GLSL whose first line is its #version.
        constants: Written with all their digits, so that GLSL rounds them as float32 arithmetic would.
    Raises:
        ShaderError: The first line is not a #version.
    """
    version, _, rest = source.partition("\n")
    if not version.startswith("#version"):
        raise ShaderError(f"the first line of a shader must be its #version, got {version!r}")
    defines = "".join(f"#define {name} {value!r}\n" for name, value in constants.items())
    return f"{version}\n{defines}#line 2\n{rest}"


def readable_error(name: str, log: str, *, vertex: str, fragment: str) -> str:
    """The driver's log followed by the source lines it points at."""
    is_fragment = "fragment_shader" in log
    file_name = f"{name}.frag" if is_fragment else f"{name}.vert"
    lines = (fragment if is_fragment else vertex).partition("#line 2\n")[2].splitlines()
    numbers = sorted({int(found) for found in _ERROR_LINE.findall(log)})
    quoted = [f"  {file_name}:{n}: {lines[n - 2].strip()}" for n in numbers if 2 <= n < len(lines) + 2]
    words = "\n".join(line for line in log.splitlines() if line.strip())
    return "\n".join([f"The driver refused the shader {file_name}.", words, *quoted])
