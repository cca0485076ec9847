"""The job that writes a player: trained frames as one HTML page, or as a page that streams a folder of data."""

from __future__ import annotations

import html
import math
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from app.export.edits.written_edits import written_edits
from app.export.expected_rows import expected_rows
from app.export.export_progress import ExportEstimate, ExportProgress, ExportResult, Report
from app.export.jobs.player import PlayerJob
from app.export.player_scene import poster, scene_header
from app.export.scene_frames import SceneFrames
from app.export.staging import check_target, staged_file, staged_folder
from app.export.take import TakeFrame, take_frames, timing_of
from engine.capture.clip import Clip
from engine.editing.gaussian_rows import RowSet
from engine.errors import ProjectError
from engine.export.player.blocks import Block, Packer
from engine.export.player.moving_rows import NamedRows
from engine.export.player.page import page_bytes, page_writer
from engine.export.player.row_coding import COMPACT
from engine.export.player.seen_weights import UNSEEN, SeenWeights
from engine.export.player.stage import Stage, stage_of
from engine.export.splats import Splats

if TYPE_CHECKING:
    from app.evaluation.headless import TrainedProject

LARGEST_PAGE_BYTES = 150_000_000
"""Above this, browsers are slow to open a single file: the data goes into a folder unless one file is asked for."""
PAGE_SUFFIXES = (".html", ".htm")
_DESCRIBED_BYTES = 400
"""Bytes of a page's description of a clip, about."""
_POSTER_BYTES = 12_000
_SHARED_ROW_BYTES, _LIGHT_ROW_BYTES = 10.5, 0.5
"""Of a Gaussian that stands still, once, and of the light on it, per clip."""
_FINE_ROW_BYTES, _COMPACT_ROW_BYTES = 7.0, 3.8
"""Per frame, of those that move in the frame with most of them. As measured on trained captures, where many are too
faint to be written."""


def estimate(opened: TrainedProject, job: PlayerJob) -> ExportEstimate:
    """Estimate what will be written. Reads no more than the headers of the clips.

    Raises:
        ProjectError: The target cannot be written, or a frame is not trained.
    """
    if job.out.suffix.lower() not in PAGE_SUFFIXES:
        raise ProjectError("A player is an HTML page.", hint="Give a name that ends in .html.", path=job.out)
    check_target(job.out, opened=opened)
    scene = _scene(opened, job)
    clips, played = _clips(scene, job)
    n_frames = sum(len(wanted) for _, wanted in clips)
    n_bytes = _expected_bytes(scene, clips, has_folder=False)
    has_folder = n_bytes > LARGEST_PAGE_BYTES if job.has_folder is None else job.has_folder
    if has_folder:
        n_bytes = _expected_bytes(scene, clips, has_folder=True)
    lines = [f"About {n_bytes / 1e6:.1f} MB for {n_frames if played is None else len(played)} frames."]
    if has_folder:
        lines.append(f"The clips go into the folder {job.folder.name}, which must stay next to the page.")
        _check_folder(job.folder)
    check_target(job.out, n_bytes=n_bytes)
    return ExportEstimate(2 * len(clips) + 3 if has_folder else 1, n_bytes, tuple(lines))


