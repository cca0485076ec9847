"""FrameDecoder: a frame of a trained clip as arrays to draw. Loads states and decodes on one thread; keeps results by
key.

A key is (generation, path, clip_index, revision, changes, shown_as, frame_index). The generation goes up when another
project is opened: results for the previous one are dropped. A new revision of a live clip makes its older
frames worthless. Changes are the effects of edits that hold at the frame, and copies of objects that are there, with
the states of the clips that they come from: another edit makes only its own frames anew.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.background.kernels import prepare_decoding
from app.background.latest import LatestWorker, nothing
from app.playback.modes.arrays import AnchorArrays, GaussianArrays
from app.playback.modes.contents import EditedParts
from app.playback.modes.view_modes import ALL, PLAIN, ShownAs
from app.playback.picture_source import UNKNOWN, PictureSource
from engine.backends.table import process_backend
from engine.byte_cache import ByteCache
from engine.capture.clip import Clip
from engine.clip_files.clip_state import ClipState, read_clip_state
from engine.editing.copies.copy_moments import NOTHING_COPIED, FrameCopies
from engine.editing.copies.object_copy import nearest_frame
from engine.editing.effects import NO_EFFECTS, Effects

if TYPE_CHECKING:
    from engine.backends.backend import Backend
    from engine.editing.copies.copied import Copier
    from engine.editing.edited_clip import EditedGaussians
    from engine.metrics.clips.trained_clip import TrainedClip
    from engine.model.camera_colors import CameraColors
    from engine.model.clip_model import AnchorView, ClipModel  # brings torch, which only the thread needs

CACHE_BYTES = 384 << 20
"""Decoded frames kept in memory."""
MAX_MODELS = 6
"""Loaded clips kept in memory, some megabytes each: those around the playhead, and versions to compare with."""


ModelKey = tuple[int, str, int, str]
"""generation, path, clip_index, revision"""
FrameKey = tuple[int, str, int, str, str, ShownAs, int]
"""the same, digest of the changes, the decoded contents, and frame_index"""


@dataclass(frozen=True, slots=True)
class FrameRequest:
    """A frame of one state of a clip.

    Attributes:
        revision: Names the state; with the file, clip and frame it is the identity of the result.
        path, reference_path: Files to load when the model is not loaded yet.
        clip: For the conversion to clip time.
        is_live: Whether the file is a snapshot of a running training: it may be gone before it is read, and another
            one follows soon.
        generation: Of the open project.
        shown_as: The mode and content to decode; see app.playback.modes.view_modes.decoded_as.
        effects: Of the edits that hold at the frame.
        copies: Of objects, at the frame.
        sources: A frame of each clip that copies come from; those that are not trained are missing.
    """

    clip_index: int
    revision: str
    frame_index: int
    path: Path
    generation: int
    reference_path: Path | None = field(compare=False)
    clip: Clip = field(compare=False)
    is_live: bool = field(default=False, compare=False)
    shown_as: ShownAs = PLAIN
    effects: Effects = NO_EFFECTS
    copies: FrameCopies = NOTHING_COPIED
    sources: tuple[FrameRequest, ...] = ()

    @property
    def model_key(self) -> ModelKey:
        """Identity of the model."""
        return self.generation, str(self.path), self.clip_index, self.revision

    @property
    def key(self) -> FrameKey:
        """Identity of the result."""
        changes = changes_digest(self.effects, self.copies, self.sources)
        return *self.model_key, changes, self.shown_as, self.frame_index

    def source_at(self, frame: float) -> FrameRequest | None:
        """The request among `sources` for the clip that shows a moment; None where it is not trained."""
        shown = nearest_frame(frame)
        return next((one for one in self.sources if one.clip.start <= shown < one.clip.stop), None)


def changes_digest(effects: Effects, copies: FrameCopies, sources: Sequence[FrameRequest]) -> str:
    """The same where edits and copies leave the same of a frame. The arguments are those of a FrameRequest."""
    if not copies:
        return effects.digest
    states = sorted((str(one.path), one.revision) for one in sources)
    return f"{effects.digest} {copies.digest} {states}"


WithCopies = Callable[["EditedGaussians", FrameRequest], "EditedGaussians"]
"""Adds the copies of a request to its decoded frame."""


@dataclass(frozen=True, slots=True)
class LoadedClip:
    """A model in memory and its parts.

    Attributes:
        colors: The cameras' rendition of the scene's colours; None where unknown.
        trained: The clip as cameras see it; None in the same case.
        parts: Its parts that can be decoded apart.
    """

    model: ClipModel
    parts: EditedParts
    anchors: AnchorArrays
    near_plane: float
    step: int | None = None
    colors: CameraColors | None = None
    trained: TrainedClip | None = None


@dataclass(frozen=True, slots=True)
class ShownFrame:
    """The drawn contents of a frame: Gaussians, and the anchors that exist then."""

    gaussians: GaussianArrays
    anchors: AnchorArrays


class ClipFiles:
    """Reads states of clips. For one thread; the reference clip, which all of them need, is read once."""

    def __init__(self) -> None:
        self._reference: tuple[tuple[str, int], ClipState] | None = None

    def read(self, request: FrameRequest, backend: Backend) -> LoadedClip:
        """The clip of a request, to be decoded and drawn with a back end.

        Raises:
            ProjectError: The file is missing or damaged, or does not fit its reference.
        """
        from engine.metrics.clips.trained_clip import TrainedClip
        from engine.model.reading import load_clip_model

        state = read_clip_state(request.path)
        reference = None if state.is_reference else self._read_reference(request.reference_path)
        model = load_clip_model(state, reference, backend=backend)
        header = state.header
        spacing = min(header.spacing, header.moving_spacing or header.spacing)
        anchors = _anchor_arrays(model.anchors(), request.model_key, spacing)
        trained = TrainedClip.of_state(request.clip, model, state, reference)
        colors, parts = None if trained is None else trained.colors, EditedParts(model, request.clip, state, reference)
        return LoadedClip(model, parts, anchors, header.near_plane, header.step, colors, trained)

    def _read_reference(self, path: Path | None) -> ClipState | None:
        if path is None or not path.is_file():
            return None
        identity = (str(path), path.stat().st_mtime_ns)
        if self._reference is None or self._reference[0] != identity:
            self._reference = (identity, read_clip_state(path))
        return self._reference[1]


class FrameDecoder:
    """Frames to arrays on one thread; the newest request wins. Methods are for one other thread."""

    def __init__(self, *, cache_bytes: int = CACHE_BYTES) -> None:
        self._cache: ByteCache[FrameKey, ShownFrame] = ByteCache(cache_bytes)
        self._models: OrderedDict[ModelKey, LoadedClip] = OrderedDict()
        self._files = ClipFiles()
        self._copier: Copier | None = None
        self._loading: ModelKey | None = None
        self._last: dict[int, ShownFrame] = {}  # of the open project, and of one that it is compared with
        self._frame_bytes = 0  # of the newest one
        self.on_frame: Callable[[], None] = nothing
        self.worker: LatestWorker[FrameRequest, ShownFrame] = LatestWorker(
            "playback", self._compute, prepare=prepare_decoding, on_done=lambda: self.on_frame()
        )

    def keep_megabytes(self, megabytes: int | None) -> None:
        """Limit the frames kept, in megabytes, from the next one on; None for the default."""
        self._cache.max_bytes = CACHE_BYTES if megabytes is None else megabytes << 20

    def frame(self, request: FrameRequest) -> ShownFrame | None:
        """The frame if it is ready; otherwise it is asked for and the newest finished one of the project is returned.

        The result states its frame and clip.
        """
        project, known = request.generation, self._cache.get(request.key)
        if known is None:
            self.worker.request(request)
            newest = self.worker.newest
            known = newest[1] if newest is not None and newest[0].generation == project else self._last.get(project)
        if known is not None:
            self._last.pop(project, None)
            self._last = dict([*self._last.items()][-1:]) | {project: known}
        return known

    def known(self, key: FrameKey) -> ShownFrame | None:
        """A frame that is ready; nothing is asked for."""
        return self._cache.get(key)

    def is_ready(self, key: FrameKey) -> bool:
        """Whether a frame can be shown at once."""
        return key in self._cache

    def ready_keys(self) -> list[FrameKey]:
        """All frames that can be shown at once."""
        return self._cache.keys()

    @property
    def revision(self) -> int:
        """Another number whenever other frames are ready."""
        return self._cache.revision

    @property
    def n_that_fit(self) -> int:
        """Number of frames like the newest one that can be kept."""
        return max(self._cache.max_bytes // max(self._frame_bytes, 1), 1)

    def plan(self, requests: Sequence[FrameRequest], distance: Callable[[FrameKey], float]) -> None:
        """Decode these, in this order, while nothing is asked for.

        Args:
            distance: How far off it is that a frame is shown; the farthest go when memory is needed.
        """
        self._cache.distance = distance
        self.worker.plan([request for request in requests if request.key not in self._cache])

    def anchors(self, request: FrameRequest) -> AnchorArrays | None:
        """All anchors of a state; None until it was loaded."""
        loaded = self._models.get(request.model_key)
        return None if loaded is None else loaded.anchors

    def model(self, request: FrameRequest) -> ClipModel | None:
        """The model of a state, not to be decoded on another thread but in parts (see `part_of`); None until it
        was loaded."""
        loaded = self._models.get(request.model_key)
        return None if loaded is None else loaded.model

    def colors(self, request: FrameRequest) -> CameraColors | None:
        """The cameras' rendition of the scene's colours in a state; None until it was loaded, or where unknown."""
        loaded = self._models.get(request.model_key)
        return None if loaded is None else loaded.colors

    def loaded(self, request: FrameRequest) -> LoadedClip | None:
        """The clip of a request if it is in memory. May be asked on any thread."""
        return self._models.get(request.model_key)

    def is_loading(self, request: FrameRequest) -> bool:
        """Whether the clip of a request is being read right now. May be asked on any thread."""
        return self._loading == request.model_key

    def is_loaded(self, request: FrameRequest) -> bool:
        """Whether the file of this state is no longer needed."""
        return request.model_key in self._models

    def has_failed(self, request: FrameRequest) -> bool:
        """Whether this frame could not be made, so that it is not on its way."""
        return self.worker.has_failed(request)

    def comes_ahead(self, request: FrameRequest) -> bool:
        """Whether this frame can be made ready before it is asked for, as far as is known."""
        return not (self.worker.has_failed(request) or self.worker.has_failed_ahead(request))

    def clear(self) -> None:
        """Forget everything, as when another capture was opened."""
        self.worker.forget()  # first: from here on the thread keeps nothing of its present work
        self._cache.clear()
        self._models = OrderedDict()
        self._files, self._copier = ClipFiles(), None
        self._last = {}

    def close(self) -> None:
        """End the thread."""
        self.worker.close()

    # ---------------------------------------------------------------- on the thread

    def _compute(self, request: FrameRequest) -> ShownFrame:
        known = self._cache.get(request.key)
        if known is not None:  # it was asked for and planned
            return known
        loaded = self._load(request)
        shown = decode_frame(loaded, request, self._with_copies)
        arrays, anchors = shown.gaussians, shown.anchors
        if self.worker.is_still_wanted:
            n_bytes = arrays.n_bytes + anchors.inherited_positions.nbytes + anchors.own_positions.nbytes
            self._frame_bytes = n_bytes
            self._cache.put(request.key, shown, n_bytes)
        return shown

    def _with_copies(self, edited: EditedGaussians, request: FrameRequest) -> EditedGaussians:
        if self._copier is None:
            from engine.editing.copies.copied import Copier

            self._copier = Copier()
        return add_copies(self._copier, edited, request, self._load)

    def _load(self, request: FrameRequest) -> LoadedClip:
        identity = request.model_key
        models = self._models
        if identity in models:
            models.move_to_end(identity)
            return models[identity]
        self._loading = identity
        try:
            loaded = self._files.read(request, process_backend())
        finally:
            self._loading = None
        if not self.worker.is_still_wanted:
            return loaded
        # another revision of the same file is worthless now; another file may be a version that it is compared with
        self._cache.drop(lambda key: key[:3] == identity[:3] and key[3] != request.revision)
        kept = [(key, value) for key, value in models.items() if key[:3] != identity[:3]]
        # replaced as a whole, so that the other thread never sees it half changed
        self._models = OrderedDict([*kept[-(MAX_MODELS - 1) :], (identity, loaded)])
        return loaded


def add_copies(
    copier: Copier, edited: EditedGaussians, request: FrameRequest, load: Callable[[FrameRequest], LoadedClip]
) -> EditedGaussians:
    """A decoded frame and its copies of objects, except in still parts. load: Gives a clip that copies come from."""
    from engine.editing.copies.copied import CopySource

    content = request.shown_as.content
    if content == "static":
        return edited
    part = content if content in ("f_s", "f_d") else ALL

    def clip_at(frame: float) -> CopySource | None:
        source = request.source_at(frame)
        if source is None:
            return None
        return CopySource((source.model_key, part), lambda: load(source).parts.part(part))

    return copier.with_copies(edited, request.copies, clip_at)


def decode_frame(loaded: LoadedClip, request: FrameRequest, with_copies: WithCopies | None = None) -> ShownFrame:
    """Decode a frame of a clip in memory, with the edits of the request.

    Args:
        with_copies: Adds the copies of the request; None leaves them out.
    """
    from engine.model.host_array import host_array

    clip_time = request.clip.clip_time(request.frame_index)
    content = request.shown_as.content
    edited = loaded.parts.part(content).decode(clip_time, request.effects)
    if request.copies and with_copies is not None:
        edited = with_copies(edited, request)
    source = PictureSource(
        request.clip_index,
        request.frame_index,
        request.revision,
        loaded.step,
        loaded.model.field is None,
        shown_as=ShownAs(content=content),
    )
    if request.effects:
        view = loaded.model.anchors().chosen(*loaded.parts.has_left(edited, content))
    else:
        view = loaded.model.anchors(clip_time)
    anchors = _anchor_arrays(view, request.key, loaded.anchors.spacing, source)
    values = [np.ascontiguousarray(host_array(tensor)) for tensor in edited.gaussians.tensors()]
    has_changes = request.shown_as.mode == "changed"
    arrays = GaussianArrays(
        *values,
        key=request.key,
        near_plane=loaded.near_plane,
        source=source,
        n_still=edited.n_still,
        still_key=(request.model_key, content, request.effects.digest),
        births=loaded.parts.births(edited.rows),
        changes=loaded.parts.changes(edited.gaussians, edited.rows) if has_changes else None,
        rows=edited.rows,
    )
    return ShownFrame(arrays, anchors)


def _anchor_arrays(view: AnchorView, key: Hashable, spacing: float, source: PictureSource = UNKNOWN) -> AnchorArrays:
    return AnchorArrays(
        np.ascontiguousarray(view.inherited_positions, np.float32),
        np.ascontiguousarray(view.own_positions, np.float32),
        key,
        inherited_roles=view.inherited_roles,
        own_roles=view.own_roles,
        inherited_reasons=view.inherited_reasons,
        own_reasons=view.own_reasons,
        source=source,
        spacing=spacing,
        has_changing_static=view.has_changing_static,
    )
