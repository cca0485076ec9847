"""Remedies for a clip: each takes a finished clip and gives it as it would be stored afterwards.

Training itself is engine.training's, as it is for a new clip; only what it begins with and compares with differs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from msgspec.structs import replace as with_entries

from engine.capture.clip import Clip
from engine.clip_files.anchor_record import AnchorRecord
from engine.clip_files.array_names import FIELD, LOG_DRIFT
from engine.clip_files.clip_state import ClipState
from engine.clip_files.compact import CompactClip, compact_clip
from engine.clip_files.roles import STATIC
from engine.mending.targets import FadedPictures, Looks
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig, config_of
from engine.training.retired_settings import without_retired

MakeTraining = Callable[[int, TrainConfig], ClipTraining]
"""Clip index and settings to a training that is not prepared."""
ReportSteps = Callable[[int, int], None]
"""Called with the steps done, and all of them."""
_RATES = ("feature_lr", "scale_lr", "position_lr", "table_lr", "field_mlp_lr")
_FADING, _LEARNING = (8, 0.5), (6, 0.5)
"""Passes over the pictures, and shares of the rates that a training begins with: what is learned is near already."""
_REST_SHARE = 0.5
"""Pictures of a fade that lie outside of the stretch, as a share of those inside: they hold the rest where it is."""
_STEPS = (100, 1500)
_REPORT_EVERY = 10


def relit(state: ClipState, reference: ClipState, make: MakeTraining) -> CompactClip | None:
    """A clip with the exposure of its cameras and the light on it measured again; None where nothing differs.

    Raises:
        EngineError: Pictures cannot be read.
    """
    config = with_entries(_config(state), color="auto")
    colors = make(state.header.clip_index, config).measured_colors()
    arrays = dict(state.arrays)
    arrays.pop(LOG_DRIFT, None)
    if (colors.drift != 1.0).any():
        arrays[LOG_DRIFT] = np.log(colors.drift)
    lights = AnchorRecord(light=np.zeros((0, 2), np.float32)).arrays(STATIC)
    for name in lights:
        arrays.pop(name, None)
    if colors.light is not None:
        arrays |= AnchorRecord(light=colors.light).arrays(STATIC)
    is_exact = state.header.config.get("storage") == "exact"
    compact = compact_clip(ClipState(arrays, state.header), is_exact=is_exact)
    return None if compact.state.fingerprint == state.fingerprint else _measured_anew(compact, state)


def faded(
    state: ClipState,
    clip: Clip,
    span: range,
    looks: Looks,
    make: MakeTraining,
    report: ReportSteps,
    *,
    is_learning: bool = False,
) -> CompactClip:
    """A clip whose still parts pass evenly from the look before a span to the look after it.

    Args:
        state: The clip.
        clip: Its frames.
        span: Frames of the capture that may change; of this clip and a neighbour perhaps.
        looks: All clips concerned, as they were.
        make: Makes its training.
        report: Called with steps.
        is_learning: Whether all that the clip owns learns, and from the truth where there is nothing to go over into.
            Otherwise only its field does, and all else keeps its look.
    Raises:
        NonFiniteLoss: It came to nothing.
    """
    passes, rate = _LEARNING if is_learning else _FADING
    training = make(clip.clip_index, _slower(_config(state), rate))
    pictures = FadedPictures(
        training.capture, clip, training.camera_indices, training.prep_dir, looks, span, is_learning=is_learning
    )
    inside = [frame - clip.start for frame in clip.frame_indices() if frame in span]
    outside = [frame - clip.start for frame in clip.frame_indices() if frame not in span]
    items = _items(inside, pictures.n_cameras, clip)
    rest = _items(outside, pictures.n_cameras, clip)
    n_rest = min(len(rest), round(_REST_SHARE * len(items)))
    chosen = np.random.default_rng(state.header.seed).permutation(len(rest))[:n_rest]
    items += [rest[i] for i in chosen]
    learning = ("",) if is_learning else (FIELD,)
    training.take_up(state, pictures, items, n_steps=_n_steps(passes * len(items)), learning=learning)
    while not training.is_finished:
        training.step()
        if training.steps_done % _REPORT_EVERY == 0:
            report(training.steps_done, training.n_steps)
    return _measured_anew(training.finish(), state)


def _items(frames: Iterable[int], n_cameras: int, clip: Clip) -> list[int]:
    """Numbers of the pictures of some frames of a clip, as ClipTraining.take_up counts them."""
    return [row * clip.n_frames + frame for row in range(n_cameras) for frame in frames]


def _n_steps(wanted: int) -> int:
    lowest, highest = _STEPS
    return min(max(wanted, lowest), highest)


def _measured_anew(clip: CompactClip, state: ClipState) -> CompactClip:
    """With the header of the clip as it was: its settings and steps are those of its training, its anchors lie in the
    same rows. Figures are gone."""
    figures = with_entries(state.header.figures, held_out_psnr=None, held_out_whole=False)
    now = clip.state.header
    header = with_entries(state.header, fingerprint=now.fingerprint, schema=now.schema, rows_of=state.header.origin)
    return CompactClip(ClipState(clip.state.arrays, with_entries(header, metrics=figures)), clip.coded)


def _config(state: ClipState) -> TrainConfig:
    return config_of(without_retired(state.header.config))


def _slower(config: TrainConfig, share: float) -> TrainConfig:
    return with_entries(config, **{name: share * getattr(config, name) for name in _RATES})
