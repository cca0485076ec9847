"""Camera paths changed by commands. Pure: from values to values."""

from __future__ import annotations

import math
from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np

from app.playback.timeline import Timeline
from app.playback.views.orbit_view import OrbitView
from app.session.edit_status import PathsStatus
from app.session.paths import path_commands as c
from engine.camera.camera_path import MAX_DISTANCE, MAX_FOV_RAD, MIN_FOV_RAD, MIN_SPACING_FRAMES, CameraKey, CameraPath
from engine.camera.path_presets import fly_through, turntable
from engine.errors import ProjectError

SAME_FRAME = 0.5
"""A key nearer to the playhead than this many frames is the one that stands there."""


@dataclass(frozen=True, slots=True)
class Edited:
    """Camera paths after a command.

    Attributes:
        paths, chosen, chosen_key: As of PathsStatus.
        name: Of the step, for the history.
        merge: See app.document.history.Changed.
    """

    paths: tuple[CameraPath, ...]
    chosen: int | None
    chosen_key: int | None
    name: str
    merge: Hashable = None


def edited(status: PathsStatus, command: c.PathEdit, view: OrbitView, timeline: Timeline) -> Edited:
    """Carry out a command.

    Args:
        status: Before the command.
        view: The current one.
        timeline: Its playhead is where keys go, and its played frames are those of presets.

    Raises:
        ProjectError: It is not valid now; states the cause.
    """
    match command:
        case c.NewCameraPath(name=name):
            key = view_key(view, timeline.frame_index)
            return _with_new(
                status, CameraPath(name.strip() or free_name(status, "Path"), (key,)), "new camera path", 0
            )
        case c.MakeTurntable(n_turns=n_turns):
            return _with_new(status, _turntable(status, n_turns, view, timeline), "new turntable")
        case c.MakeFlyThrough():
            return _with_new(status, _fly_through(status, view, timeline), "new fly-through")
        case c.SetCameraKey():
            if status.path is None:
                return edited(status, c.NewCameraPath(), view, timeline)
            return _with_key(status, view, timeline.frame_index)
        case c.DeleteCameraPath():
            row = _checked_row(status)
            paths = (*status.paths[:row], *status.paths[row + 1 :])
            return Edited(paths, min(row, len(paths) - 1) if paths else None, None, "delete camera path")
        case c.RenameCameraPath(name=name):
            if not name.strip():
                raise ProjectError("A camera path needs a name.")
            return _with_path(status, replace(_checked_path(status), name=name.strip()), "rename camera path")
        case c.CloseCameraPath(is_closed=is_closed):
            path = replace(_checked_path(status), is_closed=is_closed)
            return _with_path(status, path, "close camera path" if is_closed else "open camera path")
        case c.DeleteCameraKey(index=index):
            path, _ = _checked_key(status, index)
            keys = (*path.keys[:index], *path.keys[index + 1 :])
            following = min(index, len(keys) - 1) if keys else None
            return replace(_with_path(status, replace(path, keys=keys), "delete camera key"), chosen_key=following)
        case c.TimeCameraKey(index=index, frame=frame, gesture=gesture, is_whole=is_whole):
            path, key = _checked_key(status, index)
            moved = key.at_frame(held_frame(path, index, frame, timeline.last_frame, is_whole=is_whole))
            return _with_changed_key(status, index, moved, "move camera key in time", gesture)
        case c.PlaceCameraKey(index=index, center=center, gesture=gesture):
            _, key = _checked_key(status, index)
            if not (np.abs(center) <= MAX_DISTANCE / 2).all():  # NaN is not
                raise ProjectError("A camera key cannot be placed there.")
            return _with_changed_key(status, index, key.at_center(np.array(center)), "move camera key", gesture)
        case c.AimCameraKey(index=index):
            _, key = _checked_key(status, index)
            return _with_changed_key(status, index, view_key(view, key.frame), "set camera key to the view")
        case c.SetCameraKeyFov(index=index, fov_y_rad=fov_y_rad, gesture=gesture):
            _, key = _checked_key(status, index)
            if not MIN_FOV_RAD <= fov_y_rad <= MAX_FOV_RAD:
                raise ProjectError(f"A field of view of {math.degrees(fov_y_rad):g} degrees is not possible.")
            return _with_changed_key(status, index, replace(key, fov_y_rad=fov_y_rad), "lens of camera key", gesture)


def view_key(view: OrbitView, frame: float) -> CameraKey:
    """A key with the picture that a view is moving to; of an orthographic one, from where it seems to stand."""
    pose = view.pose()
    matrix = np.eye(4)
    matrix[:3, :3] = pose.rotation
    matrix[:3, 3] = -pose.rotation @ pose.standpoint
    return CameraKey(frame, matrix, pose.fov_y)


