"""ClipTraining from pixels: learning, freezing, resuming, stopping on bad numbers. The sample at quarter size."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch
from msgspec import to_builtins

from engine.assets import asset_path
from engine.backends.table import backend_called
from engine.capture.capture import Capture, open_capture
from engine.capture.clip import split_clips
from engine.clip_files.clip_state import ClipState, read_clip_state, write_clip_state
from engine.errors import NonFiniteLoss, PreparationError, ProjectError
from engine.metrics.clips.evaluate import Evaluation
from engine.metrics.clips.summary import means
from engine.metrics.clips.trained_clip import TrainedClip
from engine.model.clip_view import REACH_SPACINGS, reaches_of
from engine.model.reading import load_clip_model
from engine.training.checkpoint import read_checkpoint
from engine.training.clip_training import ClipTraining
from engine.training.config import TrainConfig
from engine.training.phases import phase_at
from engine.training.preparation.cloud_preparation import Backgrounds, key_of_corrected, write_backgrounds
from engine.training.preparation.method import Method
from tests.clip_headers import write_values
from tests.engine.training.damaged_states import damaged_states
from tests.engine.training.tiny_training import finish, take_steps

pytestmark = pytest.mark.slow

CLIP_LENGTH = 10
CONFIG = TrainConfig(
    static_steps=200, joint_steps=250, source_steps=150, max_static_points=5000, max_moving_points=3000
)


@dataclass(frozen=True)
class Setting:
    """A tiny capture of two clips and the trained reference clip."""

    capture: Capture
    holdout: list[int]
    prep_dir: Path
    reference: ClipState
    first_psnr: float
    last_psnr: float


def start(capture: Capture, clip_index: int, prep_dir: Path, **changes) -> ClipTraining:
    arguments = {
        "config": CONFIG,
        "method": Method(),
        "holdout": capture.camera_indices(list(capture.default_holdout)),
        "reference": None,
        "seed": 0,
        "prep_dir": prep_dir,
        "report": lambda _: None,
    }
    clip = split_clips(capture.n_frames, CLIP_LENGTH)[clip_index]
    return ClipTraining(capture, clip, **(arguments | changes), backend=backend_called("cpu"))


@pytest.fixture(scope="module")
def setting(tmp_path_factory, built_once) -> Setting:
    capture = open_capture(asset_path("sample"), scale=0.25)

    def train(folder: Path) -> None:
        training = start(capture, 0, folder / "prep")
        training.prepare()
        training.step()
        first = training.held_out_psnr()
        write_clip_state(folder / "reference.safetensors", finish(training))
        (folder / "psnr.json").write_text(json.dumps([first, training.held_out_psnr()]))

    folder = tmp_path_factory.mktemp("clip_training")
    built_once.copy("clip_training", folder, train, sources=["tests/engine/training/test_clip_training.py"])
    holdout = capture.camera_indices(list(capture.default_holdout))
    reference = read_clip_state(folder / "reference.safetensors")
    return Setting(capture, holdout, folder / "prep", reference, *json.loads((folder / "psnr.json").read_text()))


@pytest.fixture
def source(setting) -> Callable[..., ClipTraining]:
    def make(**changes) -> ClipTraining:
        return start(setting.capture, 1, setting.prep_dir, **({"reference": setting.reference} | changes))

    return make


def test_training_learns_cameras_it_never_saw(setting):
    # seen: 14 dB after one step, 22 dB after 300 at this size; the margin covers other processors' rounding
    assert setting.last_psnr > setting.first_psnr + 3.0
    assert setting.last_psnr > 19.0


def test_the_reference_has_static_and_moving_anchors(setting):
    model = load_clip_model(setting.reference, None, backend=backend_called("cpu"))
    assert set(model.roles()) == {"static", "moving"}
    presence = model.anchor_set("moving").presence
    assert presence is not None
    assert presence.any(1).all()  # every moving anchor exists in some frame


def test_cameras_that_do_not_differ_get_no_gains(setting):
    gains = setting.reference.arrays["gains"]  # one renderer drew all cameras of the sample
    assert gains.shape == (len(setting.capture.rig) - len(setting.holdout), 3)
    assert (gains == 1.0).all()


def test_gains_learn_in_the_reference_clip_and_are_kept_in_the_next(tiny, tmp_path):
    said: list[str] = []
    settings = {"color": "gain", "static_steps": 4, "joint_steps": 2, "prep_dir": tmp_path}
    training = tiny.prepared(0, is_source=False, report=lambda progress: said.append(progress.message), **settings)
    assert any("White balance: color=gain, gains of the cameras spread by" in line for line in said)
    estimated = training.gains.detach().clone()
    reference = finish(training)
    learned = reference.arrays["gains"]
    assert (learned != estimated.numpy()).any()
    assert np.median(np.log(learned), axis=0) == pytest.approx(0.0, abs=1e-7)  # the gauge; float32 rounds at 6e-8
    source = take_steps(tiny.prepared(1, reference=reference, **settings), 1)
    assert np.array_equal(source.gains.detach().numpy(), learned)


def of_reference(setting):
    """The reference clip as it is shown."""
    return load_clip_model(setting.reference, None, backend=backend_called("cpu"))


def test_a_source_clip_adds_residual_anchors_and_leaves_everything_inherited_untouched(setting, source):
    before = {name: array.copy() for name, array in setting.reference.arrays.items()}
    training = source()
    training.prepare()
    first = training.held_out_psnr()
    state = finish(training)
    assert "sets.residual.positions" in state.arrays  # an object appears in clip 1
    assert not any(name.startswith(("decoder.", "sets.static")) for name in state.arrays)
    assert any(name.startswith("moving_decoder.") for name in state.arrays)  # those of still parts are inherited
    model = training.model
    for name in ("positions", "features", "log_base_scales", "log_offset_scales"):
        kept = getattr(model.anchor_set("static"), name).detach().numpy()
        assert np.array_equal(kept, before[f"sets.static.{name}"]), name
    shown, as_before = model.constant_gaussians("static"), of_reference(setting).constant_gaussians("static")
    assert all(torch.equal(*pair) for pair in zip(shown.tensors(), as_before.tensors(), strict=True))
    # what moves has anchors of the clip's own, which travel
    assert model.roles() == ["static", "residual"]
    assert model.anchor_set("residual").travels
    assert all(np.array_equal(array, before[name]) for name, array in setting.reference.arrays.items())
    assert training.held_out_psnr() > first
    cameras = [setting.holdout[0], training.camera_indices[0]]
    trained = TrainedClip(
        training.clip,
        load_clip_model(state, setting.reference, backend=backend_called("cpu")),
        setting.reference,
        state.drift,
    )
    evaluation = Evaluation(setting.capture, cameras=cameras, holdout=setting.holdout)
    rows = evaluation.measure(trained, frames=[training.clip.start])
    assert [row.is_held_out for row in rows] == [True, False]
    raw, fitted = ([value for row in rows if (value := row.figures[name]) is not None] for name in ("psnr", "psnr_fit"))
    assert all(after >= before - 1e-6 for before, after in zip(raw, fitted, strict=True))  # it includes doing nothing
    assert len(raw) == 2
    assert means(rows)["psnr"] == pytest.approx(np.mean(raw))


def test_same_seed_gives_the_same_clip(source):
    def first_steps() -> ClipState:
        training = source()
        training.prepare()
        for _ in range(5):
            training.step()
        return training.state()

    assert first_steps().fingerprint == first_steps().fingerprint


def test_resuming_continues_exactly_where_it_stopped(source, tmp_path):
    straight = source()
    straight.prepare()
    for _ in range(8):
        straight.step()
    stopped = source()
    stopped.prepare()
    for _ in range(5):
        stopped.step()
    stopped.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = source()
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    assert resumed.steps_done == 5
    for _ in range(3):
        resumed.step()
    assert resumed.state().fingerprint == straight.state().fingerprint


def test_steps_at_once_are_the_same_steps(source, tmp_path):
    one_by_one, at_once = source(), source()
    for training in (one_by_one, at_once):
        training.prepare()
    parts = [one_by_one.step() for _ in range(7)]
    stats = at_once.step(7)
    assert at_once.state().fingerprint == one_by_one.state().fingerprint
    assert stats.gradient_norms == tuple(part.gradient_norms[0] for part in parts)
    assert stats.loss == pytest.approx(sum(part.loss for part in parts) / 7)
    assert (stats.step, stats.train_psnr, stats.n_gaussians) == (7, parts[-1].train_psnr, parts[-1].n_gaussians)
    n_left = at_once.n_steps - 7
    assert len(at_once.step(n_left + 100).gradient_norms) == n_left  # a phase ends where it ends
    assert at_once.is_finished


def test_a_fault_among_many_steps_leaves_what_was_before_it(source, tmp_path):
    """As if it had been alone: parameters, moments, counts, and the order of what comes next."""
    alone, among = source(), source()
    for training in (alone, among):
        training.prepare()
        calls = iter(range(100))
        spoilt = lambda gradient, calls=calls: gradient * (float("nan") if next(calls) > 2 else 1.0)  # noqa: E731
        training.model.anchor_set("residual").features.register_hook(spoilt)
    alone.step(3)
    for training, n in ((alone, 1), (among, 9)):
        with pytest.raises(NonFiniteLoss, match=r"residual\.features.* at step 4, camera cam"):
            training.step(n)
    kept = []
    for training in (alone, among):
        assert training.steps_done == 3
        training.write_checkpoint(tmp_path / "kept.safetensors")
        kept.append((tmp_path / "kept.safetensors").read_bytes())
    assert kept[0] == kept[1]


@pytest.mark.parametrize(("n_steps", "phase"), [(2, "static"), (6, "joint"), (10, "moving")])
def test_resuming_in_any_phase_goes_through_the_changes_of_phase(tiny, tmp_path, n_steps, phase):
    settings = {"is_source": False, "static_steps": 4, "joint_steps": 7, "prep_dir": tmp_path}
    stopped = take_steps(tiny.prepared(0, **settings), n_steps)
    assert phase_at(stopped.phases, n_steps - 1)[0] == ["static", "joint", "moving"].index(phase)
    stopped.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = tiny.training(0, **settings)
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    assert finish(stopped).fingerprint == finish(resumed).fingerprint
    assert "moving" in resumed.model.roles()
    assert any(name.startswith("moving_decoder.") for name in resumed.state().arrays)


def test_a_source_clips_checkpoint_only_names_the_backgrounds_that_all_share(setting, tmp_path):
    prep_dir, kept = tmp_path / "prep", tmp_path / "kept.safetensors"
    shutil.copytree(setting.prep_dir, prep_dir)
    training = start(setting.capture, 1, prep_dir, reference=setting.reference)
    training.prepare()
    training.step()
    key = key_of_corrected(setting.capture, training.clip, training.camera_indices, CONFIG)
    write_backgrounds(prep_dir, training.backgrounds, key)  # as a reference clip does in the end
    training.write_checkpoint(kept)
    assert not {"resume.backgrounds", "resume.is_stable"} & read_clip_state(kept).arrays.keys()
    other = start(setting.capture, 1, prep_dir, reference=setting.reference)
    other.restore_checkpoint(kept)
    assert other.backgrounds.equals(training.backgrounds)
    training.step()
    other.step()
    assert other.state().fingerprint == training.state().fingerprint
    write_backgrounds(prep_dir, Backgrounds(255 - training.backgrounds.images, training.backgrounds.is_stable), key)
    with pytest.raises(ProjectError, match="backgrounds that the checkpoint was made with are gone"):
        start(setting.capture, 1, prep_dir, reference=setting.reference).restore_checkpoint(kept)


def test_a_checkpoint_of_another_clip_is_refused(setting, source, tmp_path):
    training = source()
    training.prepare()
    training.write_checkpoint(tmp_path / "kept.safetensors")
    other = start(setting.capture, 0, setting.prep_dir)
    with pytest.raises(ProjectError, match="has start 10"):
        other.restore_checkpoint(tmp_path / "kept.safetensors")


def test_every_damage_to_a_checkpoint_is_an_error_that_names_the_file(source, tmp_path):
    training = source()
    training.prepare()
    training.step()
    kept = tmp_path / "kept.safetensors"
    training.write_checkpoint(kept)
    good, state = kept.read_bytes(), read_clip_state(kept)
    other = source()
    for name, bad in damaged_states(state).items():
        bad(kept)
        with pytest.raises(ProjectError) as caught:
            other.restore_checkpoint(kept)
        assert (name, caught.value.path) == (name, kept)
    rng = np.random.default_rng(1)
    for at in rng.integers(0, len(good), 20):
        kept.write_bytes(good[:at] + bytes([good[at] ^ 0x10]) + good[at + 1 :])
        with pytest.raises(ProjectError):
            read_checkpoint(kept, frames=(0, 1, 1), camera_names=[], seed=0)
    values = to_builtins(state.header, builtin_types=())
    write_values(kept, state.arrays, values | {"resume": json.dumps(values["resume"])})
    other = source()
    other.restore_checkpoint(kept)  # as the version before wrote it
    training.step()
    other.step()
    assert other.state().fingerprint == training.state().fingerprint


def test_a_gradient_that_is_no_number_stops_with_the_cause_and_keeps_the_model(source):
    training = source()
    training.prepare()
    training.step()
    before = training.state().fingerprint
    training.model.anchor_set("residual").features.register_hook(lambda gradient: gradient * float("nan"))
    with pytest.raises(NonFiniteLoss, match=r"residual\.features.* at step 2, camera cam") as caught:
        training.step()
    assert "--set table_lr=0.04 or --set max_gradient_norm=" in caught.value.hint
    assert training.state().fingerprint == before


@torch.no_grad()
def _spoil_scales(training: ClipTraining) -> None:
    training.model.anchor_set("residual").log_base_scales[:] = float("nan")


@torch.no_grad()
def _spoil_gains(training: ClipTraining) -> None:
    training.gains[:] = float("nan")


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_spoil_scales, r"The volume term of the loss became nan at step 2, camera cam\d+; a Gaussian's scales"),
        (_spoil_gains, r"The photometric loss became nan at step 2, camera cam\d+\."),
    ],
)
def test_a_loss_that_is_no_number_names_its_term_step_and_camera_and_changes_nothing(source, spoil, said):
    training = source()
    training.prepare()
    training.step()
    spoil(training)
    before = training.state().fingerprint, {k: v.tobytes() for k, v in training._phase.arrays().items()}
    with pytest.raises(NonFiniteLoss, match=said) as caught:
        training.step()
    assert "--set table_lr=0.04" in caught.value.hint
    assert training.steps_done == 1
    assert (training.state().fingerprint, {k: v.tobytes() for k, v in training._phase.arrays().items()}) == before


def test_a_step_after_a_loss_that_is_no_number_goes_on_as_if_nothing_had_been(source):
    training = source()
    training.prepare()
    good = training.gains.detach().clone()
    _spoil_gains(training)
    with pytest.raises(NonFiniteLoss):
        training.step()
    with torch.no_grad():
        training.gains[:] = good
    assert np.isfinite(training.step().loss)


def test_holding_out_almost_everything_is_refused(setting, tmp_path):
    everything_but_one = list(range(1, len(setting.capture.rig)))
    with pytest.raises(PreparationError, match="Only 1 of 20"):
        start(setting.capture, 0, tmp_path, holdout=everything_but_one)


def test_gate_off_gives_every_anchor_a_dynamic_feature_at_every_time(tiny, tmp_path):
    training = tiny.prepared(0, is_source=False, static_steps=2, joint_steps=2, gate="off", prep_dir=tmp_path)
    state = finish(training)
    model = load_clip_model(state, None, backend=backend_called("cpu"))
    n_anchors = sum(len(model.anchor_set(role)) for role in model.roles())
    assert len(model.decode(0.0)) == n_anchors * training.config.gaussians_per_anchor
    assert torch.isfinite(model.decode(0.0).means).all()


def test_what_cameras_can_see_stays_as_it_was_when_the_phase_began(source, tmp_path):
    """Sizes of anchors are learned: asked again after a restart, a camera would see others."""
    training = source()
    training.prepare()
    before = {role: reach.clone() for role, reach in training._phase.reaches.items()}
    role = max(before, key=lambda role: len(before[role]))
    with torch.no_grad():
        training.model.anchor_set(role).log_offset_scales += 2.0
    training.write_checkpoint(tmp_path / "kept.safetensors")
    resumed = source()
    resumed.restore_checkpoint(tmp_path / "kept.safetensors")
    assert resumed._phase.reaches.keys() == before.keys()
    assert all(torch.equal(resumed._phase.reaches[role], before[role]) for role in before)
    assert not torch.equal(reaches_of(training.model.anchor_set(role), REACH_SPACINGS * training.spacing), before[role])