def run(opened: TrainedProject, job: PlayerJob, report: Report) -> ExportResult:
    """Write the player, clip by clip.

    Raises:
        ProjectError: As `estimate`.
        DiskError: The disk refused; nothing is left behind.
        Unwanted: From `report`; nothing is left behind.
    """
    report(ExportProgress(0, 0, message="Reading clips"))
    expected = estimate(opened, job)
    has_folder = expected.n_files > 1
    scene = _scene(opened, job)
    clips, played = _clips(scene, job)
    scene.check(moment.frame for _, wanted in clips for one in wanted for moment in one.moments)
    n_frames = sum(len(wanted) for _, wanted in clips)
    header: dict[str, Any] = scene_header(scene, clips[0][1][0].frame, step=_step(job))
    header["stage"] = _stage(scene, clips[0][1][0], header["radius"])
    header["take"] = played
    header["folder"] = _relative_url(job.folder.name) if has_folder else None
    weigh = SeenWeights.of(opened.rig, header["near_plane"], opened.backend)
    packer = Packer(COMPACT, weigh=weigh, unseen=UNSEEN) if has_folder else Packer(weigh=weigh)
    n_done, n_bytes = 0, 0
    first = clips[0][1][0] if played is None else _at(clips, played[0])
    with ExitStack() as stack:
        page, folder = stack.enter_context(_staged(job, has_folder=has_folder))
        stream = stack.enter_context(page.open("w", encoding="utf-8", newline="\n"))
        with page_writer(stream, header, folder=folder, poster=poster(scene, first)) as writer:
            for clip, wanted in clips:
                block = _packed(
                    packer, scene, wanted, lambda done, n=n_done: report(ExportProgress(n + done, n_frames))
                )
                n_before = sum(place["clip_index"] == clip.clip_index for place in header["clips"])
                name = f"clip{clip.clip_index:05d}" + (f"-{n_before + 1}" if n_before else "")
                place: dict[str, Any] = {"clip_index": clip.clip_index, "name": name, "first": n_done}
                place["frame_index"] = math.floor(wanted[0].frame)
                header["clips"].append(place)
                place.update(block.description)
                writer.block(name, block)
                n_done += len(wanted)
            assert packer.shared is not None
            header["shared"] = packer.shared.description
            writer.block("shared", packer.shared)
        stream.flush()
        n_bytes = writer.n_bytes_of_blocks * has_folder + page.stat().st_size
        report(ExportProgress(n_frames, n_frames))
    n_files = 2 * len(header["clips"]) + 3 if has_folder else 1
    return ExportResult(job.out, n_files, n_bytes, lines=(f"To embed it: {embedding(job.out.name, header['title'])}",))


def _stage(scene: SceneFrames, one: TakeFrame, radius: float) -> Stage:
    still, moving = (Splats.of(scene.at_moments(one.moments, part)) for part in ("static", "moving"))
    opened = scene.opened
    known = opened.project.document.world.meters_per_unit
    return stage_of(still, moving, up=opened.up, focus=opened.rig.focus_point(), radius=radius, meters_per_unit=known)


def embedding(name: str, title: str) -> str:
    """What a page next to this one writes to show it.

    Args:
        name: Of the file.
        title: Of the scene, for screen readers.
    """
    allowed = 'allow="fullscreen; xr-spatial-tracking"'
    return (
        f'<iframe src="{html.escape(_relative_url(name))}#autoplay" title="{html.escape(title)}" width="960" '
        f'height="600" style="border: 0" {allowed}></iframe>'
    )


def _at(clips: Sequence[tuple[Clip, list[TakeFrame]]], number: int) -> TakeFrame:
    """A frame of the page by its number."""
    return [one for _, wanted in clips for one in wanted][number]


def _expected_bytes(scene: SceneFrames, clips: Sequence[tuple[Clip, list[TakeFrame]]], *, has_folder: bool) -> int:
    """Of page and blocks together, from the headers of the clips."""
    n_packed, row_bytes = 0.0, _COMPACT_ROW_BYTES if has_folder else _FINE_ROW_BYTES
    for number, (clip, wanted) in enumerate(clips):
        n_still, n_moving = expected_rows(scene.opened.header(clip.clip_index))
        n_packed += _LIGHT_ROW_BYTES * n_still + row_bytes * n_moving * len(wanted)
        if number == 0:
            n_packed += _SHARED_ROW_BYTES * n_still
    n_bytes = round(n_packed * (4 / 3 + has_folder))  # as base64, and once more as it is
    about = scene_header(scene, clips[0][1][0].frame, step=1)
    return n_bytes + page_bytes(about) + _POSTER_BYTES + _DESCRIBED_BYTES * len(clips)


