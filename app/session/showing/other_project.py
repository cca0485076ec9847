"""OtherProject: a second project next to the open one, to compare with: its clips with its edits, seen from the views
of the open one."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.background.jobs import BackgroundJob, JobContext, Jobs
from app.playback.clip_requests import ClipRequests
from app.playback.frame_decoder import FrameRequest
from app.playback.modes.arrays import Picture
from app.playback.modes.view_modes import ShownAs
from app.playback.render import RenderView
from app.project.opening.opened_project import OpenedProject, opened_project
from app.project.opening.opening import open_capture_of
from app.project.opening.project_access import is_project, open_project
from app.project.projects_folder import project_name
from app.session.notices import Notices
from app.session.part import SessionPart
from app.session.showing.look_commands import CompareProject
from app.session.showing.showing import Showing
from app.status import PROJECT, OtherStatus
from app.training.clip_run import ShownState
from engine.camera.rotations import matrices_of
from engine.capture.clip import ClipSpans
from engine.capture.formats.imported import read_place
from engine.errors import ProjectError
from engine.export.world import FileWorld
from engine.text import printable


@dataclass(frozen=True, slots=True)
class _Chosen:
    """The other project.

    Attributes:
        name: As shown to the user.
        place: Where its scene lies, from the coordinates of the open one.
    """

    opened: OpenedProject
    spans: ClipSpans
    name: str
    place: FileWorld


class OtherProject(SessionPart):
    """For one thread, and nothing here waits.

    Args:
        jobs, notices, showing: Of the session.
        projects: Gives the folder of projects, for scenes of other programs.
    """

    def __init__(self, jobs: Jobs, notices: Notices, showing: Showing, projects: Callable[[], Path]) -> None:
        self._jobs, self._notices, self._showing, self._projects = jobs, notices, showing, projects
        self._opened: OpenedProject | None = None
        self._chosen: _Chosen | None = None
        self._requests = ClipRequests(self._state_of)
        self._job: BackgroundJob | None = None
        self._n_chosen = 0
        self._missing = ""

    # ---------------------------------------------------------------- the open project

    def open(self, opened: OpenedProject) -> None:
        """Another project is open: nothing is compared with it yet."""
        self._leave()
        self._opened = opened

    def reopen(self, opened: OpenedProject) -> None:
        """The same project is open, with other settings."""
        self._opened = opened

    def close(self) -> None:
        """Let go of the other project."""
        self._leave()

    def _leave(self) -> None:
        if self._job is not None:
            self._job.context.cancel()
        if self._chosen is not None:
            self._chosen.opened.capture.close()
        self._job = self._chosen = None

    # ---------------------------------------------------------------- choosing

    def choose(self, command: CompareProject) -> None:
        """Open the other project on a thread, and compare with it once it is there; a notice says why it cannot be."""
        opened, path, projects = self._opened, Path(command.path), self._projects()
        if opened is None:
            raise ProjectError("Nothing is open to compare with.", hint="Open a project first.", path=path)
        if self._job is not None:
            self._job.context.cancel()
        self._n_chosen += 1
        generation, name = -self._n_chosen, printable(path.name)

        def failed(error: Exception) -> None:
            self._notices.add_failure(f"{name} cannot be compared", error)

        self._job = self._jobs.start(
            f"Opening {name} to compare",
            lambda context: _open(path, projects, opened, generation, context),
            self._take,
            failed,
            can_cancel=True,
        )

    def _take(self, chosen: _Chosen) -> None:
        if self._chosen is not None:
            self._chosen.opened.capture.close()
        self._chosen, self._missing = chosen, ""
        self._requests.take_up(chosen.opened)
        overlays = self._showing.overlays
        overlays.compare_with = PROJECT
        if overlays.compare == "off":
            overlays.compare = "wipe"

    # ---------------------------------------------------------------- its pictures

    @property
    def status(self) -> OtherStatus | None:
        """The other project; None where none is chosen."""
        chosen = self._chosen
        if chosen is None:
            return None
        return OtherStatus(chosen.name, chosen.opened.project.folder, chosen.opened.clips[-1].stop, self._missing)

    def picture(
        self, width: int, height: int, *, full_size: tuple[int, int] | None, shown_as: ShownAs, view_id: Hashable
    ) -> Picture | None:
        """Its frame at the playhead, the last one where it is shorter, from the current view; see Playback.render."""
        chosen, showing = self._chosen, self._showing
        if chosen is None:
            return None
        frame_index = min(showing.timeline.frame_index, chosen.opened.clips[-1].stop - 1)
        request = self._request(chosen, frame_index, shown_as)
        if request is None:
            self._missing = f"{chosen.name} has no clip of frame {frame_index}"
            return None
        playback, view = showing.playback, showing.view
        has_failed = playback.decoder.has_failed(request)
        self._missing = f"{chosen.name} cannot be shown" if has_failed else ""
        look = RenderView.of(view, width, height, shown_as=shown_as)
        full = look if full_size is None else look.in_size(view, *full_size)
        looks = _placed(full, chosen.place), _placed(look, chosen.place)
        return playback.draw(request, looks, view_id=view_id)

    def _request(self, chosen: _Chosen, frame_index: int, shown_as: ShownAs) -> FrameRequest | None:
        clip = chosen.opened.clips[chosen.spans.index_of(frame_index)]
        return self._requests.request(clip, frame_index, shown_as)

    def _state_of(self, clip_index: int) -> ShownState | None:
        """As the file is now: another program may train the project, or move it away."""
        if self._chosen is None:
            return None
        path = self._chosen.opened.project.clip_path(clip_index)
        with suppress(OSError):
            return ShownState(path, f"{path.stat().st_mtime_ns}")
        return None


def _placed(look: RenderView, place: FileWorld) -> RenderView:
    """The same picture of the other scene, where that lies."""
    low, high = look.value_range
    is_depth = look.shown_as.mode == "depth"
    return replace(
        look,
        key=(look.key, place.rotation.tobytes(), place.scale),
        world_to_camera=place.placed_view(look.world_to_camera),
        near=look.near * place.scale,
        set_back=look.set_back * place.scale,
        value_range=(low * place.scale, high * place.scale) if is_depth else look.value_range,
    )


# ---------------------------------------------------------------- on the job's thread


def _open(path: Path, projects: Path, opened: OpenedProject, generation: int, context: JobContext) -> _Chosen:
    """Raises EngineError: It is no other project, is damaged, or its capture is gone."""
    from app.importing.importable import imported_dir, is_importable, project_of_scene  # as a window starts without

    folder = path
    if is_importable(path):
        folder = project_of_scene(path, imported_dir(path, projects), context)
    if not is_project(folder):
        raise ProjectError(
            "This is not a project.", hint="Open it once, which makes a project of it, or choose another.", path=path
        )
    if folder.resolve() == opened.project.folder.resolve():
        raise ProjectError("This project is the open one.", hint="Choose another project to compare with.", path=path)
    project = open_project(folder, is_writable=False)
    capture = open_capture_of(project.settings, folder)
    try:
        theirs, ours = (_place(Path(one.path)) for one in (capture, opened.capture))
        other = opened_project(capture, project, generation)
        name = project_name(folder.absolute(), project.settings.capture)
        return _Chosen(other, ClipSpans(other.clips), printable(name), theirs.seen_from(ours))
    except BaseException:
        capture.close()
        raise


def _place(capture: Path) -> FileWorld:
    """Where our own export has placed an imported scene; any other lies as it is."""
    place = read_place(capture)
    return FileWorld() if place is None else FileWorld(matrices_of(np.array(place.quat)), place.scale)
