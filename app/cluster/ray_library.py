"""Ray, which is an extra: imported once it is used, and never before its settings are made."""

from __future__ import annotations

import importlib.util
import logging
import os
from typing import Any

from engine.errors import ProjectError

logger = logging.getLogger(__name__)


def ray_library() -> Any:
    """The module.

    Raises:
        ProjectError: It is not installed.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # it would report to its makers
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")  # or it warns about graphics cards
    os.environ["RAY_ENABLE_AUTO_CONNECT"] = "0"  # a call after the end would start a cluster of its own
    check_ray()
    import ray
    import ray.exceptions

    logging.getLogger("ray").setLevel(logging.ERROR)  # what it has to say comes as an error
    import ray._private.worker

    # pages about every process that ended, on the terminal; no setting turns them off
    ray._private.worker.print_to_stdstream = lambda data, ignore_prefix=False: logger.debug("Ray says %s", data)
    return ray


def check_ray() -> None:
    """Check that Ray is installed, without importing it: it reads its settings then. Raises ProjectError."""
    if importlib.util.find_spec("ray") is None:
        raise ProjectError("Ray is not installed.", hint="Install it with: pip install clipgstream[cluster]")
