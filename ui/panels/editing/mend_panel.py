"""The window of mending: the seam to mend, the progress, and the outcome, with figures before and after.

It lies over the picture and takes nothing away from it: one can play around the seam, look at the heat map and compare
while it is up.
"""

from __future__ import annotations

import time

from imgui_bundle import ImVec2, ImVec4, imgui

from app.project.mends.record import MendRecord
from app.psnr_words import psnr_note
from app.session.mending.mend_commands import CloseMend, CompareMended, RevertMend, StartMend, StopMend
from app.session.mending.mend_page import MendPage
from app.session.session_view import SessionView
from app.session.training.train_commands import TrainClip
from app.status import JobStatus
from engine.mending.figures import METHODS, StretchFigures
from engine.text import duration_text
from ui.panels.pieces.copying import draw_copy_entries
from ui.panels.pieces.widgets import draw_job_bar, primary_button, text_warning, text_wrapped, text_wrapped_dim
from ui.panels.state import Dispatch, Rect, UiState
from ui.style import theme
from ui.style.progress_words import job_words
from ui.style.theme import Icon

TITLE = "Mend###mend"
WIDTH = 372.0
MARGIN = 12.0
BELOW_HINT = 72.0
"""Below two lines about a tool in use."""
HELD_OUT = "Held-out PSNR"
METHOD_WORDS = {
    "auto": "Automatic",
    "light": "Exposure and light",
    "fade": "Fade",
    "joint": "Joint training",
}
AUTO_HINT = "Tries each method, cheapest first, until half of the excess flicker is gone"


def is_asking_to_mend(session: SessionView) -> bool:
    """Whether the window asks how to mend: then Escape closes it."""
    page = session.mending.page
    return page is not None and page.state == "asking"


