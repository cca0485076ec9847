"""What a computer that does not see the project has to have for one clip: files of the capture, and a few of the
project. Never decoded frames."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import blake2b
from pathlib import Path

from msgspec import structs

from app.cluster.mirror import DIGEST_BYTES, file_digest
from app.document.project_document import ProjectDocument
from app.document.storing.document_file import PROJECT_FILE
from app.document.storing.document_store import DocumentStore
from app.project.project import Project
from app.training.messages import TrainJob
from engine.capture.capture import Capture
from engine.capture.files.frame_files import IMAGE_SUFFIXES, VIDEO_SUFFIXES
from engine.capture.frames import FrameSource, ImageFrames, IndexedFrames
from engine.children.messages import encoded
from engine.clip_files.clip_state import read_clip_header
from engine.errors import CaptureError
from engine.training.preparation.cloud_preparation import BACKGROUNDS_FILE

HEAD_BYTES = 4096
"""Of pictures outside of a clip: opening the capture reads how large they are, and who decodes one is told."""
_lock = threading.Lock()


@dataclass(frozen=True, slots=True)
class SentFile:
    """A file, or its beginning.

    Attributes:
        name: Its path on the other side, below the copy's folder.
        path: Where it is here.
        n_bytes: How much of it.
        digest: Hash of that.
    """

    name: str
    path: Path
    n_bytes: int
    digest: str


def contents_of(project: Project, capture: Capture, job: TrainJob, folder: Path, *, is_whole: bool) -> list[SentFile]:
    """All files that a training reads. Reads every file once, to hash it. Raises OSError.

    Args:
        folder: For files that are made for the other side.
        is_whole: Send every picture, not only those of the clip.
    """
    found = [
        _content(f"capture/{name}", path, n_bytes)
        for name, path, n_bytes in _of_capture(capture, job, is_whole=is_whole)
    ]
    files = {f"project/{PROJECT_FILE}": _plain_document(project, folder)}
    for key in filter(None, (job.reference, job.previous)):
        files[f"project/clips/{key}.safetensors"] = project.folder / "clips" / f"{key}.safetensors"
    if job.reference is not None:
        files[f"project/prep/{BACKGROUNDS_FILE}"] = project.prep_dir / BACKGROUNDS_FILE
    return found + [_content(name, path) for name, path in files.items() if path.is_file()]


def progress_contents(project: Project, job: TrainJob) -> tuple[int, list[SentFile]]:
    """Steps of the unfinished training in the project, and its files; -1 and nothing where there is none."""
    files = project.files(job.clip_index)
    header = read_clip_header(files.checkpoint)
    if header is None:
        return -1, []
    found = [path for path in (files.checkpoint, files.unfinished_metrics) if path.is_file()]
    return header.step, [_content(f"project/{path.relative_to(project.folder).as_posix()}", path) for path in found]


def job_key(project: Project, job: TrainJob) -> str:
    """Names a training: the same inputs have the same name, whatever machine and threads it runs with."""
    plain = structs.replace(
        job, is_window_open=False, live_view="off", n_beside=1, n_everywhere=1, n_threads=None, claim=""
    )
    digest = blake2b(encoded(plain), digest_size=DIGEST_BYTES)
    for key in filter(None, (job.reference, job.previous)):
        header = read_clip_header(project.folder / "clips" / f"{key}.safetensors")
        digest.update((header.fingerprint if header is not None else "").encode())
    return digest.hexdigest()


def _plain_document(project: Project, folder: Path) -> Path:
    """A document with the project's settings alone: all else that training heeds is in the job."""
    path = folder / PROJECT_FILE
    if not path.is_file():
        DocumentStore(folder).create(ProjectDocument(replace(project.settings, follow_links=False)))
    return path


def _of_capture(capture: Capture, job: TrainJob, *, is_whole: bool) -> Iterator[tuple[str, Path, int | None]]:
    """Names, places and bytes of a capture's files: media that its cameras use, and all other files."""
    heads, whole, media = set[Path](), set[Path](), set[Path]()
    first = capture.first_frame + job.clip.start
    clip = range(first, first + job.clip.n_frames)
    for camera in capture.layout.cameras:
        for source, is_cut in ((camera.source, not is_whole), (camera.masks, False)):
            if source is None:
                continue
            files = _files_of(source)
            media.update(path for path in files if not capture.is_growing or path.is_file())  # some were lost
            if is_cut and len(files) > 1 and job.reference is not None:
                heads.update(files)
                whole.update(files[frame] for frame in clip)
    heads -= whole
    others = {
        Path(folder, name)
        for folder, _, names in os.walk(capture.path, followlinks=capture.follow_links)
        for name in names
        if Path(name).suffix.lower() not in (*IMAGE_SUFFIXES, *VIDEO_SUFFIXES)
    }
    others = {path for path in others if path.is_file()}
    for path in sorted(media | others):
        if not path.is_relative_to(capture.path):
            raise CaptureError(
                "A file of the capture lies outside of its folder, so that the capture cannot be copied to a computer.",
                hint="Copy the file into the folder, or let all computers see the same folders.",
                path=path,
            )
        yield path.relative_to(capture.path).as_posix(), path, HEAD_BYTES if path in heads else None


def _files_of(source: FrameSource) -> Sequence[Path]:
    """Its files, one per frame, or its only one."""
    if isinstance(source, IndexedFrames):
        files = _files_of(source.source)
        return files if len(files) == 1 else [files[index] for index in source.frame_indices]
    return source.files if isinstance(source, ImageFrames) else [source.path]


def _content(name: str, path: Path, n_bytes: int | None = None) -> SentFile:
    state = path.stat()
    size = state.st_size if n_bytes is None else min(n_bytes, state.st_size)
    with _lock:  # several clips ask for the same files at once
        return SentFile(name, path, size, _digest(path, size, state.st_mtime_ns))


@lru_cache(maxsize=1 << 17)
def _digest(path: Path, n_bytes: int, time_ns: int) -> str:
    return file_digest(path, n_bytes)
