"""The viewport's picture, drawn off screen into one texture: splats, or the CPU rasterizer's picture, or the cloud,
with camera frusta, anchors, regions and the camera path on top.

On a graphics card the Gaussians are drawn as splats. On software GL the session's own rasterizer is several times
faster, so its picture is uploaded instead. Redrawn only when the key of what it shows changes. Knows no ImGui.
"""

from __future__ import annotations

import time
from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Literal

import moderngl
import numpy as np

from app.playback.modes.arrays import BACKGROUND, GaussianArrays
from app.playback.modes.view_modes import MODES, ShownAs
from app.playback.picture_source import PictureSource
from app.playback.prefetch_order import Course
from app.playback.views.pointing import pixel_ray, seen_point
from app.session.session_view import SessionView
from app.status import CAPTURED as CAPTURED_PICTURE
from engine.camera.projection import camera_center
from engine.editing.selection.seen_from import SeenFrom
from ui.gl import (
    NEAR,
    ImageTexture,
    PointRenderer,
    SplatRenderer,
    Target,
    is_software,
)
from ui.viewport.editing.object_layer import ObjectLayer
from ui.viewport.editing.selection_layer import SelectionLayer
from ui.viewport.hud_text import CAPTURED, CLOUD, FIRST_CLOUD, HINT, RENDERED, ShownPicture
from ui.viewport.layers.anchor_heat_layer import AnchorHeatLayer
from ui.viewport.layers.anchor_marks import nearest_under
from ui.viewport.layers.explaining_layer import ExplainingLayer
from ui.viewport.layers.mark_layer import AnchorCounts, MarkLayer
from ui.viewport.layers.path_layer import PathLayer
from ui.viewport.layers.region_layer import RegionLayer, ShownRegions
from ui.viewport.picture_size import MAX_PICTURE_WIDTH, MovingSize, picture_size

CLOUD_OVERLAP = 1.5
"""Diameter of a cloud's points, in distances between neighbours."""
HINT_NEAR_SHARE = 0.4
"""Pictures in space nearer than this share of the way to the pivot are left out."""
_CLOUD_KINDS = {"static": CLOUD, "moment": FIRST_CLOUD, "pictures": HINT}
NO_REGIONS = ShownRegions()


@dataclass(frozen=True)
class SceneView:
    """From where, through which lens, at which size.

    Attributes:
        world_to_camera: Rigid map, OpenCV axes. [4, 4]
        K: Intrinsics in pixels of width x height. [3, 3]
        is_moving: The view changes just now; a coarser picture that comes sooner is better.
        near: Nothing nearer than this is drawn, whatever the scene says: an orthographic view stands far away. Scene
            units
        set_back: How much farther away the camera stands than it seems to, scene units.
    """

    world_to_camera: np.ndarray
    K: np.ndarray
    width: int
    height: int
    is_moving: bool
    near: float = 0.0
    set_back: float = 0.0

    @property
    def eye(self) -> np.ndarray:
        """Where from, scene units. [3]"""
        return camera_center(self.world_to_camera)

    @property
    def camera(self) -> tuple[np.ndarray, np.ndarray, int, int, float]:
        """The camera of marks and lines: world_to_camera, K, width, height, near."""
        return self.world_to_camera, self.K, self.width, self.height, max(NEAR, self.near)

    @property
    def seen_from(self) -> SeenFrom:
        """The same, as what selects knows it."""
        return SeenFrom(self.world_to_camera, self.K, self.width, self.height, self.near, self.set_back)

    @property
    def key(self) -> Hashable:
        """Differs whenever the picture would."""
        matrices = (np.asarray(m, dtype=np.float64).tobytes() for m in (self.world_to_camera, self.K))
        return (*matrices, self.width, self.height)


@dataclass(frozen=True)
class Composed:
    """The finished picture, and what it is of."""

    texture: moderngl.Texture
    shown: ShownPicture


