"""The plan of the next clip in the training panel: its cost, and the main settings while they may change."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.session.projects.project_commands import AskStartOver, NewProject
from app.session.projects.setting_commands import SetPreset, SetTrainSetting
from app.status import PlanStatus
from ui.panels.pieces.widgets import text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style.numbers import format_count, parsed_count

LINES_HEIGHT = 170.0
FIELD_WIDTH = 110.0


def draw_plan(plan: PlanStatus, dispatch: Dispatch, ui: UiState) -> None:
    """The forecast in one sentence, and below a header that folds out: settings, then every line.

    Args:
        plan: app.status.PlanStatus.
    """
    text_wrapped_dim(f"Plan: {plan.summary}." if plan.summary else "Plan: computing ...")
    ui.mark("plan.summary")
    is_open = imgui.collapsing_header("Plan and settings")
    ui.mark("plan.header")
    if not is_open:
        return
    imgui.begin_disabled(not plan.can_edit)
    _draw_settings(plan, dispatch, ui)
    imgui.end_disabled()
    if not plan.can_edit:
        text_wrapped_dim("A clip is finished with these settings.")
        if imgui.button("Start over ..."):
            dispatch(AskStartOver())
        ui.mark("plan.start_over")
        imgui.set_item_tooltip("Choose a preset; what would be discarded is shown first")
        imgui.same_line()
        if imgui.button("New project ..."):
            dispatch(NewProject())
        ui.mark("plan.new_project")
        imgui.set_item_tooltip("Another project of this capture; this one does not change")
    elif plan.discards:
        text_wrapped_dim(f"A change discards {plan.discards}.")
    _draw_lines(plan)


def _draw_settings(plan: PlanStatus, dispatch: Dispatch, ui: UiState) -> None:
    imgui.set_next_item_width(FIELD_WIDTH)
    if imgui.begin_combo("Preset", plan.preset):
        for name in plan.presets:
            if imgui.selectable(name, name == plan.preset)[0]:
                dispatch(SetPreset(name))
            ui.mark(f"plan.preset.{name}")
        imgui.end_combo()
    ui.mark("plan.preset")
    for setting in plan.settings:
        imgui.set_next_item_width(FIELD_WIDTH)
        flags = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all
        is_entered, typed = imgui.input_text(f"{setting.label}##{setting.name}", format_count(setting.value), flags)
        imgui.set_item_tooltip(setting.help_text)
        ui.mark(f"plan.{setting.name}")
        value = parsed_count(typed) if is_entered else None
        if value is not None and value != setting.value:
            dispatch(SetTrainSetting(setting.name, value))
        if setting.is_set:
            imgui.same_line()
            imgui.text_disabled("set")


def _draw_lines(plan: PlanStatus) -> None:
    flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg
    if not plan.lines or not imgui.begin_table("plan", 2, flags, ImVec2(0, LINES_HEIGHT)):
        return
    imgui.table_setup_column("name", imgui.TableColumnFlags_.width_stretch)
    imgui.table_setup_column("value")
    for name, text in plan.lines:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text(name)
        imgui.table_next_column()
        imgui.text(text)
    imgui.end_table()
