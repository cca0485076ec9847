"""Fills: packed to the byte, refused when damaged, shown where their edit holds, and changed by the edits above."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from msgspec import structs

from engine.clip_files.roles import STATIC
from engine.editing.actions import Action, Delete, Expose, Hide, Hold, Recolor, Transform
from engine.editing.edit import Box, Edit, Everything, Fill, Picked, PickedRows, Scope, Sphere, Target
from engine.editing.effects import EditStack
from engine.editing.fills.fill import (
    FILLED,
    GUESSED,
    MAX_FILLED,
    FillGaussians,
    fill_key,
    fits,
    packed_fill,
    unpacked_fill,
)
from engine.editing.permanent.deleted_anchors import deleted_anchors
from engine.editing.permanent.renumbering import Renumbered, with_new_numbers
from engine.editing.picks import pack_rows, unpack_rows
from engine.errors import ProjectError
from tests.engine.editing.edited_clips import CLIP, REFERENCE, edited, make_clip

BALL = Sphere((0.5, 0.5, 0.5), 0.4)
N = 5


def gaussians(n: int = N) -> FillGaussians:
    """In a row along x, from 2 on; every other one is a guess."""
    rows = np.arange(n)
    return FillGaussians(
        means=np.stack([2.0 + rows, np.zeros(n), np.zeros(n)], axis=1).astype(np.float32),
        quats=np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (n, 1)),
        scales=np.full((n, 3), 0.1, np.float32),
        opacities=np.full(n, 1.0, np.float32),
        colors=np.tile(np.array([0.2, 0.4, 0.6], np.float32), (n, 1)),
        is_guess=rows % 2 == 1,
    )


def filled_edit(
    edit_id: int = 1,
    target: Target = BALL,
    action: Action | None = None,
    scope: Scope | None = None,
    traces: tuple[PickedRows, ...] = (),
) -> Edit:
    edit = Edit(edit_id, "", target, action or Delete(), scope or Scope())
    return structs.replace(edit, fill=Fill(fill_key(edit), traces, packed_fill(gaussians())))


def shown(*edits: Edit, frame: int = CLIP.start):
    return edited(make_clip()).decode(CLIP.clip_time(frame), EditStack(edits).at(frame))


def of_fill(found) -> torch.Tensor:
    """Which rows come from fills. [N] bool"""
    roles = np.array([row_set.role for row_set in found.rows.sets])
    return torch.from_numpy(np.isin(roles, (FILLED, GUESSED))[found.rows.set_index])


def test_packed_and_unpacked_they_are_the_same():
    found = unpacked_fill(packed_fill(gaussians()))
    for name in ("means", "quats", "scales", "opacities", "colors", "is_guess"):
        np.testing.assert_allclose(getattr(found, name), getattr(gaussians(), name), atol=1e-6)
    assert packed_fill(found) == packed_fill(gaussians())
    assert packed_fill(gaussians(0)) == b""
    assert len(unpacked_fill(b"")) == 0


def test_there_are_only_so_many():
    with pytest.raises(ValueError, match=f"{MAX_FILLED + 1} Gaussians; the limit is {MAX_FILLED}"):
        packed_fill(gaussians(MAX_FILLED + 1))


def test_damaged_ones_are_refused_or_the_same(rng: np.random.Generator):
    packed = packed_fill(gaussians(40))
    n_refused = 0
    for _ in range(100):
        damaged = bytearray(packed)
        match rng.integers(3):
            case 0:
                damaged[rng.integers(len(damaged))] ^= 1 << rng.integers(8)
            case 1:
                del damaged[rng.integers(len(damaged)) :]
            case _:
                damaged += rng.bytes(3)
        try:
            unpacked_fill(bytes(damaged))
        except ValueError:
            n_refused += 1
    assert n_refused >= 98  # two bits of the header of zlib say nothing that counts


def test_an_edit_with_a_damaged_fill_says_so():
    edit = structs.replace(filled_edit(), fill=Fill(fill_key(filled_edit()), (), b"nonsense"))
    with pytest.raises(ProjectError, match=r"Gaussians of its fill are damaged\. Remove its fill"):
        shown(edit)


def test_it_is_shown_in_the_frames_of_its_edit_and_comes_last():
    edit = filled_edit(scope=Scope(11, 13))
    without = shown(structs.replace(edit, fill=None), frame=11)
    found = shown(edit, frame=11)
    assert len(found.gaussians.means) == len(without.gaussians.means) + N
    assert found.n_still == without.n_still
    torch.testing.assert_close(found.gaussians.means[:-N], without.gaussians.means)
    assert of_fill(found).nonzero()[:, 0].tolist() == list(range(len(of_fill(found)) - N, len(of_fill(found))))
    assert (found.rows.set_index[-N:] - found.rows.set_index[-N]).tolist() == [0, 1, 0, 1, 0]
    for frame in (10, 13):
        assert not of_fill(shown(edit, frame=frame)).any()
    assert not of_fill(shown(structs.replace(edit, is_on=False), frame=11)).any()


def test_one_that_was_made_for_another_target_is_not_shown():
    edit = structs.replace(filled_edit(), target=Box((0.5, 0.5, 0.5), (0.1, 0.1, 0.1)))
    assert not fits(edit)
    assert not of_fill(shown(edit)).any()
    assert fits(structs.replace(filled_edit(), name="other", scope=Scope(3)))


def test_traces_go_with_it():
    rows = np.array([3, 4, 5, 6])
    traces = (PickedRows(0, REFERENCE, STATIC, pack_rows(rows)),)
    nothing = Sphere((9.0, 9.0, 9.0), 0.1)
    before = shown(structs.replace(filled_edit(target=nothing), fill=None))
    found = shown(filled_edit(target=nothing, traces=traces))
    assert len(before.gaussians.means) - len(found.gaussians.means) + N == len(rows)
    place = [row_set.role for row_set in found.rows.sets].index(STATIC)
    assert not np.isin(found.rows.number[found.rows.set_index == place], rows).any()


@pytest.mark.parametrize(
    ("edit", "n_left"),
    [
        (Edit(2, "", Sphere((2.0, 0.0, 0.0), 1.1), Hide()), 3),
        (Edit(2, "", Sphere((2.0, 0.0, 0.0), 1.1), Hide(), is_inverted=True), 2),
        (Edit(2, "", Everything(), Delete()), 0),
        (Edit(2, "", Picked(()), Delete()), 5),
        (Edit(2, "", Picked(()), Hide(), is_inverted=True), 0),
        (Edit(2, "", Everything(), Hide(), Scope(is_reference_only=True)), 5),
    ],
)
def test_edits_above_take_it_away_by_volume(edit: Edit, n_left: int):
    assert int(of_fill(shown(filled_edit(), edit)).sum()) == n_left


def test_edits_above_change_it_and_those_below_do_not():
    move = Edit(2, "", Everything(), Transform((0.0, 1.0, 0.0)))
    grey = Edit(3, "", Everything(), Recolor((0.5, 0.5, 0.5), 1.0, opacity=0.5))
    freeze = Edit(4, "", Everything(), Hold(CLIP.start))
    found = shown(filled_edit(), move, grey, freeze)
    rows = of_fill(found)
    assert (found.gaussians.means[rows, 1] == 1.0).all()
    torch.testing.assert_close(found.gaussians.colors[rows], torch.full((N, 3), 0.5))
    torch.testing.assert_close(found.gaussians.opacities[rows], torch.full((N,), 0.5))
    below = shown(move, structs.replace(filled_edit(), edit_id=9))
    assert (below.gaussians.means[of_fill(below), 1] == 0.0).all()
    light = shown(filled_edit(), Edit(2, "", Everything(), Expose(1.0)))
    assert (light.gaussians.colors[of_fill(light)] > 0.2).all()


def test_two_fills_are_both_shown():
    second = filled_edit(2, Sphere((0.1, 0.1, 0.1), 0.1))
    assert int(of_fill(shown(filled_edit(), second)).sum()) == 2 * N


def test_fills_are_nothing_to_what_is_applied_permanently():
    clip = edited(make_clip())
    filled, plain = filled_edit(), structs.replace(filled_edit(), fill=None)
    with_fill, without = deleted_anchors(clip, (filled,)), deleted_anchors(clip, (plain,))
    assert all((with_fill[role] == without[role]).all() for role in without)


def test_clips_that_lose_anchors_keep_the_fill():
    traces = (PickedRows(0, REFERENCE, STATIC, pack_rows(np.array([3, 4, 9]))),)
    edit = filled_edit(target=Picked(traces), traces=traces)
    sets = {(REFERENCE, STATIC): Renumbered("now", np.array([True, False, True, True]), 3)}
    (after,) = with_new_numbers((edit,), sets)
    assert fits(after)
    assert after.fill is not None
    assert after.fill.traces[0] == traces[0]
    assert unpack_rows(after.fill.traces[1].rows).tolist() == [6]
