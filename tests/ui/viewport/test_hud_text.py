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
    captured_words,
    count_text,
    hud_text,
    loading_text,
    pane_text,
    playing_text,
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


def test_the_label_states_clip_frame_view_and_resolution():
    assert text_of(SHOWN, WANTED) == HudText("clip 0   frame 0   0.00 s   free view   960 x 600")


def test_another_frame_on_its_way_is_told_and_the_label_stays_with_the_picture():
    text = text_of(replace(SHOWN, is_on_its_way=True), replace(WANTED, frame_index=7))
    assert text.label.startswith("clip 0   frame 0   0.00 s")
    assert text.pending == "showing frame 0, frame 7 is being drawn"


def test_another_clip_that_is_not_in_memory_is_being_loaded():
    wanted = WantedFrame(1, 10, revision="trained-b", look="home")
    text = text_of(replace(SHOWN, is_on_its_way=True), wanted)
    assert text.label.startswith("clip 0   frame 0")
    assert text.pending == "showing frame 0 of clip 0, clip 1 is being loaded"


@pytest.mark.parametrize(
    ("shown", "wanted", "pending"),
    [
        ({"look": "elsewhere"}, {}, "being redrawn from here"),
        ({"camera_index": 2, "look": 2}, {"camera_index": 5, "look": 5}, "showing cam02, cam05 is being drawn"),
        ({"revision": "live-1-1"}, {"revision": "live-1-2"}, "a newer state of clip 0 is being drawn"),
        ({"size": (240, 150)}, {}, "full resolution follows"),
    ],
)
def test_every_way_in_which_a_picture_can_be_behind_has_words(shown: dict, wanted: dict, pending: str):
    text = text_of(showing(is_on_its_way=True, **shown), replace(WANTED, **wanted))
    assert text.pending == pending


def test_a_reduced_resolution_is_in_the_label():
    assert "240 x 150 of 960 x 600" in text_of(replace(SHOWN, size=(240, 150)), WANTED).label


def test_what_failed_is_not_on_its_way():
    text = text_of(replace(SHOWN, is_on_its_way=True), replace(WANTED, frame_index=7, has_failed=True))
    assert (text.pending, text.failure) == ("", "frame 7 could not be drawn")


def test_a_cloud_that_stands_in_for_a_clip_that_loads_says_what_is_missing():
    text = text_of(ShownPicture(kind=CLOUD, size=(800, 500), full_size=(800, 500)), replace(WANTED, is_loaded=False))
    assert text.pending == "loading clip 0"
    assert text.note == "point cloud of static parts, not the trained result"


@pytest.mark.parametrize(
    ("kind", "state", "words", "note"),
    [
        (HINT, "untrained", "not trained", "captured pictures placed in space: clip 0 is not trained"),
        (
            CLOUD,
            "preparing",
            "preparing",
            "point cloud of static parts, moving objects are missing: clip 0 preparing",
        ),
        (CAPTURED, "stale", "out of date", "captured picture: clip 0 is out of date"),
    ],
)
def test_where_nothing_is_trained_the_reason_is_told(kind: str, state: str, words: str, note: str):
    text = text_of(showing(kind=kind, revision=""), replace(WANTED, revision=""), state=state, state_words=words)
    assert text.note == note


def test_a_picture_of_a_running_training_says_of_which_step_it_is():
    shown, wanted = showing(revision="live-1-1", step=1200), replace(WANTED, revision="live-1-1")
    assert (
        text_of(shown, wanted, state="training", state_words="training").note
        == "clip 0 training, picture of step 1,200"
    )


def test_a_cloud_in_place_of_a_trained_picture_says_so():
    text = text_of(replace(SHOWN, kind=CLOUD, is_cloud_chosen=True), WANTED)
    assert (text.pending, text.note) == ("", "point cloud, not the trained result (4 switches)")


def test_while_playing_the_label_names_both_frames_and_the_rate_is_told():
    shown = showing(frame_index=3, is_on_its_way=True)
    text = text_of(
        shown, replace(WANTED, frame_index=5), rate=ShownRate(4.0, has_skipped=True, every_nth=2, wanted_per_s=10.0)
    )
    assert "frame 3 (playhead 5)   0.30 s" in text.label
    assert (text.pending, text.rate) == ("", "4.0 of 10 fps, every 2nd frame")


def test_rates():
    assert playing_text(ShownRate(None)) == "– of 30 fps"
    assert playing_text(ShownRate(29.5, wanted_per_s=29.97)) == "29.5 of 29.97 fps"
    assert playing_text(ShownRate(4.0, is_every_frame=True)) == "4.0 of 30 fps, every frame"
    assert loading_text(5, 24) == "loading 5 of 24 frames"
    assert playing_text(ShownRate(28.0, has_skipped=True)) == "28.0 of 30 fps, some frames skipped"
    assert playing_text(ShownRate(5.0, has_skipped=True, every_nth=6)) == "5.0 of 30 fps, every 6th frame"
    assert playing_text(ShownRate(10.0, has_skipped=True, every_nth=3)) == "10.0 of 30 fps, every 3rd frame"


def test_compared_pictures_of_different_frames_never_share_a_label():
    assert pane_text("Captured", 3, 3) == "Captured, frame 3"
    assert pane_text("Captured", 3, 0) == "Captured, frame 3 (not the same frame)"
    assert pane_text("Rendered", 0, 3) == "Rendered, frame 0 (not the same frame)"
    assert pane_text(CLOUD, None, 3) == "Point cloud"
    assert pane_text(captured_words(True), 3, 3) == "Captured, in the scene's colours, frame 3"
    assert captured_words(False) == "Captured"


def test_a_count_says_whether_it_is_of_the_frame_or_of_the_clip():
    assert count_text(16366, 24291, "inherited anchors", 12) == "16,366 of 24,291 inherited anchors alive in frame 12"
    assert count_text(24291, 24291, "inherited anchors", 12) == "24,291 inherited anchors"
    assert count_text(300, 0, "residual anchors", 12) == "300 residual anchors in frame 12"


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