def _check_folder(folder: Path) -> None:
    """Check that the folder of data is new or empty: clips of two pages are never mixed. Its place was looked at."""
    try:
        check_target(folder, is_folder=True)
    except ProjectError as error:
        raise ProjectError(
            f"The clips go into the folder {folder.name} next to the page, but this name is already taken.",
            hint=f"Delete {folder.name}, or choose another name for the page.",
            path=folder,
        ) from error


@contextmanager
def _staged(job: PlayerJob, *, has_folder: bool) -> Iterator[tuple[Path, Path | None]]:
    """Where to write the page, and the clips where they have a folder. Both appear when the block ends well, or neither
    does. Raises DiskError."""
    is_in_place = False
    try:
        with staged_file(job.out, what="The player") as page:
            if has_folder:
                with staged_folder(job.folder, what="The player's data") as folder:
                    yield page, folder
                is_in_place = True
            else:
                yield page, None
    except BaseException:
        if is_in_place:  # of no use without the page, and in the way of the next one
            shutil.rmtree(job.folder, ignore_errors=True)
        raise


def _relative_url(name: str) -> str:
    """A name in the page's own folder, as plain letters."""
    return PurePosixPath("/", name).as_uri().removeprefix("file:///")


def _scene(opened: TrainedProject, job: PlayerJob) -> SceneFrames:
    return SceneFrames(opened, edits=written_edits(opened.project.document, job))


def _clips(scene: SceneFrames, job: PlayerJob) -> tuple[list[tuple[Clip, list[TakeFrame]]], list[int] | None]:
    """Clips with the frames of each that are wanted, and of a take which of all these each of its frames is; None as
    captured. A clip comes several times where different edits hold in it, so that still parts are still in each
    stretch, and where frames are left out, so that the number of its first frame is enough to number all. What a take
    plays several times is there once. Raises ProjectError where one is not trained."""
    frames = take_frames(scene, job.frames, has_timing=job.has_timing)
    played: list[int] | None = None
    if timing_of(scene, has_timing=job.has_timing) is not None:
        taken = frames
        once = {one.moments: one for one in reversed(taken)}
        frames = sorted(once.values(), key=lambda one: (scene.clip_at(one.frame).clip_index, one.frame, one.number))
        places = {one.moments: place for place, one in enumerate(frames)}
        played = [places[one.moments] for one in taken]
    clips: list[tuple[Clip, list[TakeFrame]]] = []
    step, before = _step(job), None
    for one in frames:
        clip = scene.clip_at(one.frame)
        is_next = before is not None and clips[-1][0] == clip and (played or one.number == before.number + step)
        if before is None or not is_next or scene.effects(before.frame) != scene.effects(one.frame):
            clips.append((clip, []))
        clips[-1][1].append(one)
        before = one
    return clips, played


def _step(job: PlayerJob) -> int:
    return job.frames.step if job.frames is not None else 1


def _packed(
    packer: Packer, scene: SceneFrames, wanted: list[TakeFrame], told: Callable[[int], None] = lambda n_done: None
) -> Block:
    """A clip's block. told: Called before each frame is made, with the number of frames made."""
    sets: dict[RowSet, int] = {}

    def moving(frame: int) -> NamedRows:
        told(frame)
        moments = wanted[frame].moments
        only, *others = moments
        if others:
            return NamedRows(Splats.of(scene.at_moments(moments, "moving")))
        edited = scene.edited(only.frame, "moving")
        splats, rows = Splats.of(edited.gaussians), edited.rows
        if splats.n_dropped:
            return NamedRows(splats)
        numbers = np.array([sets.setdefault(one, len(sets)) for one in rows.sets], np.int64)
        return NamedRows(splats, (numbers[rows.set_index] << 32) + rows.number)

    return packer.clip(len(wanted), lambda frame: Splats.of(scene.gaussians(wanted[frame].frame, "static")), moving)
