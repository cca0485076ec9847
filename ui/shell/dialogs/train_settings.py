"""The dialog that asks with which settings of its own one clip is to be trained."""

from __future__ import annotations

from imgui_bundle import imgui

from app.session.commands import Command
from app.session.questions import OwnSetting, SettingsQuestion
from app.session.training.train_commands import TrainClip
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import UiState

FIELD_WIDTH = 190.0
SHARED_TEXT = (
    "These settings apply to this clip only. All clips share the sizes of features and decoder, cameras, colours and "
    "the gate."
)

Value = int | float | str | bool


class SettingsDialog:
    """Owns the typed settings until the dialog is answered."""

    def __init__(self) -> None:
        self._asked: SettingsQuestion | None = None
        self._typed: dict[str, Value] = {}

    @property
    def changed(self) -> tuple[tuple[str, Value], ...]:
        """Settings that are others than the project's."""
        settings = () if self._asked is None else self._asked.settings
        return tuple(
            (setting.name, self._typed[setting.name])
            for setting in settings
            if self._typed.get(setting.name, setting.value) != setting.value
        )

    def draw(self, question: SettingsQuestion, ui: UiState) -> None:
        """One line per setting."""
        if question is not self._asked:
            self._asked, self._typed = question, {setting.name: setting.value for setting in question.settings}
        text_wrapped_dim(SHARED_TEXT)
        imgui.spacing()
        for setting in question.settings:
            imgui.set_next_item_width(FIELD_WIDTH)
            self._typed[setting.name] = _field(setting, self._typed[setting.name])
            ui.mark(f"question.{setting.name}")
            imgui.set_item_tooltip(setting.help_text)
        imgui.spacing()
        if question.has_progress and self.changed:
            imgui.text_wrapped("Progress from before the clip was stopped is discarded.")
            imgui.spacing()

    def answer(self, question: SettingsQuestion) -> Command:
        """Train the clip so."""
        return TrainClip(question.clip_index, is_confirmed=True, settings=self.changed)


def _field(setting: OwnSetting, value: Value) -> Value:
    label = f"{setting.label}##{setting.name}"
    if setting.choices:
        if imgui.begin_combo(label, str(value)):
            for choice in setting.choices:
                if imgui.selectable(choice, choice == value)[0]:
                    value = choice
            imgui.end_combo()
        return value
    if isinstance(setting.value, bool):
        return imgui.checkbox(label, bool(value))[1]
    if isinstance(setting.value, int):
        return imgui.input_int(label, int(value), 0, 0)[1]
    is_edited, typed = imgui.input_float(label, float(value), 0.0, 0.0, "%.6g")
    return round(typed, 9) if is_edited else value