@dataclass(frozen=True)
class CapturedPicture:
    """A picture on the GPU that the rendered one is compared with: a captured one, or one in another mode.

    Attributes:
        frame_index: The frame it was taken at, which need not be that of the playhead yet.
        has_scene_colors: Whether it was brought into the scene's colours, those of the render.
        shown_as: Meaning of its colours; None of a captured picture.
    """

    texture: moderngl.Texture
    frame_index: int | None
    is_stale: bool
    has_scene_colors: bool = False
    shown_as: ShownAs | None = None


class ViewportScene:
    """Owns the target, the renderers and the captured picture's texture. GL thread only."""

    def __init__(self, ctx: moderngl.Context) -> None:
        self.is_software = is_software(ctx)
        self.shown = ShownPicture()
        self._target = Target(ctx, precision="f1" if self.is_software else "f2")
        self._picture = ImageTexture(ctx)
        self._captured = ImageTexture(ctx)
        self._splats = SplatRenderer(ctx)
        self._cloud = PointRenderer(ctx)
        self.marks = MarkLayer(ctx)
        self.regions = RegionLayer(ctx)
        self.path = PathLayer(ctx)
        self.selection = SelectionLayer(ctx)
        self.objects = ObjectLayer(ctx)
        self._anchor_heat = AnchorHeatLayer(ctx)
        self.explaining = ExplainingLayer(ctx)
        self._drawn_key: Hashable = None
        self._held: Hashable = None
        self._asked_sizes: tuple[tuple[int, int], tuple[int, int]] | None = None
        self._asked_capture: tuple[int, int] | None = None
        self._asked_other: tuple[tuple[int, int], tuple[int, int]] | None = None
        self._near = NEAR
        self._moving_size = MovingSize()
        self._cloud_kind = CLOUD
        self._point_size = 0.0
        self._is_picture = self.is_software
        self._values: np.ndarray | None = None
        self._picture_key: Hashable = None
        self._captured_key: Hashable = None

    def release(self) -> None:
        """Free every GL object."""
        owned = (
            self._target,
            self._picture,
            self._captured,
            self._splats,
            self._cloud,
            self.marks,
            self.regions,
            self.path,
            self.selection,
            self.objects,
            self._anchor_heat,
            self.explaining,
        )
        for thing in owned:
            thing.release()

    @property
    def counts(self) -> AnchorCounts:
        """Anchors of the shown frame."""
        return self.marks.counts

    @property
    def shows(self) -> str:
        """The kind of picture on screen; one of the words of ui.viewport.hud_text."""
        return self.shown.kind

    # ---- what arrived ----------------------------------------------------------------------------------------

    def has_news(self, session: SessionView) -> bool:
        """Did a picture arrive since the last compose? Asks again for what was asked last."""
        if self._asked_sizes is not None:
            size, full_size = self._asked_sizes
            picture = session.request_render(*size, full_size=full_size)
            if picture is not None and picture.key != self._picture_key:
                return True
        if self._asked_capture is not None:
            captured = session.compared_picture(*self._asked_capture)
            if captured is not None and captured.key != self._captured_key:
                return True
        if self._asked_other is not None:
            size, full_size = self._asked_other
            other = session.request_other(*size, full_size=full_size)
            if other is not None and other.key != self._captured_key:
                return True
        return self._splats.has_news

    # ---- the picture -----------------------------------------------------------------------------------------

    def compose(self, session: SessionView, view: SceneView, regions: ShownRegions = NO_REGIONS) -> Composed:
        """Draw the picture of the session's frame from this view, unless it is drawn already."""
        self._target.resize(view.width, view.height)
        is_cloud_chosen = bool(session.overlays.show_cloud)
        points_key = self._take_points(session) if is_cloud_chosen else None
        is_cloud_chosen = points_key is not None
        self._asked_sizes = self._values = None
        shown = ShownPicture(
            source=PictureSource(camera_index=session.view.look_through, look=session.view.look_key),
            size=(view.width, view.height),
            full_size=(view.width, view.height),
            is_cloud_chosen=is_cloud_chosen,
        )
        base_key = None
        if not is_cloud_chosen:
            self._is_picture = self.is_software or MODES[session.overlays.mode].is_picture
            take = self._take_picture if self._is_picture else self._take_gaussians
            base_key, shown = take(session, view, shown)
            points_key = self._take_points(session) if base_key is None and session.overlays.show_points else None
        needs_capture = base_key is None and points_key is None and session.view.look_through is not None
        captured = self.captured(session, view.width) if needs_capture else None
        captured_key = None if captured is None else self._captured_key
        if base_key is None:
            shown = self._without_render(shown, points_key, captured)
        is_rendered = base_key is not None
        held = (base_key, view.width, view.height)
        if self.is_software and view.is_moving and shown.is_on_its_way and is_rendered and held == self._held:
            # The picture of this view comes in a moment; marks drawn from here would not lie on the one before.
            self.shown = shown
            return Composed(self._target.texture, shown)
        gaussians = session.shown_gaussians() if is_rendered else None
        marks_key = self.marks.take(session, view, gaussians)
        heat_key = self._anchor_heat.take(session, view, gaussians)
        explaining_key = self.explaining.take(session, view)
        selection_key = self.selection.take(session, view, gaussians)
        objects_key = self.objects.take(session, view, gaussians)
        regions_key = self.regions.take(regions, None if regions.sphere is None else session.shown_anchors(), view.eye)
        self.shown = shown
        if self.is_software and is_rendered and self._has_no_marks(session, regions):
            # Nothing to draw over it: each pass over all pixels that is saved is milliseconds without a graphics card.
            self._drawn_key = self._held = None
            return Composed(self._picture.texture, shown)
        over_key = (
            marks_key,
            regions_key,
            explaining_key,
            selection_key,
            objects_key,
            heat_key,
            self.path.take(session),
            session.overlays.heat_opacity,
        )
        key = (view.key, base_key, points_key, captured_key, over_key)
        if key != self._drawn_key or self._splats.is_order_stale:
            self._drawn_key, self._held = key, held
            self._draw(view, base_key, points_key, captured_key, session)
        if self._splats.is_order_stale:
            self.shown = shown = replace(shown, is_on_its_way=True)
        return Composed(self._target.texture, shown)

    def _has_no_marks(self, session: SessionView, regions: ShownRegions) -> bool:
        """Is nothing to be drawn over the picture?"""
        are_empty = regions.is_empty and self.explaining.is_empty and self._anchor_heat.is_empty
        are_empty &= self.selection.is_empty and self.objects.is_empty
        return are_empty and self.marks.is_empty(session) and self.path.is_empty(session)

    def captured(self, session: SessionView, width_px: int) -> CapturedPicture | None:
        """The picture that the camera looked through took at the playhead's frame, or at another one until that was
        decoded; None until anything was."""
        camera_index = session.view.look_through
        if camera_index is None:
            self._asked_capture = None
            return None
        own_width = int(session.rig.image_sizes[camera_index, 0])
        self._asked_capture = (camera_index, min(width_px, own_width))
        picture = session.compared_picture(*self._asked_capture)
        if picture is None:
            return None
        self._captured.set(picture.image, key=picture.key)
        self._captured_key = picture.key
        source = picture.source
        return CapturedPicture(
            self._captured.texture, source.frame_index, picture.is_stale, has_scene_colors=source.has_scene_colors
        )

    def other(self, session: SessionView, view: SceneView) -> CapturedPicture | None:
        """The picture that the rendered one is compared with: see `captured`, or the same frame in another mode."""
        self._asked_other = None
        if session.overlays.compare_with == CAPTURED_PICTURE:
            return self.captured(session, view.width)
        self._asked_capture = None
        share = min(MAX_PICTURE_WIDTH / view.width, 1.0)
        full_size = picture_size(view.width, view.height, share)
        moving = self._moving_size.share if view.is_moving else 1.0
        self._asked_other = picture_size(view.width, view.height, share * moving), full_size
        picture = session.request_other(*self._asked_other[0], full_size=full_size)
        if picture is None:
            return None
        self._captured.set(picture.image, key=picture.key)
        self._captured_key, source = picture.key, picture.source
        return CapturedPicture(self._captured.texture, source.frame_index, picture.is_stale, shown_as=source.shown_as)

    def forget_other(self) -> None:
        """Stop comparing: ask for no other picture."""
        self._asked_other = None

    def _without_render(
        self, shown: ShownPicture, points_key: Hashable, captured: CapturedPicture | None
    ) -> ShownPicture:
        if points_key is not None:
            return replace(shown, kind=self._cloud_kind)
        if captured is not None:
            return replace(
                shown,
                kind=CAPTURED,
                source=replace(shown.source, frame_index=captured.frame_index),
                size=captured.texture.size,
                full_size=captured.texture.size,
                is_on_its_way=captured.is_stale,
            )
        return shown

    def _take_picture(
        self, session: SessionView, view: SceneView, shown: ShownPicture
    ) -> tuple[Hashable, ShownPicture]:
        full = min(MAX_PICTURE_WIDTH / view.width, 1.0)
        full_size = picture_size(view.width, view.height, full)
        timeline, now_s = session.timeline, time.perf_counter()
        is_loaded_first = Course.of(timeline).is_loaded_first
        is_hurried = self._moving_size.is_hurried(
            timeline.frame_index, now_s, is_playing=timeline.is_playing, is_loaded_first=is_loaded_first
        )
        is_quick = is_hurried or view.is_moving
        share = full * (self._moving_size.share if is_quick else 1.0)
        self._asked_sizes = picture_size(view.width, view.height, share), full_size
        picture = session.request_render(*self._asked_sizes[0], full_size=full_size)
        if picture is None:
            self._picture_key = None
            return None, shown
        if self._picture.set(picture.image, key=picture.key) and picture.duration_s > 0:
            self._moving_size.note_picture(picture.size[0] / full_size[0], picture.duration_s * 1e3)
        self._picture.fit((view.width, view.height))
        self._picture_key, self._values = picture.key, picture.values
        is_coarse = is_quick and picture.size[0] < full_size[0] and not timeline.is_playing
        return picture.key, replace(
            shown,
            kind=RENDERED,
            source=picture.source,
            size=picture.size,
            full_size=full_size,
            is_on_its_way=picture.is_stale or is_coarse,
        )

    def _take_gaussians(
        self, session: SessionView, view: SceneView, shown: ShownPicture
    ) -> tuple[Hashable, ShownPicture]:
        gaussians, wanted = session.shown_gaussians(), session.wanted_frame()
        if gaussians is None:
            return None, shown
        before = self._splats.drawn
        is_of_another_project = isinstance(before, GaussianArrays) and _project_of(before) != _project_of(gaussians)
        self._splats.upload(gaussians, at_once=is_of_another_project)
        self._splats.update()
        assert isinstance(self._splats.drawn, GaussianArrays)
        gaussians = self._splats.drawn  # the last ones, until those were sorted
        self._near = gaussians.near_plane
        shown = replace(
            shown,
            kind=RENDERED,
            source=replace(gaussians.source, camera_index=shown.source.camera_index, look=shown.source.look),
        )
        is_current = wanted is None or (shown.is_of(wanted) and shown.source.revision == wanted.revision)
        return gaussians.key, replace(shown, is_on_its_way=not is_current)

    def _take_points(self, session: SessionView) -> Hashable:
        cloud = session.shown_points()
        if cloud is None:
            return None
        points, colors, key = cloud
        if len(points) == 0:
            return None
        self._cloud.set(points, colors, key=key)
        self._cloud_kind = _CLOUD_KINDS[cloud.kind]
        if cloud.is_hint and len(points) > 1:  # pictures as grids: as large as the gap between neighbours
            self._point_size = 1.8 * float(np.linalg.norm(points[1] - points[0]))
        else:
            self._point_size = CLOUD_OVERLAP * cloud.spacing
        return key

    def value_at(self, x: float, y: float) -> float | None:
        """The number that the picture's colour stands for at a place; None where nothing is, and where colours are no
        numbers.

        Args:
            x, y: As shares of the picture's width and height, from its upper left corner.
        """
        if self._values is None or not (0.0 <= x < 1.0 and 0.0 <= y < 1.0):
            return None
        height, width = self._values.shape
        value = float(self._values[int(y * height), int(x * width)])
        return None if np.isnan(value) else value

    def anchor_text(self, session: SessionView, view: SceneView, x: float, y: float) -> str:
        """Role of the anchor under a pixel of the view, and its reason; empty where none is shown or that is unknown.
        The anchor stands out from the next frame on."""
        found = self.marks.anchor_under(session, view, x, y, max(self._near, view.near))
        text = "" if found is None else found[0].text(found[1], session.regions.regions)
        self.marks.pointed_anchor = found[0].positions[found[1]] if found is not None and text else None
        return text

    def point_under(self, session: SessionView, view: SceneView, x: float, y: float) -> np.ndarray | None:
        """The place under a pixel of the view: of the anchor there if anchors are shown, else of what one sees there;
        None where there is nothing. Scene units. [3]"""
        near = max(self._near, view.near)
        found = self.marks.anchor_under(session, view, x, y, near)
        if found is not None:
            return found[0].positions[found[1]].astype(np.float64)
        gaussians = session.shown_gaussians()
        if gaussians is not None:
            return seen_point(gaussians, *pixel_ray(view.world_to_camera, view.K, x, y, start=view.near))
        cloud = session.shown_points() if session.overlays.show_points else None
        if cloud is not None and not cloud.is_hint:
            row = nearest_under(cloud.points, view.world_to_camera, view.K, x, y, near=near)
            if row is not None:
                return cloud.points[row].astype(np.float64)
        return None

    def _draw(
        self, view: SceneView, base_key: Hashable, points_key: Hashable, captured_key: Hashable, session: SessionView
    ) -> None:
        camera = (view.world_to_camera, view.K, view.width, view.height)
        target = self._target
        target.clear(BACKGROUND)
        if base_key is not None:
            if self._is_picture:
                target.draw_image(self._picture)
            else:
                self._splats.draw(target, *camera, max(self._near, view.near))
        elif points_key is not None:
            unit: Literal["px", "world"]
            size, unit = (self._point_size, "world") if self._point_size > 0 else (self._cloud_point_px(view), "px")
            # A picture that stands right before the eye would hide all the others.
            near = HINT_NEAR_SHARE * session.view.distance if self._cloud_kind == HINT else NEAR
            self._cloud.draw(
                target, *camera, max(near, view.near), shape="circle", size=size, unit=unit, is_depth_tested=True
            )
        elif captured_key is not None:
            target.draw_image(self._captured)
        self._anchor_heat.draw(target, view, session.overlays.heat_opacity, self.marks.pixels_per_unit)
        self.explaining.draw(target, view, self.marks.pixels_per_unit)
        self.selection.draw(target, view)
        self.objects.draw(target)
        self.marks.draw(target, view, session)
        self.regions.draw(target, view.camera)
        self.path.draw(target, view, session)
        target.resolve(BACKGROUND)

    def _cloud_point_px(self, view: SceneView) -> float:
        """Fewer points are drawn larger, so that a thin cloud still reads as surfaces."""
        per_point_px2 = view.width * view.height / max(len(self._cloud), 1)
        return float(np.clip(0.45 * np.sqrt(per_point_px2), 2.0, 5.0))


def _project_of(gaussians: GaussianArrays) -> Hashable:
    """Frames of two projects differ in the first part of their keys; in a mode that lies in another key."""
    key = gaussians.key
    while isinstance(key, tuple):
        key = key[0]
    return key
