"""The process that mends: `python -m app.mending.child JOB.json RESULT.json BEAT`. Nothing here draws anything."""

from __future__ import annotations

import json
import logging
from contextlib import suppress
from pathlib import Path

import msgspec

from app.background.kernels import use_threads
from app.background.logs import start_logging
from app.background.priority import lower_process
from app.mending.carry_out import mend
from app.mending.request import MendJob, MendResult
from engine.children.child import serve
from engine.errors import EngineError
from engine.kernels.cache import use_kernel_cache
from engine.progress import Progress

logger = logging.getLogger(__name__)
PROGRESS = "progress.json"


def main(job: Path, result: Path) -> None:
    """Mend what the job names; leave drafts of clips and a record, or what was wrong."""
    request = msgspec.json.decode(job.read_bytes(), type=MendJob)
    if request.is_window_open:
        lower_process()  # before any thread is started, since threads take over the priority
    start_logging()
    use_kernel_cache()  # before kernels are imported
    use_threads(request.n_threads)
    try:
        outcome = mend(request, _Teller(job.with_name(PROGRESS)).tell)
    except EngineError as error:
        outcome = MendResult(None, {}, *error.told_apart())
    except MemoryError:
        outcome = MendResult(None, {}, "There is not enough memory.", "Close other programs.")
    except Exception as error:  # the edge of the process
        logger.exception("mending has failed")
        outcome = MendResult(None, {}, f"Mending has failed ({type(error).__name__}: {error}).", "The log has more.")
    unfinished = result.with_name("result.partial")
    unfinished.write_bytes(msgspec.json.encode(outcome))
    unfinished.replace(result)


class _Teller:
    """Leaves progress beside the job, for the parent to read."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def tell(self, progress: Progress) -> None:
        document = {"stage": progress.stage, "done": progress.done, "message": progress.message}
        unfinished = self._path.with_name("progress.partial")
        with suppress(OSError):
            unfinished.write_text(json.dumps(document))
            unfinished.replace(self._path)


if __name__ == "__main__":
    serve(main)
