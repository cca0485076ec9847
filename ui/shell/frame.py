"""One UI frame in fixed order; a part that fails costs a notice, not the window (ui.panels.guard).

Order: drain the session, tick time, decide whether anything changed, draw menus, panels, popups, toasts, then ImGui.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import moderngl
from imgui_bundle import ImVec2, ImVec4, imgui
from pyglet.window import BaseWindow

from app.session.commands import Command
from app.session.projects.preferences import Preferences, PreferencesFile
from app.session.projects.project_commands import OpenCapture, SetProjectsFolder
from app.session.projects.window_memory import WindowMemory
from app.session.session_view import WindowSession
from app.session.showing.look_commands import SetFrameMemory
from app.session.training.train_commands import SetWorkers
from engine.importing.suffixes import is_scene_file
from ui.gl import ImageTexture, free_dropped, n_changes
from ui.panels.actions.key_map import KeyMap
from ui.panels.actions.table import ACTIONS, handle_keys
from ui.panels.camera_path import draw_paths
from ui.panels.capture import CapturePanel
from ui.panels.doctor.panel import DoctorPanel
from ui.panels.editing.history_panel import HistoryPanel
from ui.panels.editing.mend_panel import draw_mending
from ui.panels.editing.panel.edit_panel import draw_edit
from ui.panels.exports import draw_exports
from ui.panels.guard import Guard, draw_failed
from ui.panels.log import LogPanel
from ui.panels.notices import NoticesPanel
from ui.panels.panel_keys import step_panel
from ui.panels.picture.heat_overlay import HeatOverlay
from ui.panels.picture.picture_pane import PicturePane
from ui.panels.picture.viewport import ViewportPanel
from ui.panels.residuals.panel import ResidualsPanel
from ui.panels.state import (
    CAPTURE,
    DOCTOR,
    DRAWER,
    EDIT,
    EXPORTS,
    HISTORY,
    LAYOUTS,
    LOG,
    PATHS,
    RESIDUALS,
    TIMELINE,
    TRAINING,
    VIEWPORT,
    Dispatch,
    Rect,
    UiState,
)
from ui.panels.timeline.panel import draw_timeline
from ui.panels.training.training import draw_training
from ui.panels.welcome.recent_rows import RecentRows
from ui.shell.dialogs.about import AboutDialog
from ui.shell.dialogs.calibration_dialog import CalibrationDialog
from ui.shell.dialogs.dialogs import OpenFolderDialog
from ui.shell.dialogs.export_dialog import ExportDialog
from ui.shell.dialogs.opening.opening_dialog import OpeningDialog
from ui.shell.dialogs.questions import QuestionDialogs
from ui.shell.dialogs.synchronisation_dialog import SynchronisationDialog
from ui.shell.finding.help_sheet import HelpSheet
from ui.shell.finding.palette import ActionPalette
from ui.shell.imgui_backend import ImGuiBackend
from ui.shell.layout.layout import hold_sizes, is_laid_out, lay_out
from ui.shell.layout.layouts import Layouts
from ui.shell.layout.remembering import Remembering
from ui.shell.menu_bar import draw_menu_bar
from ui.shell.preferences import PreferencesDialog
from ui.shell.redraw import FRAMES_AFTER_INPUT, RedrawPlan
from ui.shell.status_bar import HEIGHT as STATUS_BAR_HEIGHT
from ui.shell.status_bar import draw_status_bar
from ui.style import theme
from ui.style.fonts import load_fonts
from ui.style.theme_in_use import ThemeInUse
from ui.style.ui_scale import UiScale
from ui.viewport.scene import ViewportScene

FIRST_FRAMES = 6
"""A new layout: docked panels get their tabs, then their sizes, then they lose scrollbars that are not needed."""
FRAMES_TO_DOCK = 2
"""Until all panels of a kept layout have their tabs; the one that got its tab last is in front."""
TAB_PADDING_SHARE = 0.6
"""Room of tabs around their words, as a share of that of other things: side by side, all of a side panel are seen."""
TRAINING_REFRESH_S = 0.2
"""Often enough for numbers that nobody waits for; each frame is taken from the training where the CPU draws."""
ATTENDED_S = 0.5
"""For this long after an input, every picture that arrives is shown at once."""
MAX_TICK_S = 0.25
NOTHING = ImVec4(0, 0, 0, 0)


class Frame:
    """Draws the whole window; owns panels and the redraw plan.

    Args:
        window: pyglet window whose GL context is current.
        ctx: moderngl context adopted from it.
        session: The program's state; see app.session.session.Session.
        fixed_delta_s: Seconds per frame as reported to ImGui; tests fix it.
        on_input: Called after each input that wants a frame, so that it need not wait for the next tick.
        memory: The window's earlier appearance; None starts afresh and keeps nothing.
        scale: How large everything is drawn.
        preferences: The user's preferences; None takes the defaults and keeps nothing.
    """

    def __init__(
        self,
        window: BaseWindow,
        ctx: moderngl.Context,
        session: WindowSession,
        *,
        fixed_delta_s: float | None = None,
        on_input: Callable[[], None] = lambda: None,
        memory: WindowMemory | None = None,
        scale: UiScale | None = None,
        preferences: PreferencesFile | None = None,
    ) -> None:
        self._window = window
        self._ctx = ctx
        self.session = session
        self.scale = scale or UiScale()
        self.backend = ImGuiBackend(window, on_input=self._input_came, fixed_delta_s=fixed_delta_s, scale=self.scale)
        self._on_input = on_input
        values = Preferences() if preferences is None else preferences.values
        keys = KeyMap(values.keys)
        keys.drop_unknown(ACTIONS)
        self.ui = UiState(fonts=load_fonts(), scale=self.scale, preferences=values, keys=keys)
        self._cache_mb: int | None = None
        self._projects_dir, self._n_workers = "", 1
        self._follow_preferences()  # before a capture is opened
        self._theme = ThemeInUse()
        self._theme.follow(values.theme)
        rows = RecentRows(lambda: ImageTexture(ctx))
        self.guard = Guard(lambda: session.notices, self.request_redraw)
        self.viewport = ViewportPanel(lambda: PicturePane(ViewportScene(ctx), HeatOverlay(ctx)), rows, self.guard)
        self.capture = CapturePanel(lambda: ImageTexture(ctx))
        self.residuals = ResidualsPanel(lambda: ImageTexture(ctx))
        self.doctor = DoctorPanel(lambda: ImageTexture(ctx))
        self.notices = NoticesPanel()
        self.log = LogPanel()
        self.dialog = OpenFolderDialog()
        self.questions = QuestionDialogs()
        self.calibration = CalibrationDialog()
        self.synchronisation = SynchronisationDialog()
        self.export = ExportDialog()
        self.opening = OpeningDialog(lambda: ImageTexture(ctx))
        self.palette = ActionPalette()
        self.help_sheet = HelpSheet()
        self.preferences = PreferencesDialog()
        self.layouts = Layouts()
        self.about = AboutDialog()
        self._redraw = RedrawPlan()
        self._redraw.request(FIRST_FRAMES)
        self._shown: tuple[int, int] | None = None
        self._drawn_s = -1e9
        self._input_s = -1e9
        self._has_news = False
        self.remembering = Remembering(memory, self.ui, preferences)
        self.remembering.restore_layout()
        self.remembering.restore_marks(session)
        self._floating_panels: set[str] = set()
        self._in_front: list[str] = []
        self._dock_ids: dict[str, int] = {}
        self._alone = imgui.WindowClass()
        node_flags = imgui.internal.DockNodeFlagsPrivate_
        self._alone.dock_node_flags_override_set = node_flags.no_tab_bar | node_flags.no_docking_over_me
        self._is_welcome = self._is_picture_only = False
        self._visible_panels: set[str] = set()
        self._shown_before: set[str] = set()
        self._panels: tuple[tuple[str, Callable[[WindowSession, Dispatch, UiState], None], bool], ...] = (
            (CAPTURE, self.capture.draw, True),
            (TRAINING, draw_training, True),
            (EDIT, draw_edit, True),
            (RESIDUALS, self.residuals.draw, True),
            (PATHS, draw_paths, True),
            (TIMELINE, draw_timeline, True),
            (LOG, self.log.draw, True),
            (DOCTOR, self.doctor.draw, True),
            (EXPORTS, draw_exports, True),
            (HISTORY, HistoryPanel().draw, True),
            (VIEWPORT, self.viewport.draw, False),  # last: it shows what the others have just changed
        )

    # ---- the redraw plan -------------------------------------------------------------------------------------

    def request_redraw(self, frames: int = FRAMES_AFTER_INPUT) -> None:
        """Draw at least this many frames from now on: the user did something."""
        self._input_s = time.perf_counter()
        self._redraw.request(frames)

    def forget_shown(self) -> None:
        """The last drawing is no longer on the screen, as after a resize; draw it again even if it is the same."""
        self._shown = None
        self.request_redraw()

    def _input_came(self) -> None:
        self.request_redraw()
        self._on_input()

    def _follow_preferences(self) -> None:
        preferences = self.ui.preferences
        if self._cache_mb != preferences.cache_mb:
            self._cache_mb = preferences.cache_mb
            self.session.dispatch(SetFrameMemory(self._cache_mb))
        if self._n_workers != preferences.n_workers:
            self._n_workers = preferences.n_workers
            self.session.dispatch(SetWorkers(self._n_workers))
        if self._projects_dir != preferences.projects_dir:
            self._projects_dir = preferences.projects_dir
            self.session.dispatch(SetProjectsFolder(self._projects_dir))

    def update(self, dt_s: float) -> bool:
        """Drain the session and move time on. True when a frame has to be drawn."""
        self._has_news |= self._drain() | self._move_on(dt_s)
        if not self._redraw.is_due and (self.backend.needs_follow_up or self._is_news_due()):
            self._redraw.request(1)
        return self._redraw.is_due

    def _drain(self) -> bool:
        """Let the session take in finished work; a fault there becomes a notice and never ends the loop."""
        with self.guard.telling("the session", "A finished result could not be used"):
            return self.session.poll()
        return True

    def _move_on(self, dt_s: float) -> bool:
        """Follow the user's choices, move time on, and ask for pictures; a fault there is reported as well."""
        session = self.session
        with self.guard.telling("the loop", "An error occurred between two frames"):
            if self._theme.follow(self.ui.preferences.theme):
                self.forget_shown()
            self._follow_preferences()
            self.remembering.follow(session)
            is_shown = session.loading is None and self.viewport.shows_playhead(session)
            has_news = session.timeline.tick(min(dt_s, MAX_TICK_S), is_shown=is_shown)
            has_news |= session.lead_view()
            return has_news | self.viewport.has_news(session)
        return True

    def _is_news_due(self) -> bool:
        """Is it time to show what came without input?"""
        session = self.session
        since_s = time.perf_counter() - self._drawn_s
        if self.ui.redraw_in_s is not None and since_s >= self.ui.redraw_in_s:
            return True
        # Drawing takes cores that the training needs too: news wait a little unless the user is looking for them.
        is_attended = session.timeline.is_playing or time.perf_counter() - self._input_s < ATTENDED_S
        is_busy = session.training.state not in ("idle", "failed", "paused") or bool(session.jobs)
        if self._has_news and (is_attended or not is_busy):
            return True
        return (self._has_news or is_busy) and since_s >= TRAINING_REFRESH_S

    # ---- one frame -------------------------------------------------------------------------------------------

    def draw(self) -> bool:
        """Draw one frame into the window's framebuffer. False when it already holds just that."""
        self._has_news = False
        self.ui.redraw_in_s = None
        self.ui.rects.clear()
        if self.layouts.take_kept(self.ui):
            self._redraw.request(FIRST_FRAMES)
        self.backend.is_panel_keyed = self._is_panel_keyed()
        self.backend.new_frame()
        self.ui.is_popup_open = self.backend.is_popup_open
        self.ui.is_menu_wanted |= self.backend.take_alt_tap() and not self.ui.is_popup_open
        self.guard.draw("the window", self._compose)
        drawn = (self.backend.end_frame(), n_changes())
        is_new, self._shown = drawn != self._shown, drawn
        self._redraw.note_drawn(drawn[0], has_more_input=self.backend.needs_follow_up)
        if is_new:
            self._ctx.screen.use()
            self._ctx.viewport = (0, 0, *self._window.get_framebuffer_size())
            self._ctx.clear(*theme.PANEL)
            self.backend.present()
        free_dropped(self._ctx)
        self._drawn_s = time.perf_counter()
        return is_new

    def _compose(self) -> None:
        session, ui, dispatch = self.session, self.ui, self.dispatch
        self.guard.draw("the keys", lambda: handle_keys(session, dispatch, ui))
        self.guard.draw("the menus", lambda: draw_menu_bar(session, dispatch, ui))
        is_software = self.viewport.scene.is_software
        self.guard.draw("the status bar", lambda: draw_status_bar(session, self.dispatch, ui, is_software=is_software))
        imgui.push_style_color(imgui.Col_.window_bg, NOTHING)  # the frame is cleared to the panels' colour
        imgui.push_style_var_x(imgui.StyleVar_.frame_padding, imgui.get_style().frame_padding.x * TAB_PADDING_SHARE)
        dock_id = imgui.dock_space_over_viewport(0, imgui.get_main_viewport(), imgui.DockNodeFlags_.none)
        imgui.pop_style_var()
        imgui.pop_style_color()
        layout = LAYOUTS[0] if ui.is_layout_reset_requested else self.layouts.take_own(ui)
        if layout is not None or not (ui.is_picture_only or is_laid_out(dock_id)):
            ui.is_layout_reset_requested = ui.is_picture_only = False
            self._in_front = [TRAINING]  # of those that lie over each other; one in each frame
            lay_out(dock_id, layout or LAYOUTS[0])
            self._redraw.request(FIRST_FRAMES)
        elif ui.is_picture_only != self._is_picture_only:
            self._is_picture_only = ui.is_picture_only
            if ui.is_picture_only:
                self._shown_before = self._visible_panels.copy()
            else:  # panels that lie over each other come back in the order that they had
                self._in_front = [title for title, *_ in self._panels if title in self._shown_before]
        elif self._in_front and ui.wanted_panel is None and imgui.get_frame_count() > FRAMES_TO_DOCK:
            ui.wanted_panel = self._in_front.pop()
        elif (is_welcome := session.capture is None) != self._is_welcome and not self._in_front:
            self._is_welcome = is_welcome
            ui.wanted_panel = VIEWPORT if is_welcome else ui.wanted_panel  # its list is moved in by arrow keys
        step_panel(ui, self._visible_panels)
        self._dock_ids.clear()
        for title, draw_panel, has_padding in self._panels:
            if title == VIEWPORT or not ui.is_picture_only:
                self._draw_panel(title, draw_panel, has_padding)
        hold_sizes(self._dock_ids)
        self.dialog.open_wished(ui)
        self.guard.draw("the dialog for folders", lambda: self.dialog.draw(dispatch, ui))
        self.guard.draw("the help sheet", lambda: self.help_sheet.draw(ui))
        self.guard.draw("the dialog about the program", lambda: self.about.draw(ui))
        self.guard.draw("the layouts", lambda: self.layouts.draw(ui))
        self.guard.draw("the preferences", lambda: self.preferences.draw(ui))
        self.guard.draw("the palette", lambda: self.palette.draw(session, dispatch, ui))
        self.guard.draw("the dialog that opens captures", lambda: self.opening.draw(session, dispatch, ui))
        self.guard.draw("the synchronisation", lambda: self.synchronisation.draw(session, dispatch, ui))
        self.guard.draw("the calibration", lambda: self.calibration.draw(session, dispatch, ui))
        self.guard.draw("the export dialog", lambda: self.export.draw(session, dispatch, ui))
        self.guard.draw("the dialog that mends", lambda: draw_mending(session, dispatch, ui))
        if not self.guard.draw("the question", lambda: self.questions.draw(session, dispatch, ui)):
            self.questions.leave(session, dispatch)
        size = imgui.get_main_viewport().size
        whole = Rect(0.0, 0.0, size.x, size.y - STATUS_BAR_HEIGHT)
        toast_area = ui.rects.get("viewport.free", whole)
        self.guard.draw("the notices", lambda: self.notices.draw(session, dispatch, ui, toast_area))

    def _is_panel_keyed(self) -> bool:
        """Do arrow keys move from one item to the next? In the panel that F6 went to, and on the first screen."""
        return self.ui.keyed_panel is not None or self.session.capture is None

    def dispatch(self, command: Command) -> None:
        """Hand a command to the session and plan a redraw."""
        self.session.dispatch(command)
        self.request_redraw()

    def open_path(self, path: Path) -> None:
        """Open a capture or project folder, a scene of another program, or the folder of any other file."""
        is_itself = path.is_dir() or not path.exists() or is_scene_file(path)
        self.dispatch(OpenCapture(path if is_itself else path.parent, is_asking=True))

    def _draw_panel(self, title: str, draw_panel: Callable[..., None], has_padding: bool) -> None:
        is_wanted, drawer = title == self.ui.wanted_panel, self.ui.open_drawer
        if is_wanted:
            self.ui.wanted_panel = None
            if title in DRAWER:
                drawer.add(title)
            imgui.set_next_window_focus()
        if title in DRAWER and title not in drawer:
            self._visible_panels.discard(title)
            return
        if not has_padding:
            imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
        flags = imgui.WindowFlags_.no_collapse
        if title in (VIEWPORT, TIMELINE):
            flags |= imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_scroll_with_mouse
        if title == VIEWPORT:  # its picture and toolbar cover all of it
            flags |= imgui.WindowFlags_.no_background
        # A docked panel lies on the cleared frame. Filling it again is what costs most where the CPU draws.
        is_bare = title not in self._floating_panels
        if is_bare:
            imgui.push_style_color(imgui.Col_.window_bg, NOTHING)
        if title == TIMELINE:  # nothing else lies in its place, so that it is always seen
            imgui.set_next_window_class(self._alone)
        is_visible, is_open = imgui.begin(title, True if title in DRAWER else None, flags)
        if is_open is False:
            drawer.discard(title)
            self.request_redraw(FIRST_FRAMES)
        if is_bare:
            imgui.pop_style_color()
        if is_wanted and (self.ui.keyed_panel == title or (title == VIEWPORT and self._is_welcome)):
            imgui.internal.nav_init_window(imgui.internal.get_current_window(), True)
            imgui.set_nav_cursor_visible(True)
        (self._visible_panels.add if is_visible else self._visible_panels.discard)(title)
        (self._floating_panels.discard if imgui.is_window_docked() else self._floating_panels.add)(title)
        if imgui.is_window_docked():
            self._dock_ids[title] = imgui.get_window_dock_id()
        if not has_padding:
            imgui.pop_style_var()
        if is_visible:
            part = f"the panel {title}"
            if not self.guard.draw(part, lambda: draw_panel(self.session, self.dispatch, self.ui)):
                draw_failed(part)
        imgui.end()

    def close(self) -> None:
        """Release GL objects and ImGui. The GL context must still be current."""
        self.viewport.release()
        self.capture.release()
        self.opening.release()
        self.residuals.release()
        self.doctor.release()
        self.backend.close()
