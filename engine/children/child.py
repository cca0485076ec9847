"""The child's side of engine.children.running: it shows that it works, and ends with the process that started it."""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from engine.kernels.parent import end_with_parent


def serve(main: Callable[[Path, Path], None]) -> None:
    """Call main(job, result) with the paths of the command line. Never imported by what starts it."""
    job, result, beat = (Path(part) for part in sys.argv[1:4])
    threading.Thread(target=_beat, args=(beat,), daemon=True).start()
    end_with_parent(lambda: shutil.rmtree(job.parent, ignore_errors=True))
    main(job, result)


def _beat(path: Path) -> None:
    """Touch a file for as long as this process works, so that the parent can tell work from standing still."""
    worked_s = 0.0
    while True:
        time.sleep(1.0)
        if (now_s := time.process_time()) > worked_s + 0.005:
            worked_s = now_s
            with suppress(OSError):
                path.touch()
