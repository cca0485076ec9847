"""The clip under the playhead in the training panel: its dependencies, its versions, and the room that it takes."""

from __future__ import annotations

from collections.abc import Sequence

from imgui_bundle import ImVec2, ImVec4, imgui

from app.project.disk.use import DiskUse
from app.session.clips.clip_commands import AskFreeSpace, CompareVersion
from app.session.session_view import SessionView
from app.session.training.train_commands import RemoveVersion, RestoreVersion, TrainStale
from app.status import DependencyStatus, QueueStatus, VersionStatus
from engine.capture.clip import Clip
from engine.text import duration_text, size_text
from ui.panels.clips.comparing import compared_version
from ui.panels.pieces.widgets import text_wrapped, text_wrapped_dim
from ui.panels.state import Dispatch, UiState
from ui.panels.timeline.clip_words import clip_title
from ui.panels.training.clip_versions import difference_lines, version_text
from ui.style import theme
from ui.style.theme import Icon

STALE_TOOLTIP = "Clips whose reference has changed since, hatched in the timeline (Alt+T)"
MAX_LISTED = 8
"""Clips named in a row."""


# ---- words -----------------------------------------------------------------------------------------------------


def stale_text(queue: QueueStatus) -> str:
    """Cost of training all out-of-date clips again; empty where there are none."""
    stale = queue.stale
    if stale is None:
        return ""
    clips = "1 stale clip" if stale.n_clips == 1 else f"{stale.n_clips} stale clips"
    cost = "" if stale.seconds is None else f", about {duration_text(stale.seconds)}"
    return f"Retrain {clips}{cost}"


def listed(indices: Sequence[int]) -> str:
    """Clips by their numbers: "clip 3", "clips 1, 2 and 5", "clips 1, 2, 3 and 40 more"."""
    if len(indices) == 1:
        return f"clip {indices[0]}"
    if len(indices) > MAX_LISTED:
        return f"clips {', '.join(map(str, indices[:MAX_LISTED]))} and {len(indices) - MAX_LISTED} more"
    return f"clips {', '.join(map(str, indices[:-1]))} and {indices[-1]}"


def dependency_lines(status: DependencyStatus) -> list[str]:
    """The clips that a clip depends on and those that depend on it, in sentences."""
    lines = [f"It starts from {listed(status.needs)}." if status.needs else "It starts from no other clip."]
    if status.needed_by:
        others = listed(status.needed_by)
        lines.append(f"{others[0].upper()}{others[1:]} start{'s' if len(status.needed_by) == 1 else ''} from it.")
    if status.trained_on_it:
        n = len(status.trained_on_it)
        cost = "" if status.outdated_seconds is None else f", about {duration_text(status.outdated_seconds)}"
        them = "1 clip was" if n == 1 else f"{n} clips were"
        lines.append(f"{them} trained on it. If it changes, they have to be retrained{cost}.")
    return lines


def use_lines(use: DiskUse) -> list[tuple[str, int]]:
    """Size of the whole project, part by part: name and bytes."""
    rows = [
        ("Clips", sum(clip.clip for clip in use.clips)),
        (f"Earlier versions ({use.n_versions})", use.versions),
        ("Stopped trainings", sum(clip.checkpoint for clip in use.clips)),
        ("Unused (other cuts, damaged files)", use.unused),
        ("Preparation, rebuilt when needed", use.preparation),
        ("Everything else", use.other),
    ]
    return [row for row in rows if row[1]]


# ---- parts -----------------------------------------------------------------------------------------------------


