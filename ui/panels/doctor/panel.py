"""The capture doctor: faults of the open capture, their certainty, their evidence, and their remedies."""

from __future__ import annotations

import time
from collections.abc import Callable

from imgui_bundle import ImVec2, imgui

from app.session.captures.capture_commands import ExamineCapture, StopExamining
from app.session.captures.doctor_status import DoctorStatus
from app.session.session_view import SessionView
from app.session.showing.look_commands import LookThrough
from engine.camera.rig import CameraRig
from engine.doctor.finding import Finding
from ui.gl import ImageTexture
from ui.panels.doctor.camera_map import CameraPlan, camera_plan, draw_bars, draw_legend, draw_map
from ui.panels.doctor.evidence import Evidence
from ui.panels.doctor.findings import draw_findings
from ui.panels.doctor.words import summary_text
from ui.panels.pieces.widgets import draw_job_bar, primary_button, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.style.progress_words import job_words
from ui.style.theme import Icon

WIDE = 640.0
"""In a panel at least so wide the list, the pictures and the map stand side by side."""
PROGRESS = 180.0
"""Width of the bar."""
SHARES = (0.34, 0.38)
"""Of the width that the list and the pictures have."""
LOW, WORDS = 250.0, 28.0
"""In a room lower than this the bars stand next to the map; and the height of a line of words."""
STACKED_HEIGHTS = (0.5, 0.3)


class DoctorPanel:
    """Owns which finding is chosen, and the pictures of it.

    Args:
        make_texture: Makes an empty texture.
    """

    def __init__(self, make_texture: Callable[[], ImageTexture]) -> None:
        self._evidence = Evidence(make_texture)
        self._chosen = 0
        self._revision = -1
        self._rig: CameraRig | None = None
        self._plan: CameraPlan | None = None

    def release(self) -> None:
        """Free the pictures. GL thread only."""
        self._evidence.release()

    def draw(self, session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
        """Buttons and progress, then findings, pictures and map."""
        if session.capture is None:
            text_wrapped_dim("Problems of a capture and their fixes appear here.")
            return
        status, rig = session.doctor_status, session.rig
        if status.revision != self._revision:
            self._revision, self._chosen = status.revision, 0
            self.release()
        if rig is not self._rig:
            self._rig, self._plan = rig, camera_plan(rig)
        self._draw_head(status, dispatch, ui)
        self._chosen = min(self._chosen, max(len(status.findings) - 1, 0))
        chosen = status.findings[self._chosen] if status.findings else None
        room = imgui.get_content_region_avail()
        is_wide = room.x >= WIDE
        flags = imgui.ChildFlags_.nav_flattened
        parts = [
            ("findings", lambda: self._draw_list(session, status, rig, dispatch, ui)),
            ("evidence", lambda: self._draw_evidence(session, chosen, rig, dispatch, ui)),
            ("cameras", lambda: self._draw_cameras(status, chosen, rig, dispatch, ui)),
        ]
        for index, (name, draw_part) in enumerate(parts):
            if is_wide and index:
                imgui.same_line()
            share = (SHARES if is_wide else STACKED_HEIGHTS)[index] if index < 2 else 0.0
            size = ImVec2(room.x * share, 0) if is_wide else ImVec2(0, room.y * share)
            if imgui.begin_child(f"##{name}", size, flags):
                draw_part()
            imgui.end_child()

    def _draw_head(self, status: DoctorStatus, dispatch: Dispatch, ui: UiState) -> None:
        if status.state == "running":
            if imgui.button(f"{Icon.STOP}  Stop"):
                dispatch(StopExamining())
            ui.mark("doctor.stop")
            imgui.same_line()
            draw_job_bar(status.progress, ui, PROGRESS, 0.0)
            imgui.same_line()
            imgui.align_text_to_frame_padding()
            imgui.text(job_words(status.progress, time.monotonic()))
            ui.mark("doctor.progress")
            return
        label = f"{Icon.EYE}  Examine" if status.diagnosis is None else f"{Icon.EYE}  Examine again"
        if primary_button(label, ImVec2(160, 0), ui):
            dispatch(ExamineCapture())
        ui.mark("doctor.examine")
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        found = summary_text(status.findings)
        if status.diagnosis is None:
            memory = f" and up to {status.memory_bytes / 2**30:.1f} GB of memory" if status.memory_bytes else ""
            words = f"{found} so far. Examining looks at the pictures, too: usually less than a minute{memory}."
        else:
            words = f"{found}. {status.diagnosis.n_pictures} pictures looked at in {status.diagnosis.seconds:.0f} s."
        imgui.push_text_wrap_pos(0.0)
        imgui.text_disabled(words.replace("%", "%%"))
        imgui.pop_text_wrap_pos()

    def _draw_list(
        self, session: SessionView, status: DoctorStatus, rig: CameraRig, dispatch: Dispatch, ui: UiState
    ) -> None:
        if not status.findings:
            done = "No problems found in this capture."
            text_wrapped_dim("No problems found so far." if status.diagnosis is None else done)
            return
        project, capture = session.project, session.capture
        assert capture is not None
        can_hold_out = project is not None and not project.has_finished_clips
        self._chosen = draw_findings(
            status.findings, self._chosen, rig, capture.path, dispatch, ui, can_hold_out=can_hold_out
        )

    def _draw_evidence(
        self, session: SessionView, chosen: Finding | None, rig: CameraRig, dispatch: Dispatch, ui: UiState
    ) -> None:
        if chosen is not None and chosen.evidence:
            self._evidence.draw(session, chosen, rig, dispatch, ui)

    def _draw_cameras(
        self, status: DoctorStatus, chosen: Finding | None, rig: CameraRig, dispatch: Dispatch, ui: UiState
    ) -> None:
        names = frozenset(() if chosen is None else chosen.cameras)
        worst: dict[str, str] = {}
        for finding in status.findings:
            if finding.severity != "note":
                for name in finding.cameras:
                    worst.setdefault(name, finding.severity)
        has_bars = status.diagnosis is not None
        room = imgui.get_content_region_avail()
        is_low = has_bars and room.y < LOW
        width = (room.x - 8.0) / 2 if is_low else room.x
        height = room.y - WORDS
        if has_bars and not is_low:
            height = (room.y - 2 * WORDS) * 0.6
        assert self._plan is not None
        imgui.begin_group()
        clicked = draw_map(rig, self._plan, worst, names, ImVec2(width, max(height, 60.0)), ui)
        draw_legend(width)
        imgui.end_group()
        if clicked is not None:
            dispatch(LookThrough(rig.names.index(clicked)))
        if status.diagnosis is None:
            return
        if is_low:
            imgui.same_line()
        imgui.begin_group()
        bars = imgui.get_content_region_avail().y - WORDS
        draw_bars(rig, status.diagnosis.camera_px, names, max(bars, 40.0), ui)
        imgui.text_disabled("Matching error, px")
        imgui.end_group()
