"""The page: scripts, shaders and the scene's bytes in one HTML file, which needs no network and no other file; or the
page, and a folder of bytes that it fetches from where it came from.

Whatever comes from a capture goes into the page as JSON without a "<", and from there into text nodes only. The page's
own policy lets no other script run than its own, which it knows by its hash.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from engine import conventions
from engine.assets import asset_path
from engine.export.player.blocks import Block

SCRIPTS = (
    "textures.js",
    "renderer.js",
    "webgpu.js",
    "view.js",
    "pointer.js",
    "clock.js",
    "blocks.js",
    "loader.js",
    "pictures.js",
    "timeline.js",
    "keys.js",
    "controls.js",
    "stage.js",
    "headset.js",
    "embedding.js",
    "player.js",
)
"""In the order in which they are joined."""
WORKER_SCRIPTS = (
    "textures.js",
    "worker_decoding.js",
    "worker_scene.js",
    "worker_sorting.js",
    "worker_painting.js",
    "worker_main.js",
)
SHADERS = ("splat.vert", "splat.frag", "resolve.vert")
"""The shaders of the window, in assets/shaders."""
OWN_SHADERS = ("present.frag", "mark.vert", "mark.frag", "splats.wgsl")
"""Those of the page alone, in assets/player."""
CONSTANTS = ("ALPHA_MIN", "ALPHA_MAX", "EPS2D_PX2", "FRUSTUM_MARGIN")
"""Names of engine.conventions, which shaders see as #define, and the worker as const."""
FORMAT, VERSION = "clipgstream-player", 2

_POSTER = '<img id="poster" alt="The first view of the scene" src="data:image/jpeg;base64,{}">'
_PRECISION = "".join(f"precision highp {kind};\n" for kind in ("float", "int", "sampler2D"))


class PageWriter:
    """Writes the page piece by piece, so that the scene is never in memory as a whole. Made by `page_writer`."""

    def __init__(self, stream: TextIO, folder: Path | None) -> None:
        self._stream, self._folder = stream, folder
        self.n_bytes_of_blocks = 0

    def block(self, name: str, block: Block) -> None:
        """Add what the page loads under a name of plain letters and digits."""
        text = base64.b64encode(block.data).decode("ascii")
        self.n_bytes_of_blocks += len(text)
        if self._folder is None:
            self._stream.write(f'<script type="text/plain" id="block-{name}">{text}</script>\n')
            return
        (self._folder / f"{name}.bin").write_bytes(block.data)
        self.n_bytes_of_blocks += len(block.data)
        # A page from a disk may load scripts, and nothing else.
        (self._folder / f"{name}.js").write_text(f'clipgstreamBlock("{name}","{text}");\n', encoding="ascii")


@contextmanager
def page_writer(
    stream: TextIO, header: dict[str, Any], *, folder: Path | None = None, poster: bytes | None = None
) -> Iterator[PageWriter]:
    """Write the page around its blocks.

    Args:
        stream: Of the page, UTF-8.
        header: The page's facts about the scene; see docs/player_format.md. It may be completed until the end.
        folder: Where blocks go as files of their own; None to put them into the page.
        poster: A JPEG of the first view, 16:9, which is seen until the first picture is there; None for none.
    """
    before, after = _asset("player.html").split("{{blocks}}\n")
    script = "'use strict';\n" + "\n".join(map(_asset, SCRIPTS))
    style = _asset("style.css")
    parts = {
        "policy": _policy(script, style, has_folder=folder is not None),
        "poster": "" if poster is None else _POSTER.format(base64.b64encode(poster).decode("ascii")),
        "style": style,
        "script": script,
        "worker": "'use strict';\n" + _constants("const {} = {};\n") + "\n".join(map(_asset, WORKER_SCRIPTS)),
        "shaders": json_for_html({name: web_shader(name) for name in (*SHADERS, *OWN_SHADERS)}),
    }
    stream.write(_filled(before, parts))
    yield PageWriter(stream, folder)
    stream.write(_filled(after, {**parts, "header": json_for_html({"format": FORMAT, "version": VERSION, **header})}))


def page_bytes(header: dict[str, Any]) -> int:
    """How large the page is without its blocks."""
    stream = io.StringIO()
    with page_writer(stream, header):
        pass
    return len(stream.getvalue().encode())


def json_for_html(value: Any) -> str:
    """JSON that ends no element and opens none, whatever it holds."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def web_shader(name: str) -> str:
    """A shader of desktop OpenGL in the language of WebGL 2, with the rasterizer's constants; one of WebGPU as it is,
    with these.

    Only the first line and the precision differ, so that page and window draw alike.
    """
    source = asset_path("player" if name in OWN_SHADERS else "shaders", name).read_text(encoding="utf-8")
    if name.endswith(".wgsl"):
        return _constants("const {} = {};\n") + source
    version, _, rest = source.partition("\n")
    if version != "#version 330 core":
        raise ValueError(f"{name} is not in the version that can be translated: {version!r}")
    defines = _constants("#define {} {}\n")
    return f"#version 300 es\n{_PRECISION}{defines}#line 2\n{rest}"


def _constants(line: str) -> str:
    return "".join(line.format(name, repr(float(getattr(conventions, name)))) for name in CONSTANTS)


def _policy(script: str, style: str, *, has_folder: bool) -> str:
    """The sources the page may load: itself, and the blocks next to it where there are some, which are fetched from a
    server and are scripts on a disk. Nothing else of any network."""
    rules = {
        "default-src": "'none'",
        "script-src": f"'sha256-{_digest(script)}'" + (" file:" if has_folder else ""),
        "connect-src": "'self'" if has_folder else "'none'",
        "worker-src": "blob:",
        "img-src": "data:",
        "style-src": f"'sha256-{_digest(style)}'",
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    return "; ".join(f"{name} {allowed}" for name, allowed in rules.items())


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _asset(name: str) -> str:
    return asset_path("player", name).read_text(encoding="utf-8")


def _filled(template: str, parts: dict[str, str]) -> str:
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found.group(1)], template)