def draw_stale(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """The button that trains again everything that is out of date; nothing where nothing is."""
    text = stale_text(session.queue)
    if not text:
        return
    imgui.push_style_color(imgui.Col_.text, ImVec4(*theme.ORANGE))
    imgui.begin_disabled(session.training.state == "stopping")
    if imgui.button(f"{Icon.CLOCK_BACK}  {text}", ImVec2(-1, 30)):
        dispatch(TrainStale())
    imgui.end_disabled()
    imgui.pop_style_color()
    ui.mark("training.stale")
    imgui.set_item_tooltip(STALE_TOOLTIP)


def draw_clip_section(session: SessionView, dispatch: Dispatch, ui: UiState) -> None:
    """A header that folds out, for the clip under the playhead."""
    clip = session.timeline.clip
    if clip is None or clip.clip_index >= len(session.clip_states):
        return
    index = clip.clip_index
    is_open = imgui.collapsing_header(f"{clip_title(index, session.reference_index)}: versions and disk###this clip")
    ui.mark("clip.header")
    if not is_open:
        return
    for line in dependency_lines(session.clip_dependencies(index)):
        text_wrapped_dim(line)
    use = session.disk_use()
    of_clip = None if use is None or index >= len(use.clips) else use.clips[index]
    if of_clip is not None and of_clip.total:
        parts = [
            f"{name} {size_text(n / 1e6)}"
            for name, n in (
                ("clip", of_clip.clip),
                ("earlier versions", of_clip.versions),
                ("stopped training", of_clip.checkpoint),
            )
            if n
        ]
        text_wrapped(f"On disk: {', '.join(parts)}")
        ui.mark("clip.disk")
    _draw_versions(session, dispatch, ui, clip)
    if use is not None:
        _draw_use(use, dispatch, ui, index)


def _draw_versions(session: SessionView, dispatch: Dispatch, ui: UiState, clip: Clip) -> None:
    versions = session.clip_versions(clip.clip_index)
    if not versions:
        text_wrapped_dim("No earlier versions. Retraining a clip keeps its previous result.")
    for version in versions:
        imgui.push_id(version.number)
        text_wrapped_dim(f"Version {version.number}: {version_text(version)}")
        ui.mark(f"clip.version{version.number}")
        tooltip = "\n".join([*difference_lines(version), *([version.why_not] if version.why_not else [])])
        if tooltip:
            imgui.set_item_tooltip(tooltip.replace("%", "%%"))
        _draw_buttons(session, dispatch, ui, clip, version)
        imgui.pop_id()


def _draw_buttons(session: SessionView, dispatch: Dispatch, ui: UiState, clip: Clip, version: VersionStatus) -> None:
    is_shown = compared_version(session.overlays) == version.number
    if imgui.small_button("Stop comparing" if is_shown else "Compare"):
        dispatch(CompareVersion(clip.clip_index, None if is_shown else version.number))
    ui.mark(f"clip.compare{version.number}")
    imgui.same_line()
    imgui.begin_disabled(bool(version.why_not))
    if imgui.small_button("Restore"):
        dispatch(RestoreVersion(clip.clip_index, version.number))
    ui.mark(f"clip.restore{version.number}")
    imgui.end_disabled()
    imgui.same_line()
    if imgui.small_button("Remove"):
        dispatch(RemoveVersion(clip.clip_index, version.number))
    ui.mark(f"clip.remove{version.number}")


def _draw_use(use: DiskUse, dispatch: Dispatch, ui: UiState, clip_index: int) -> None:
    is_open = imgui.tree_node(f"The project takes {size_text(use.total / 1e6)}###disk")
    ui.mark("clip.use")
    if not is_open:
        return
    for name, n_bytes in use_lines(use):
        text_wrapped_dim(f"{name}: {size_text(n_bytes / 1e6)}")
    imgui.text("Free:")
    of_clip = use.clips[clip_index].versions if clip_index < len(use.clips) else 0
    choices = (
        ("oldest", "Oldest versions", None, use.versions),
        ("versions", f"Versions of clip {clip_index}", clip_index, of_clip),
        ("versions", "All versions", None, use.versions),
        ("checkpoints", "Stopped trainings", None, sum(clip.checkpoint for clip in use.clips)),
        ("unused", "Unused files", None, use.unused),
    )
    for what, words, of, n_bytes in choices:
        imgui.begin_disabled(not n_bytes)
        if imgui.small_button(f"{words} ...##{what}{of}"):
            dispatch(AskFreeSpace(what, of))
        ui.mark(f"clip.free.{what}" + ("" if of is None else ".clip"))
        imgui.end_disabled()
    imgui.tree_pop()
