"""The player's layout: what the plain reader of the documents finds in a page, against what was put in."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from engine.assets import asset_path
from engine.conventions import ALPHA_MIN
from engine.export.player.blocks import Packer, joined
from engine.export.player.moving_rows import NamedRows
from engine.export.player.page import json_for_html, web_shader
from engine.export.player.row_coding import POSITION_SHARE, encoded_steps, fitting_rounding, folded
from engine.export.player.still_part import shared_rows, still_part
from engine.export.splats import Splats
from tests.player_scenes import LENGTHS, N_FRAMES, header, made_splats, moving, places, still, write_page

READER = Path(__file__).resolve().parents[3] / "docs/examples/read_player.py"


def reader() -> ModuleType:
    spec = importlib.util.spec_from_file_location("read_player", READER)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows_of(splats: Splats) -> Splats:
    return splats[np.flatnonzero(splats.opacities > ALPHA_MIN)]


@pytest.mark.parametrize("has_folder", [False, True])
def test_every_frame_is_read_as_it_was_written(tmp_path: Path, has_folder: bool):
    folder = tmp_path / "scene #1 data" if has_folder else None
    path = write_page(tmp_path / "scene.html", header(), folder=folder)
    page = reader().Page(path)
    assert page.n_frames == N_FRAMES
    for number, (clip, frame) in enumerate(places()):
        found, wanted = page.frame(number), rows_of(joined(still(clip, frame), moving(clip, frame)))
        assert len(found["means"]) == len(wanted)
        order = nearest(found["means"], wanted.means)
        assert len(set(order)) == len(order)
        wanted = wanted[order]
        size = np.median(wanted.scales.max(1))
        assert np.abs(found["means"] - wanted.means).max() < 0.6 * POSITION_SHARE * 2.0 * size
        assert np.abs(found["opacities"] - wanted.opacities).max() <= 0.5 / 255 + 1e-6
        assert np.abs(found["colors"] - wanted.colors).max() < 1.2 / 255
        assert np.abs(np.log(found["scales"] / wanted.scales)).max() < 0.02
        cosine = np.abs((found["quats"] * wanted.quats).sum(1))
        assert np.degrees(2.0 * np.arccos(np.minimum(cosine, 1.0))).max() < 1.2


def nearest(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    distances = ((points[:, None] - others[None].astype(np.float64)) ** 2).sum(2)
    return distances.argmin(1)


def test_what_stands_still_is_stored_once(tmp_path: Path):
    about = header()
    write_page(tmp_path / "scene.html", about)
    first, second, third, fourth = about["clips"]
    assert about["shared"]["n"] == len(rows_of(still(0, 0)))
    assert (first["hides"], first["own"], first["light"]) == (False, None, None)
    assert second["hides"]
    assert second["own"]["n"] == len(rows_of(made_splats(50, 3)))
    assert second["light"]["frames"] == [0, LENGTHS[1] - 1]  # between them it is linear
    assert third["light"]["frames"] == [0, 1, 2]
    assert fourth["hides"]
    assert fourth["moving"]["n"] == [len(rows_of(joined(still(3, f), moving(3, f)))) for f in range(LENGTHS[3])]


def test_a_page_holds_no_markup_but_its_own(tmp_path: Path):
    evil = "</script><img src=x onerror=\"document.title='pwned'\"><!-- {{script}} \u2028"
    plain = write_page(tmp_path / "plain.html", header()).read_text(encoding="utf-8")
    text = write_page(tmp_path / "evil.html", header(title=evil, names=[evil] * 5)).read_text(encoding="utf-8")
    assert "<img" not in text
    assert text.count("<") == plain.count("<")
    assert text.count("{{") == plain.count("{{") + 6
    assert json.loads(json_for_html({"name": evil})) == {"name": evil}


def test_scripts_end_no_element_and_reach_for_no_network():
    for path in asset_path("player").iterdir():
        text = path.read_text(encoding="utf-8")
        assert "http://" not in text
        assert "https://" not in text
        if path.suffix in (".js", ".css"):
            assert "<" + "/" not in text
            assert "<!--" not in text
            for unsafe in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval("):
                assert unsafe not in text, path.name


def test_shaders_are_those_of_the_window():
    source = asset_path("shaders", "splat.vert").read_text(encoding="utf-8")
    translated = web_shader("splat.vert")
    assert translated.startswith("#version 300 es\n")
    assert translated.endswith(source.partition("\n")[2])
    assert f"#define ALPHA_MIN {ALPHA_MIN!r}\n" in translated


def test_differences_wrap_around():
    assert folded(np.array([0, 255, 1, 128, 127], np.uint8)).tolist() == [0, 1, 2, 255, 254]  # 0, -1, +1, -128, +127
    assert folded(np.array([65535, 1], np.uint16)).tolist() == [1, 2]
    steps = np.array([[65536] * 3 + [256] * 11, [-65537] * 3 + [-257] * 11])  # 0 and -1, once around
    assert encoded_steps(steps) == bytes([0, 1] * 3 + [0, 0] * 3 + [0, 1] * 11)
    assert encoded_steps(steps[:0]) == b""


def test_rows_that_are_the_same_twice_are_two_rows():
    row = made_splats(1, 0)
    shared, splats = joined(row, row, made_splats(2, 1)), joined(row, row, row)
    found, is_hidden = shared_rows(shared, splats)
    assert found.tolist() == [0, 1, -1]
    assert is_hidden.tolist() == [False, False, True, True]


def test_rows_in_another_order_are_other_rows():
    shared = made_splats(4, 1)
    found, is_hidden = shared_rows(shared, shared[np.array([0, 2, 1, 3])])
    assert found.tolist() == [0, 2, -1, 3]
    assert is_hidden.tolist() == [False, True, False, False]


def test_a_scene_of_nothing_is_packed():
    nothing = made_splats(3, 0)[:0]
    assert fitting_rounding([nothing]).step == 1.0
    packer = Packer()
    block = packer.clip(2, still=lambda frame: nothing, moving=lambda frame: NamedRows(nothing))
    assert block.description["moving"]["n"] == [0, 0]
    assert packer.shared is not None
    assert packer.shared.description["n"] == 0


def test_one_frame_has_one_light():
    part = still_part(1, lambda frame: made_splats(5, 0))
    assert part is not None
    assert list(part.colors) == [0]