def key_at(path: CameraPath | None, frame_index: int) -> int | None:
    """Number of the key that stands at a frame; None without one."""
    keys = () if path is None else path.keys
    near = [(abs(key.frame - frame_index), number) for number, key in enumerate(keys)]
    away, number = min(near, default=(math.inf, -1))
    return number if away < SAME_FRAME else None


def held_frame(path: CameraPath, index: int, frame: float, last_frame: int, *, is_whole: bool) -> float:
    """Where a key may be moved in time: into the capture, between its neighbours; where there is no room it stays.

    Args:
        is_whole: Only to whole frames.
    """
    keys, gap = path.keys, 2 * MIN_SPACING_FRAMES
    low, high = 0.0, float(last_frame)
    if index > 0:
        before = keys[index - 1].frame
        low = max(math.floor(before) + 1.0 if is_whole else before + gap, low)
    if index + 1 < len(keys):
        after = keys[index + 1].frame
        high = min(math.ceil(after) - 1.0 if is_whole else after - gap, high)
    if not math.isfinite(frame) or low > high:
        return keys[index].frame
    return float(min(max(round(frame) if is_whole else frame, low), high))


def free_name(status: PathsStatus, wanted: str) -> str:
    """A name that no path has: the wanted one, or that with a number."""
    taken = {path.name for path in status.paths}
    names = (wanted if number == 1 else f"{wanted} {number}" for number in range(1, len(taken) + 2))
    return next(name for name in names if name not in taken)


# ---------------------------------------------------------------- presets


def _turntable(status: PathsStatus, n_turns: float, view: OrbitView, timeline: Timeline) -> CameraPath:
    pose = view.pose()
    outward = pose.standpoint - pose.pivot
    first, last = timeline.play_range
    try:
        return turntable(
            pose.pivot,
            view.up,
            pose.distance,
            math.asin(float(np.clip(-(pose.forward @ view.up), -1.0, 1.0))),
            (first, last + 1),
            n_turns,
            fov_y_rad=pose.fov_y,
            start=outward,
            name=free_name(status, "Turntable"),
        )
    except ValueError as error:
        raise ProjectError(f"No turntable can be made: {error}.") from error


def _fly_through(status: PathsStatus, view: OrbitView, timeline: Timeline) -> CameraPath:
    first, last = timeline.play_range
    if view.rig is None or not len(view.rig) or first >= last:
        raise ProjectError(
            f"No fly-through can be made of {last - first + 1} frame.", hint="Play more than one frame of the capture."
        )
    return fly_through(view.rig, (first, last), name=free_name(status, "Fly-through"))


# ---------------------------------------------------------------- pieces


def _with_new(status: PathsStatus, path: CameraPath, name: str, chosen_key: int | None = None) -> Edited:
    return Edited((*status.paths, path), len(status.paths), chosen_key, name)


def _with_path(status: PathsStatus, path: CameraPath, name: str, merge: Hashable = None) -> Edited:
    row = _checked_row(status)
    paths = (*status.paths[:row], path, *status.paths[row + 1 :])
    return Edited(paths, row, status.chosen_key, name, merge)


def _with_key(status: PathsStatus, view: OrbitView, frame_index: int) -> Edited:
    path = _checked_path(status)
    there = key_at(path, frame_index)
    if there is not None:
        return _with_changed_key(status, there, view_key(view, path.keys[there].frame), "set camera key to the view")
    key = view_key(view, frame_index)
    keys = tuple(sorted((*path.keys, key), key=lambda one: one.frame))
    return replace(_with_path(status, replace(path, keys=keys), "add camera key"), chosen_key=keys.index(key))


def _with_changed_key(status: PathsStatus, index: int, key: CameraKey, name: str, gesture: int = 0) -> Edited:
    path = _checked_path(status)
    keys = (*path.keys[:index], key, *path.keys[index + 1 :])
    merge = (name, path.name, index, gesture) if gesture else None
    return replace(_with_path(status, replace(path, keys=keys), name, merge), chosen_key=index)


def _checked_row(status: PathsStatus) -> int:
    if status.chosen is None:
        raise ProjectError("There is no camera path yet.", hint="Begin one first.")
    return status.chosen


def _checked_path(status: PathsStatus) -> CameraPath:
    return status.paths[_checked_row(status)]


def _checked_key(status: PathsStatus, index: int) -> tuple[CameraPath, CameraKey]:
    path = _checked_path(status)
    if not 0 <= index < len(path.keys):
        raise ProjectError(f"There is no key {index + 1} on the camera path; it has {len(path.keys)}.")
    return path, path.keys[index]