def draw_mending(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Draw the window while something is mended."""
    page = session.mending.page
    if page is None:
        return
    view = imgui.get_main_viewport()
    whole = Rect(0.0, 0.0, view.size.x, view.size.y)
    free = ui.rects.get("viewport.free", whole)
    imgui.set_next_window_pos(ImVec2(free.x0 + MARGIN, free.y0 + BELOW_HINT), imgui.Cond_.appearing)
    imgui.set_next_window_size_constraints(ImVec2(WIDTH, 0), ImVec2(WIDTH, max(view.size.y - 40, 200)))
    flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.always_auto_resize
    flags |= imgui.WindowFlags_.no_collapse | imgui.WindowFlags_.no_docking
    is_visible, is_kept = imgui.begin(TITLE, True, flags)
    ui.mark_rect("mend", _window_rect())
    if is_visible:
        _draw_page(session, page, dispatch, ui)
    imgui.end()
    if not is_kept:
        dispatch(CloseMend())


def _window_rect() -> Rect:
    low, size = imgui.get_window_pos(), imgui.get_window_size()
    return Rect(low.x, low.y, low.x + size.x, low.y + size.y)


def _draw_page(session: SessionView, page: MendPage, dispatch: Dispatch, ui: UiState) -> None:
    clips = " and ".join(str(index) for index in page.clip_indices)
    text_wrapped(
        f"{page.words[0].upper()}{page.words[1:]}, {'clip' if len(page.clip_indices) == 1 else 'clips'} {clips}"
    )
    if page.failure:
        text_warning(f"{page.failure} {page.hint}".strip())
    if page.state == "running":
        _draw_progress(session.mending.progress, dispatch, ui)
    elif page.record is None:
        _draw_choice(session, page, dispatch, ui)
    else:
        _draw_result(page, page.record, dispatch, ui)


def _draw_choice(session: SessionView, page: MendPage, dispatch: Dispatch, ui: UiState) -> None:
    if page.why_not:
        text_warning(page.why_not)
    else:
        text_wrapped_dim(
            "Each attempt is measured on the training cameras, and kept only if the flicker falls and no clip loses "
            "more than 0.05 dB. The present clips are kept as versions."
        )
        if page.estimate_s is not None:
            text_wrapped_dim(f"About {duration_text(page.estimate_s)}, or less if little is needed")
    imgui.begin_disabled(bool(page.why_not))
    for method in ("auto", *METHODS):
        if method == "auto":
            is_clicked = primary_button(f"{Icon.PLAY}  Mend", ImVec2(-1, 30), ui)
        else:
            is_clicked = imgui.button(f"{METHOD_WORDS[method]} only", ImVec2(-1, 0))
        ui.mark(f"mend.{method}")
        if imgui.begin_popup_context_item(f"copy {method}"):
            draw_copy_entries(ui, "mend", lambda method=method: session.command_texts.mend(page.request, method))
            imgui.end_popup()
        imgui.set_item_tooltip(AUTO_HINT if method == "auto" else f"Only this: {METHODS[method]}")
        if is_clicked:
            dispatch(StartMend(method))
    imgui.end_disabled()


def _draw_progress(progress: JobStatus | None, dispatch: Dispatch, ui: UiState) -> None:
    text_wrapped(job_words(progress, time.monotonic()))
    draw_job_bar(progress, ui, -1.0, 12.0)
    if imgui.button("Stop", ImVec2(-1, 0)):
        dispatch(StopMend())
    ui.mark("mend.stop")


def _draw_result(page: MendPage, record: MendRecord, dispatch: Dispatch, ui: UiState) -> None:
    if page.compared is not None:  # out of the way of what is compared
        _draw_buttons(page, record, dispatch, ui)
        return
    if page.state == "reverted":
        _line(Icon.UNDO, theme.SKY, "Reverted: the clips are as before.")
    elif record.has_helped:
        fall = _fall(record.before.excess, record.after.excess)
        _line(Icon.CHECK, theme.GREEN, f"Mended{fall}, in {duration_text(record.seconds)}")
    else:
        _line(Icon.INFO, theme.SKY, "Nothing helped; the clips are unchanged.")
    text_wrapped_dim(record.diagnosis)
    _draw_figures(record)
    _draw_attempts(record)
    if record.advice and page.state != "reverted":
        text_warning(record.advice)
        worst = min(record.before.psnr, key=lambda index: record.before.psnr[index], default=None)
        if worst is not None:
            if imgui.button(f"{Icon.TRAIN}  Retrain clip {worst}", ImVec2(-1, 0)):
                dispatch(TrainClip(int(worst)))
            ui.mark("mend.retrain")
    imgui.spacing()
    _draw_buttons(page, record, dispatch, ui)


def _draw_buttons(page: MendPage, record: MendRecord, dispatch: Dispatch, ui: UiState) -> None:
    width = (imgui.get_content_region_avail().x - 2 * imgui.get_style().item_spacing.x) / 3
    if page.state == "done" and record.has_helped:
        label = "Only now" if page.compared is not None else "A/B: before"
        if imgui.button(label, ImVec2(width, 30)):
            dispatch(CompareMended())
        ui.mark("mend.compare")
        imgui.set_item_tooltip("Compares the clip before and after; G switches to wipe or blink")
        imgui.same_line()
        if imgui.button("Revert", ImVec2(width, 30)):
            dispatch(RevertMend())
        ui.mark("mend.revert")
        imgui.same_line()
        is_closed = primary_button("Keep", ImVec2(width, 30), ui)
    else:
        is_closed = imgui.button("Close", ImVec2(-1, 30))
    ui.mark("mend.keep")
    if is_closed:
        dispatch(CloseMend())


def _line(icon: str, color: tuple[float, float, float, float], words: str) -> None:
    imgui.text_colored(ImVec4(*color), icon)
    imgui.same_line()
    text_wrapped(words)


def _fall(before: float | None, after: float | None) -> str:
    if before is None or after is None or before <= 0.0:
        return ""
    return f": {100 * (1 - after / before):.0f} % less excess flicker"


def _draw_figures(record: MendRecord) -> None:
    rows: list[tuple[str, str, str]] = [
        ("Excess flicker, 1/255", _figure(record.before.excess), _figure(record.after.excess)),
        *_psnr_rows("PSNR", record.before.psnr, record.after.psnr),
    ]
    if record.before.held_out_excess is not None:
        held_out = record.before.held_out_excess, record.after.held_out_excess
        rows.append(("Held out: flicker", _figure(held_out[0]), _figure(held_out[1])))
        rows += _psnr_rows(HELD_OUT, record.before.held_out_psnr, record.after.held_out_psnr)
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.sizing_stretch_prop
    if not imgui.begin_table("figures", 3, flags):
        return
    for title, weight in (("", 2.2), ("Before", 1.0), ("After", 1.0)):
        imgui.table_setup_column(title, imgui.TableColumnFlags_.width_stretch, weight)
    imgui.table_headers_row()
    for row in rows:
        imgui.table_next_row()
        for cell in row:
            imgui.table_next_column()
            imgui.text(cell)
            if row[0].startswith(HELD_OUT):
                imgui.set_item_tooltip(psnr_note(is_whole=True))
    imgui.end_table()


def _psnr_rows(words: str, before: dict[str, float], after: dict[str, float]) -> list[tuple[str, str, str]]:
    return [(f"{words}, clip {i}, dB", f"{before[i]:.2f}", f"{after[i]:.2f}" if i in after else "-") for i in before]


def _draw_attempts(record: MendRecord) -> None:
    for attempt in record.attempts:
        kept = "kept" if attempt.is_kept else "not kept"
        text_wrapped_dim(f"{attempt.words}: {_excess_text(attempt.figures)}, {kept}")


def _excess_text(figures: StretchFigures) -> str:
    return f"{_figure(figures.excess)}/255"


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
