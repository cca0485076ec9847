"""How many clips train at once, and where: on this computer, or on the computers of a cluster."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.session.session_view import SessionView
from app.session.training.train_commands import JoinCluster, LeaveCluster
from ui.panels.pieces.widgets import elided, text_wrapped_dim
from ui.panels.state import Dispatch, UiState

WORKERS_WIDTH = 104.0
ADDRESS_WIDTH = 300.0
POPUP = "cluster"
ADDRESSES = (
    '"auto" joins the Ray cluster that runs on this computer, HOST:PORT the one at that address, which this computer '
    "has to be part of; local:N starts one here for N clips side by side. See docs/cluster.md."
)


def draw_workers(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """How many clips train at once; nothing where there is no choice."""
    if len(session.clips) < 3:  # the reference trains alone
        return
    address, can_join = session.joining.address, session.joining.can_join
    if address:
        imgui.align_text_to_frame_padding()
        imgui.text(
            elided(f"On {address}, {session.training.n_workers} at once", imgui.get_content_region_avail().x - 80)
        )
        imgui.same_line()
        if imgui.small_button("Leave"):
            dispatch(LeaveCluster())
        ui.mark("training.leave")
        imgui.set_item_tooltip("Train clips on this computer again")
        return
    if session.usage.n_cores > 1:
        _draw_number(session.usage.n_cores, ui)
        imgui.same_line()
    if can_join:
        if imgui.button("Cluster ..."):
            imgui.open_popup(POPUP)
        ui.mark("training.cluster")
        imgui.set_item_tooltip("Train clips on other computers")
        _draw_joining(dispatch, ui)
    else:
        imgui.new_line()
    if session.training.why_fewer:
        text_wrapped_dim(session.training.why_fewer)
        ui.mark("training.why_fewer")


def _draw_number(n_cores: int, ui: UiState) -> None:
    preferences = ui.preferences
    imgui.align_text_to_frame_padding()
    imgui.text("Clips at once")
    imgui.same_line()
    imgui.set_next_item_width(WORKERS_WIDTH)
    imgui.push_item_flag(imgui.ItemFlags_.no_tab_stop, True)  # Tab shows and hides marks; it must not land here
    is_changed, n = imgui.input_int("##workers", min(preferences.n_workers, n_cores), 1, 4)
    imgui.pop_item_flag()
    ui.mark("training.workers")
    imgui.set_item_tooltip("How many clips train side by side on this computer, as cores and memory allow")
    if is_changed:
        preferences.n_workers = min(max(n, 1), n_cores)


def _draw_joining(dispatch: Dispatch, ui: UiState) -> None:
    """The popup that asks for an address."""
    if not imgui.begin_popup(POPUP):
        return
    if imgui.is_window_appearing():
        imgui.set_keyboard_focus_here()
    imgui.push_item_width(ADDRESS_WIDTH)
    flags = imgui.InputTextFlags_.enter_returns_true
    is_entered, typed = imgui.input_text_with_hint("##address", "auto, HOST:PORT or local:N", ui.cluster_address, flags)
    imgui.pop_item_width()
    ui.mark("cluster.address")
    ui.cluster_address = typed.strip()
    imgui.begin_child("notes", ImVec2(ADDRESS_WIDTH, 64))
    text_wrapped_dim(ADDRESSES)
    imgui.end_child()
    imgui.begin_disabled(not ui.cluster_address)
    is_clicked = imgui.button("Join")
    ui.mark("cluster.join")
    imgui.end_disabled()
    if (is_entered or is_clicked) and ui.cluster_address:
        dispatch(JoinCluster(ui.cluster_address))
        imgui.close_current_popup()
    imgui.end_popup()
