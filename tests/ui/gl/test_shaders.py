"""Shaders get their numbers from engine.conventions, and a refused one says where."""

from __future__ import annotations

import moderngl
import pytest

from engine import conventions
from engine.assets import asset_path
from ui.gl import shaders
from ui.gl.shaders import ShaderError, inject_constants, load_program, readable_error, source_of

FILES = sorted(path.name for path in asset_path("shaders").iterdir())


@pytest.mark.parametrize("file_name", FILES)
def test_every_shader_is_plain_3_3_and_repeats_no_constant(file_name: str) -> None:
    text = asset_path("shaders", file_name).read_text()
    assert text.startswith("#version 330 core\n")
    for number in ("255", "0.999", "0.99", "0.3;", "0.15"):
        assert number not in text, f"{number} belongs to engine.conventions"


def test_constants_are_those_of_the_conventions() -> None:
    source = source_of("splat.vert")
    assert f"#define ALPHA_MIN {conventions.ALPHA_MIN!r}\n" in source
    assert f"#define EPS2D_PX2 {conventions.EPS2D_PX2!r}\n" in source
    assert source.index("#version") < source.index("#define") < source.index("void main")


def test_source_without_version_is_refused() -> None:
    with pytest.raises(ShaderError, match="#version"):
        inject_constants("void main() {}\n", {"A": 1.0})


def test_missing_shader_names_the_file() -> None:
    with pytest.raises(ShaderError, match=r"no_such\.vert cannot be read"):
        source_of("no_such.vert")


@pytest.mark.parametrize("place", ["0:4(9): error", "0(4) : error C1008", "ERROR: 0:4:"])
def test_error_quotes_the_line_each_driver_means(place: str) -> None:
    text = "#version 330 core\n// two\nvoid main() {\n    oops();\n}\n"
    vertex = inject_constants(text, {"A": 1.0, "B": 2.0})
    message = readable_error("sample", f"vertex_shader\n=====\n{place}: undeclared", vertex=vertex, fragment="")
    assert message.startswith("The driver refused the shader sample.vert.")
    assert "sample.vert:4: oops();" in message


@pytest.mark.gl
def test_refused_shader_quotes_the_real_driver(ctx: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
    genuine = source_of

    def spoiled(file_name: str) -> str:
        return genuine(file_name).replace("max(drawn.a, 1e-6)", "no_such_name")

    monkeypatch.setattr(shaders, "source_of", spoiled)
    with pytest.raises(ShaderError, match=r"resolve\.frag:\d+: color = vec4\(drawn\.rgb / no_such_name"):
        load_program(ctx, "resolve")


@pytest.mark.gl
@pytest.mark.parametrize("name", sorted({name.split(".")[0] for name in FILES}))
def test_every_program_links(ctx: moderngl.Context, name: str) -> None:
    load_program(ctx, name).release()
