"""What the viewport says of its picture. The label is that of the picture, whatever the playhead says."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from app.playback.picture_source import PictureSource
from app.status import WantedFrame
from ui.viewport.hud_text import (
    CAPTURED,
    CLOUD,
    HINT,
    RENDERED,
    HudText,
    ShownPicture,
    hud_text,
    pane_text,
)
from ui.viewport.picture_rate import ShownRate

SHOWN = ShownPicture(
    kind=RENDERED,
    source=PictureSource(clip_index=0, frame_index=0, revision="trained-a", step=100, look="home"),
    size=(960, 600),
    full_size=(960, 600),
)
WANTED = WantedFrame(0, 0, revision="trained-a", look="home", is_loaded=True)


def showing(**changes: Any) -> ShownPicture:
    """SHOWN with other values, of itself or of its source."""
    of_source = {name: changes.pop(name) for name in [*changes] if name in PictureSource.__dataclass_fields__}
    return replace(SHOWN, source=replace(SHOWN.source, **of_source), **changes)


def text_of(
    shown: ShownPicture,
    wanted: WantedFrame,
    *,
    state: str = "trained",
    state_words: str = "trained",
    rate: ShownRate | None = None,
) -> HudText:
    return hud_text(
        shown,
        wanted,
        fps=10.0,
        state=state,
        state_words=state_words,
        camera_name=lambda index: "free view" if index is None else f"cam{index:02d}",
        rate=rate,
    )


def test_the_label_states_clip_frame_view_and_resolution_and_nothing_else_is_said():
    text = text_of(SHOWN, WANTED)
    assert [part for part in ("clip 0", "frame 0", "free view", "960 x 600") if part not in text.label] == []
    assert text == HudText(text.label)


@pytest.mark.parametrize(
    ("shown", "wanted", "named"),
    [
        ({}, {"frame_index": 7}, "frame 7"),
        ({}, {"clip_index": 1, "frame_index": 10, "revision": "trained-b", "is_loaded": False}, "clip 1"),
        ({"look": "elsewhere"}, {}, ""),
        ({"camera_index": 2, "look": 2}, {"camera_index": 5, "look": 5}, "cam05"),
        ({"revision": "live-1-1"}, {"revision": "live-1-2"}, "clip 0"),
        ({"size": (240, 150)}, {}, ""),
    ],
)
def test_every_way_in_which_a_picture_can_be_behind_is_told_and_the_label_is_the_picture_s(
    shown: dict, wanted: dict, named: str
):
    text = text_of(showing(is_on_its_way=True, **shown), replace(WANTED, **wanted))
    assert text.pending
    assert named in text.pending
    assert text.label.startswith("clip 0   frame 0")


def test_a_reduced_resolution_is_in_the_label():
    assert "240 x 150 of 960 x 600" in text_of(replace(SHOWN, size=(240, 150)), WANTED).label


def test_what_failed_is_not_on_its_way():
    text = text_of(replace(SHOWN, is_on_its_way=True), replace(WANTED, frame_index=7, has_failed=True))
    assert (text.pending, "frame 7" in text.failure) == ("", True)


@pytest.mark.parametrize("kind", [HINT, CLOUD, CAPTURED])
def test_where_nothing_is_trained_the_reason_is_told(kind: str):
    text = text_of(showing(kind=kind, revision=""), replace(WANTED, revision=""), state="stale", state_words="too old")
    assert "clip 0" in text.note
    assert "too old" in text.note


def test_a_picture_of_a_running_training_says_of_which_step_it_is():
    shown, wanted = showing(revision="live-1-1", step=1200), replace(WANTED, revision="live-1-1")
    assert "1,200" in text_of(shown, wanted, state="training", state_words="training").note


def test_a_cloud_in_place_of_a_trained_picture_says_so():
    chosen = text_of(replace(SHOWN, kind=CLOUD, is_cloud_chosen=True), WANTED)
    assert (chosen.pending, bool(chosen.note)) == ("", True)
    early = text_of(ShownPicture(kind=CLOUD, size=(800, 500), full_size=(800, 500)), replace(WANTED, is_loaded=False))
    assert (bool(early.pending), bool(early.note)) == (True, True)


def test_while_playing_the_label_names_both_frames_and_the_rate_is_told():
    shown = showing(frame_index=3, is_on_its_way=True)
    text = text_of(
        shown, replace(WANTED, frame_index=5), rate=ShownRate(4.0, has_skipped=True, every_nth=2, wanted_per_s=10.0)
    )
    assert [part for part in ("frame 3", "5", "0.30 s") if part not in text.label] == []
    assert (text.pending, "4.0 of 10" in text.rate) == ("", True)


def test_compared_pictures_of_different_frames_never_share_a_label():
    assert len({pane_text("Captured", shown, wanted) for shown, wanted in ((3, 3), (3, 0), (0, 3))}) == 3
    assert pane_text(CLOUD, None, 3) == pane_text(CLOUD, None, 0)


@pytest.mark.parametrize(
    ("shown", "wanted", "is_of"),
    [
        ({}, {}, True),
        ({"frame_index": 1}, {}, False),
        ({"clip_index": 1}, {}, False),
        ({"look": "elsewhere", "size": (10, 10)}, {}, True),
        ({"frame_index": 1}, {"has_failed": True}, True),
        ({"kind": CLOUD, "frame_index": None}, {}, False),
        ({"kind": CLOUD, "frame_index": None}, {"revision": ""}, True),
        ({"kind": CAPTURED, "frame_index": 3}, {"revision": ""}, False),
    ],
)
def test_playing_every_frame_waits_for_the_right_picture(shown: dict, wanted: dict, is_of: bool):
    assert showing(**shown).is_of(replace(WANTED, **wanted)) is is_of
