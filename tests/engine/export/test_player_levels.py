"""What comes first in a block, what is left out of it, and how what moves is stored as changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.backends.table import backend_called
from engine.camera.rig import CameraRig
from engine.export.player.blocks import LEVEL_SHARES, N_LEVELS, Packer, joined
from engine.export.player.moving_rows import NamedRows, encoded_moving, places_of
from engine.export.player.row_coding import COMPACT, FINE, fitting_rounding, in_steps, rounded
from engine.export.player.seen_weights import SeenWeights, weight_by_size
from engine.export.splats import Splats
from tests.engine.export.test_player_layout import reader
from tests.player_scenes import NEAR, SIZE, camera, header, made_splats, write_page


def moved(splats: Splats, by: float) -> Splats:
    return Splats(splats.means + np.float32(by), splats.quats, splats.scales, splats.opacities, splats.colors)


@pytest.mark.parametrize("precision", [FINE, COMPACT])
def test_rows_that_come_go_and_return_are_read_as_they_were(precision):
    rows = made_splats(40, 7)
    names = [np.arange(0, 30), np.arange(10, 40), np.arange(0, 35), np.zeros(0, np.int64), np.arange(5, 40)[::-1]]
    frames = [NamedRows(moved(rows, 0.01 * number)[at], at) for number, at in enumerate(names)]
    rounding = fitting_rounding([frame.splats for frame in frames], precision)
    data, n_rows = encoded_moving([one.splats for one in frames], places_of(frames), rounding, precision.held_steps)
    assert n_rows == 40
    counts = [len(at) for at in names]
    assert len(data) == 5 * 5 + 17 * sum(counts)
    found = reader_part(data).frames(n_rows, counts)
    off = 0.5 if precision is FINE else COMPACT.held_steps
    for frame, numbers in zip(frames, found, strict=True):
        steps = in_steps(frame.splats[np.argsort(places_of([*frames[:2], frame])[2])], rounding)
        assert np.abs(np.delete(numbers.astype(float) - steps, 3, axis=1)).max(initial=0.0) <= off + 1e-6


def reader_part(data: bytes):
    part = object.__new__(reader().Part)
    part.data, part.at = data, 0
    return part


def test_rows_that_move_little_take_few_bytes():
    rows = made_splats(2000, 3)
    still, random = rows[:0], np.random.default_rng(0)
    frames = [
        Splats.from_arrays(
            rows.means + random.normal(0.0, 0.01, (2000, 3)),
            rows.quats + random.normal(0.0, 0.01, (2000, 4)),
            rows.scales * np.exp(random.normal(0.0, 0.02, (2000, 3))),
            rows.opacities,
            rows.colors + random.normal(0.0, 0.005, (2000, 3)),
        )
        for _ in range(5)
    ]

    def n_bytes(has_names: bool) -> int:
        names = np.arange(len(rows)) if has_names else None
        return len(Packer().clip(5, lambda f: still, lambda f: NamedRows(frames[f], names)).data)

    assert n_bytes(True) < 0.75 * n_bytes(False)


def test_a_number_is_kept_while_it_stays_near():
    splats = made_splats(50, 1)
    rounding = fitting_rounding([splats], COMPACT)
    steps = in_steps(splats, rounding)
    before = rounded(steps)
    near, far = steps.copy(), steps.copy()
    near[:, 10], far[:, 10] = before[:, 10] + 0.7, before[:, 10] + 0.9
    assert np.array_equal(rounded(near, before, COMPACT.held_steps)[:, 10], before[:, 10])
    assert np.array_equal(rounded(far, before, COMPACT.held_steps)[:, 10], before[:, 10] + 1)


def test_the_beginning_of_a_block_holds_the_heaviest_rows(tmp_path: Path):
    page = reader().Page(write_page(tmp_path / "scene.html", header()))
    whole, first = page.frame(0), page.frame(0, 1)
    assert len(first["means"]) == pytest.approx(LEVEL_SHARES[0] * len(whole["means"]), abs=3)
    sides = np.sort(whole["scales"], axis=1)
    weight = whole["opacities"] * sides[:, 1] * sides[:, 2]
    n_still = page.header["shared"]["levels"][0]
    assert weight[:n_still].min() > 0.9 * np.sort(weight)[-5 * n_still :].min()
    assert [len(page.frame(0, n)["means"]) for n in range(1, N_LEVELS + 1)] == sorted(
        len(page.frame(0, n)["means"]) for n in range(1, N_LEVELS + 1)
    )


def test_what_is_hidden_weighs_nothing_and_is_left_out():
    matrices, Ks = zip(*(camera(index) for index in range(2)), strict=True)
    rig = CameraRig(("a", "b"), np.stack(matrices), np.stack(Ks), np.array([SIZE, SIZE]))
    weigh = SeenWeights.of(rig, NEAR, backend_called("cpu"))
    centre = np.zeros((1, 3))
    upright, red, green = np.array([[1.0, 0, 0, 0]]), np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]])
    wall = Splats.from_arrays(centre, upright, np.full((1, 3), 0.5), np.ones(1), red)
    inside = Splats.from_arrays(centre + 1e-3, upright, np.full((1, 3), 0.001), np.full(1, 0.004), green)
    weights = weigh(joined(wall, inside))
    assert weights[0] > 0.05
    assert weights[1] < 1e-4
    packer = Packer(weigh=weigh, unseen=1e-4)
    block = packer.clip(1, lambda f: wall[:0], lambda f: NamedRows(joined(wall, inside)))
    assert block.description["moving"]["n"] == [1]
    assert Packer().clip(1, lambda f: wall[:0], lambda f: NamedRows(joined(wall, inside))).description["moving"][
        "n"
    ] == [2]
    assert weight_by_size(joined(wall, inside))[0] > 0.2


def test_parts_that_are_cut_off_or_lie_are_refused(tmp_path: Path):
    page = reader().Page(write_page(tmp_path / "scene.html", header()))
    (part,) = page._parts("clip0", page.header["clips"][0])[:1]
    packed, n_bytes = page.header["clips"][0]["parts"][0]
    assert len(part.data) == n_bytes
    page.header["clips"][0]["parts"][0] = [packed // 2, n_bytes]
    with pytest.raises(AssertionError, match="bytes instead of"):
        page.frame(0)
    page.header["clips"][0]["parts"][0] = [packed, n_bytes // 2]
    with pytest.raises(AssertionError, match="bytes instead of"):
        page.frame(0)
