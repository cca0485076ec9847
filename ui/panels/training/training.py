"""The training panel: the running clip, its speed and quality, the waiting clips, and buttons for training."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.psnr_words import psnr_label, psnr_note
from app.session.session_view import SessionView
from app.session.showing.look_commands import SetFrame
from app.session.training.train_commands import PauseTraining, ResumeTraining, StopTraining, TrainNextClip
from app.status import ClipStatus, TrainingStatus
from engine.capture.clip import Clip
from engine.text import duration_text
from ui.panels.clips.section import draw_clip_section, draw_stale
from ui.panels.pieces.widgets import primary_button, text_right, text_wrapped, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.panels.timeline.clip_words import is_imported, state_note, state_words
from ui.panels.training.clip_quality import draw_clip_quality
from ui.panels.training.clip_training_menu import draw_clip_training
from ui.panels.training.curves import draw_curves
from ui.panels.training.plan import draw_plan
from ui.panels.training.queue import draw_live_view, draw_queue, draw_train_all, draw_usage
from ui.panels.training.running import draw_running, is_listed
from ui.panels.training.workers import draw_workers
from ui.style import theme
from ui.style.numbers import format_count
from ui.style.progress_words import stage_words
from ui.style.theme import Icon

LEAST_TABLE = 120.0
"""Height of the table of clips at least, units."""
ANCHORS_TOOLTIP = """All anchors of a clip, whatever frames they are alive in.
Reference clip: reference anchors, which later clips inherit.
Later clips: inherited + residual anchors."""


def draw_training(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """Buttons, progress, queue, curves, quality over the clips, then one row per clip."""
    if session.capture is None:
        text_wrapped_dim("Training starts here once a capture is open.")
        return
    status = session.training
    _draw_buttons(session, dispatch, ui)
    if is_listed(session):
        draw_running(session, dispatch, ui)
    elif status.is_going:
        _draw_progress(status, ui)
        draw_usage(session.usage, ui)
    if status.is_anywhere:
        draw_live_view(session, dispatch, ui)
    draw_workers(session, dispatch, ui)
    draw_train_all(session, dispatch, ui)
    draw_stale(session, dispatch, ui)
    draw_queue(session, dispatch, ui)
    imgui.set_next_item_open(True, imgui.Cond_.once)
    is_open = imgui.collapsing_header("Curves")
    ui.mark("curves.header")
    if is_open and is_imported(session):
        text_wrapped_dim("This scene was imported; it has no training curves.")
    elif is_open:
        draw_curves(session, ui)
    draw_clip_quality(session.clip_states, ui)
    draw_clip_section(session, dispatch, ui)
    imgui.spacing()
    _draw_clips(session, dispatch, ui)


def next_label(session: SessionView) -> str:
    """Label for starting the next clip, with its icon: a clip that was stopped resumes where that was."""
    index, step = session.training.next_clip_index, session.training.resume_step
    if index is None:
        is_all = all(state.state == "trained" for state in session.clip_states)
        if is_imported(session):
            return f"{Icon.CHECK}  Imported from another program"
        return f"{Icon.CHECK}  Every clip is trained" if is_all else f"{Icon.WARNING}  No clip can be trained next"
    if session.queue.is_held:
        return f"{Icon.PLAY}  Resume with clip {index}"
    if step is not None:
        return f"{Icon.PLAY}  Resume clip {index} at step {format_count(step)}"
    return f"{Icon.TRAIN}  Train next clip"


def _draw_buttons(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    status = session.training
    width = imgui.get_content_region_avail().x
    if not status.is_going:
        index = status.next_clip_index
        is_offered = bool(status.can_train_next) and index is not None
        if index is None:
            text_wrapped(next_label(session))
            ui.mark("training.next")
        else:
            imgui.begin_disabled(not is_offered)
            if primary_button(next_label(session), ImVec2(width, 36), ui):
                dispatch(TrainNextClip())
            ui.mark("training.next")
            imgui.end_disabled()
            imgui.set_item_tooltip("T")
        if index is not None and index < len(session.clips):
            clip = session.clips[index]
            kind = (
                "the reference that the others start from"
                if index == session.reference_index
                else "it starts from the reference"
            )
            if status.resume_step is not None:
                kind = f"stopped at step {format_count(status.resume_step)}"
            text_wrapped_dim(f"Next: clip {index}, frames {clip.start} to {clip.stop - 1}, {kind}.")
        if session.plan is not None:
            draw_plan(session.plan, dispatch, ui)
        return
    half = (width - 8) / 2
    of_all = " all" if status.n_running > 1 else ""
    if status.is_paused:
        if primary_button(f"{Icon.PLAY}  Resume{of_all}", ImVec2(half, 36), ui):
            dispatch(ResumeTraining())
        ui.mark("training.resume")
    else:
        imgui.begin_disabled(status.is_stopping or (status.state == "starting" and not of_all))
        if imgui.button(f"{Icon.PAUSE}  Pause{of_all}", ImVec2(half, 36)):
            dispatch(PauseTraining())
        ui.mark("training.pause")
        imgui.end_disabled()
    imgui.same_line()
    imgui.begin_disabled(status.is_stopping)
    if imgui.button(f"{Icon.STOP}  Stop{of_all}", ImVec2(half, 36)):
        dispatch(StopTraining())
    ui.mark("training.stop")
    imgui.end_disabled()
    imgui.set_item_tooltip(f"Stops {'all clips that train here' if of_all else 'this clip'} now; progress is kept")


def _draw_progress(status: TrainingStatus, ui: UiState) -> None:
    is_stepping = status.n_steps > 0 and status.state in ("running", "paused", "stopping")
    share = status.step / status.n_steps if is_stepping else float(getattr(status, "progress", 0.0) or 0.0)
    words = {"starting": "Starting", "preparing": "Preparing", "running": "Training"}
    words |= {"paused": "Paused", "stopping": "Stopping"}
    imgui.spacing()
    imgui.text(f"{words[status.state]} clip {status.clip_index}")
    if status.stage:
        text_wrapped_dim(stage_words(status))
    bar_color = theme.YELLOW if status.state == "paused" else theme.SKY
    imgui.push_style_color(imgui.Col_.plot_histogram, ImVec4(*bar_color))
    imgui.progress_bar(min(max(share, 0.0), 1.0), ImVec2(-1, 8), "")
    imgui.pop_style_color()
    ui.mark("training.progress")
    if is_stepping:
        _pair(f"Step {format_count(status.step)} of {format_count(status.n_steps)}", f"{share * 100:.0f} %")
        rate = f"{status.steps_per_s:.1f} steps/s" if status.steps_per_s else "–"
        _pair(rate, f"{duration_text(status.eta_s)} left")
    else:
        left = "" if status.eta_s is None else f"about {duration_text(status.eta_s)} left"
        _pair(left, f"{share * 100:.0f} % of this stage" if share > 0 else "")
    if status.message:
        text_wrapped_dim(str(status.message))


def _pair(left: str, right: str) -> None:
    imgui.text(left)
    text_right(right)


def anchors_text(n_inherited: int, n_own: int) -> str:
    """Anchors of a clip: of the reference clip a number, of a later one a sum; a dash where there are none yet."""
    if not n_inherited and not n_own:
        return "–"
    return f"{format_count(n_inherited)} + {format_count(n_own)}" if n_inherited else format_count(n_own)


def clip_note(status: ClipStatus) -> str:
    """Pictures behind the PSNR of a clip, and the change of its exposure."""
    change = status.exposure_change
    lines = ["Not measured" if status.held_out_psnr is None else psnr_note(is_whole=status.held_out_whole)]
    lines += [f"Exposure {100.0 * change:.1f} % from the reference clip's, removed"] if change else []
    return "\n".join(lines)


def _draw_clips(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.borders_inner_h | imgui.TableFlags_.scroll_y
    flags |= imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.pad_outer_x
    if not imgui.begin_table("clips", 3, flags, ImVec2(0, max(imgui.get_content_region_avail().y - 4, LEAST_TABLE))):
        return
    imgui.table_setup_scroll_freeze(0, 1)
    imgui.table_setup_column("Clip", imgui.TableColumnFlags_.width_stretch)
    imgui.table_setup_column("PSNR")
    imgui.table_setup_column("Anchors")
    imgui.table_headers_row()
    imgui.set_item_tooltip(ANCHORS_TOOLTIP)
    clipper = imgui.ListClipper()
    clipper.begin(min(len(session.clips), len(session.clip_states)))
    while clipper.step():
        for index in range(clipper.display_start, clipper.display_end):
            _draw_clip_row(session, session.clips[index], session.clip_states[index], dispatch, ui)
    clipper.end()
    imgui.end_table()


def _draw_clip_row(session: SessionView, clip: Clip, status: ClipStatus, dispatch: Dispatch, ui: UiState) -> None:
    imgui.table_next_row()
    imgui.table_next_column()
    imgui.push_id(clip.clip_index)
    flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_overlap
    if imgui.selectable("##row", False, flags)[0]:
        dispatch(SetFrame(clip.start))
    imgui.open_popup_on_item_click("row menu", imgui.PopupFlags_.mouse_button_right)
    if imgui.begin_popup("row menu"):
        imgui.text_disabled(f"Clip {clip.clip_index}")
        imgui.separator()
        draw_clip_training(session, dispatch, ui, clip.clip_index)
        imgui.end_popup()
    imgui.pop_id()
    imgui.same_line(0, 0)
    icon = theme.CLIP_ICONS.get(status.state, "")
    words = state_words(status.state, session)
    imgui.text(f"{clip.clip_index}")
    ui.mark(f"training.clip{clip.clip_index}")
    imgui.same_line(26 + 8 * (clip.clip_index > 99))
    imgui.text_colored(ImVec4(*theme.status_color(status.state)), f"{icon}  {words}" if icon else words)
    note = state_note(status)
    if note:
        imgui.set_item_tooltip(note)
    imgui.table_next_column()
    psnr = status.held_out_psnr
    imgui.text("–" if psnr is None else psnr_label(psnr, is_whole=status.held_out_whole))
    imgui.set_item_tooltip(clip_note(status))
    imgui.table_next_column()
    imgui.text(anchors_text(status.n_inherited, status.n_own))
    imgui.set_item_tooltip(ANCHORS_TOOLTIP)
