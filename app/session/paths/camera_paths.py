"""CameraPaths: the camera paths of the open project, which of them is edited, and a view that follows it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from app.document.camera_paths import check_paths
from app.playback.timeline import Timeline
from app.playback.views.orbit_view import OrbitView
from app.playback.views.view_place import ViewPlace
from app.playback.views.views import Views
from app.project.opening.opened_project import OpenedProject
from app.session.edit_status import PathsStatus
from app.session.editing.kept_document import KeptDocument
from app.session.part import SessionPart
from app.session.paths.path_commands import ChooseCameraKey, ChooseCameraPath, LookAlongPath, PathCommand
from app.session.paths.path_edits import edited
from engine.camera.camera_path import CameraPath
from engine.errors import ProjectError


class CameraPaths(SessionPart):
    """For one thread. document: Holds and keeps the paths."""

    def __init__(self, document: KeptDocument) -> None:
        self._document = document
        self._chosen: int | None = None
        self._key: int | None = None
        self._along: tuple[int, OrbitView] | None = None  # the view that follows the path, and its index
        self._led: tuple[ViewPlace, Any] | None = None  # where it was put, and for which frame and path

    @property
    def _paths(self) -> tuple[CameraPath, ...]:
        content = self._document.content
        return () if content is None else content.camera_paths

    def status(self) -> PathsStatus:
        """Everything as one value."""
        paths, why_not = self._paths, self._document.why_not()
        chosen = None if not paths else min(self._chosen or 0, len(paths) - 1)
        n_keys = 0 if chosen is None else len(paths[chosen].keys)
        key = None if self._key is None or self._key >= n_keys else self._key
        along = None if self._along is None else self._along[0]
        return PathsStatus(paths, chosen, key, along, not why_not, why_not)

    def apply(self, command: PathCommand, views: Views, timeline: Timeline) -> None:
        """Carry out a command for the current view.

        Raises:
            ProjectError: It cannot be done now, or is not valid.
        """
        status, view = self.status(), views.current.view
        match command:
            case ChooseCameraPath(row=row):
                if not 0 <= row < len(status.paths):
                    raise ProjectError(f"There is no camera path {row + 1}; there are {len(status.paths)}.")
                self._chosen, self._key = row, None
            case ChooseCameraKey(index=index, is_going=is_going):
                self._choose_key(status, index)
                if is_going and index is not None and status.path is not None:
                    timeline.seek(round(status.path.keys[index].frame))
                    key = status.path.keys[index]
                    view.stand(key.world_to_camera, key.fov_y_rad, is_jump=True)
            case LookAlongPath(is_on=is_on):
                self._look_along(status, views, is_on)
            case _:
                document = self._document.checked().document
                result = edited(status, command, view, timeline)
                check_paths(result.paths)
                self._document.change(replace(document, camera_paths=result.paths), result.name, result.merge)
                self._chosen, self._key = result.chosen, result.chosen_key

    def _choose_key(self, status: PathsStatus, index: int | None) -> None:
        n_keys = 0 if status.path is None else len(status.path.keys)
        if index is not None and not 0 <= index < n_keys:
            raise ProjectError(f"There is no key {index + 1} on the camera path; it has {n_keys}.")
        self._key = index

    def _look_along(self, status: PathsStatus, views: Views, is_on: bool) -> None:
        if is_on and (status.path is None or not status.path.keys):
            raise ProjectError("No camera path with keys to follow.", hint="Add a key first.")
        self._along = (views.current_index, views.current.view) if is_on else None
        self._led = None

    @contextmanager
    def showing_change(self) -> Iterator[None]:
        """Choose the path that an undo or redo in this block changes, so that one sees it."""
        before = self._paths
        yield
        after = self._paths
        changed = [row for row, path in enumerate(after) if row >= len(before) or before[row] is not path]
        if changed:
            self._chosen = changed[0]

    def lead(self, views: Views, timeline: Timeline) -> bool:
        """Move the following view to where the path is at the playhead. It stops following when it was moved otherwise,
        when it is not shown any more, and when the path is gone.

        Returns:
            Whether the view was moved, or has stopped following.
        """
        if self._along is None:
            return False
        path, (before, view) = self.status().path, self._along
        index = next((index for index, look in enumerate(views.shown) if look.view is view), None)
        is_moved = self._led is not None and self._led[0] != ViewPlace.of(view)
        if index is None or path is None or not path.keys or is_moved:
            self._along = self._led = None
            return True
        self._along = (index, view)
        due = (timeline.frame_index, path)
        if self._led is not None and self._led[1] == due:
            return index != before
        view.stand(*path.at(timeline.frame_index))
        self._led = (ViewPlace.of(view), due)
        return True

    def open(self, opened: OpenedProject) -> None:
        """Another project is opened: nothing is chosen in it yet."""
        self._chosen = self._key = self._along = self._led = None
