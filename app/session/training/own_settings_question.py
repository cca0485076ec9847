"""The question which settings a clip is to be trained with instead of the project's."""

from __future__ import annotations

from app.project.clips.clip_catalog import ClipCatalog
from app.project.opening.opened_project import OpenedProject
from app.session.questions import OwnSetting, SettingsQuestion, retrain_question
from app.training.own_settings import derived_steps, offered
from engine.errors import ProjectError
from engine.training.config import SETTINGS

_LABELS = {
    "source_steps": "Steps",
    "ssim_weight": "Weight of SSIM",
    "volume_weight": "Weight of volume",
    "residual": "Residual anchors",
}
"""Of settings without a label, or with a longer one than one clip needs."""


def settings_question(opened: OpenedProject, catalog: ClipCatalog, clip_index: int) -> SettingsQuestion:
    """Raises ProjectError where there is no such clip, or the project is read-only."""
    project = opened.project
    project.check_writable()
    if not 0 <= clip_index < len(opened.clips):
        raise ProjectError(f"There is no clip {clip_index}; clips are 0 to {len(opened.clips) - 1}.")
    config = project.settings.config()
    capture = opened.capture.without(project.document.exclusions)
    n_cameras = len(capture.training_cameras(opened.holdout))
    derived = derived_steps(config, n_cameras, opened.clips[clip_index].n_frames, capture.picture_size)
    settings = []
    for name in offered(project, clip_index):
        declared = SETTINGS[name]
        value = derived[name] if name in derived else getattr(config, name)
        help_text = f"{declared.meaning}\n{declared.span}"
        if declared.choices:
            help_text = "\n".join([declared.meaning, *(f"{word}: {said}" for word, said in declared.choices.items())])
        label = _LABELS.get(name, declared.label or name)
        settings.append(OwnSetting(name, label, value, tuple(declared.choices), help_text))
    record = catalog[clip_index]
    is_finished = record.state in ("trained", "damaged")
    retrain = retrain_question(catalog, clip_index) if is_finished else None
    return SettingsQuestion(clip_index, tuple(settings), retrain, record.resume_step is not None)
