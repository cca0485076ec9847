"""Connecting this process with a Ray cluster by its address, or starting one on this computer."""

from __future__ import annotations

import os
import re
import secrets
import socket
import threading
from contextlib import ExitStack
from typing import Any

from app.cluster.ray_library import ray_library
from engine.children.folder import child_folder
from engine.errors import EngineError, ProjectError, TrainingError
from engine.parallel import n_cores

AUTO = "auto"
_LOCAL = re.compile(r"local:(\d{1,5})")
_ADDRESS = re.compile(r"(?P<host>[^:/\s]+|\[[0-9a-fA-F:]+\]):(?P<port>\d{1,5})")
REACH_TIMEOUT_S = 5.0
CONNECT_TIMEOUT_S, START_TIMEOUT_S = 15.0, 90.0
STORE_BYTES = 80 << 20
"""Of Ray's object store where we start it: messages and parts of files pass through it, nothing stays."""
_MAX_TEMPORARY = 40
"""Characters: names of sockets below a longer folder are too long for the system."""


def connect(address: str, kept: ExitStack) -> None:
    """Connect this process with a cluster, or start one on this computer.

    Args:
        kept: Takes over what has to go at the end.
    Raises:
        ProjectError: The address is wrong, or nothing runs there.
        TrainingError: It does not answer.
    """
    check_address(address)
    options: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    local = _LOCAL.fullmatch(address)
    if local is not None:
        options |= _local_options(int(local[1]), kept)
    else:
        options["address"] = address
        if address != AUTO:
            _check_reachable(address)
    try:
        _init(address, options, START_TIMEOUT_S if local is not None else CONNECT_TIMEOUT_S, kept)
    except EngineError:
        raise
    except Exception as error:
        raise _refused(address, error) from error


def check_address(address: str) -> None:
    """Check that an address is one of a cluster, wherever that is. Raises ProjectError."""
    if address != AUTO and not _LOCAL.fullmatch(address) and not _ADDRESS.fullmatch(address):
        raise ProjectError(
            f"--cluster is '{address}', which is not the address of a cluster.",
            hint="Write auto, HOST:PORT, or local:N for N at once on this computer.",
        )


def _init(address: str, options: dict[str, Any], timeout_s: float, kept: ExitStack) -> None:
    """On a thread of its own, since something else than Ray may answer, for which it waits for minutes and hears no
    signal. The thread lives as long as the cluster: processes that Ray starts end with the thread that started them."""
    failed: list[Exception] = []
    is_ready, is_over = threading.Event(), threading.Event()

    def work() -> None:
        try:
            ray_library().init(**options)
        except Exception as error:  # noqa: BLE001 - handed to the thread that waits
            failed.append(error)
        is_ready.set()
        is_over.wait()

    kept.callback(is_over.set)
    threading.Thread(target=work, name="connection", daemon=True).start()
    if not is_ready.wait(timeout_s):
        raise TrainingError(
            f"No Ray cluster answers at {address} within {timeout_s:.0f} s.",
            hint="Check the address and, where the cluster asks for one, the token (RAY_AUTH_TOKEN_PATH).",
        )
    if failed:
        raise failed[0]


def _local_options(n: int, kept: ExitStack) -> dict[str, Any]:
    """Options to start Ray here: nobody else reaches it, and nobody without the token is heard."""
    if n < 1:
        raise ProjectError("--cluster local:0 has no cores.", hint="Write local:N with N from 1.")
    folder = kept.enter_context(child_folder("clipgstream-ray-", what="The folder of the cluster"))
    token = folder / "token"
    descriptor = os.open(token, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
    with open(descriptor, "w", encoding="ascii") as file:
        file.write(secrets.token_hex(32))
    os.environ |= {
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN_PATH": str(token),
        "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",  # so that Ray uses 127.0.0.1, on every system
    }
    os.environ.pop("RAY_AUTH_TOKEN", None)
    os.environ.pop("RAY_ADDRESS", None)
    return {
        "address": "local",
        "num_cpus": min(n, n_cores()),
        "include_dashboard": False,
        "object_store_memory": STORE_BYTES,
        "_node_ip_address": "127.0.0.1",
        "_temp_dir": str(folder) if len(str(folder)) <= _MAX_TEMPORARY else None,
    }


def _check_reachable(address: str) -> None:
    """Raises TrainingError where nothing listens: Ray itself would try for minutes."""
    match = _ADDRESS.fullmatch(address)
    assert match is not None
    try:
        socket.create_connection((match["host"].strip("[]"), int(match["port"])), timeout=REACH_TIMEOUT_S).close()
    except (OSError, OverflowError) as error:
        raise TrainingError(
            f"The cluster at {address} cannot be reached ({getattr(error, 'strerror', None) or error}).",
            hint="Check that it runs, and that no firewall is in between.",
        ) from error


def _refused(address: str, error: Exception) -> EngineError:
    text = str(error).strip().splitlines()
    said = text[0].rstrip(".") if text else type(error).__name__
    if isinstance(error, ConnectionError) and address == AUTO:
        return ProjectError(
            "No Ray cluster runs on this computer.",
            hint="Start one with `ray start`, name one as HOST:PORT, or write local:N.",
        )
    if "version" in said.lower() and "mismatch" in str(error).lower():
        return ProjectError(f"The cluster at {address} has another version of Ray or Python ({said}).")
    return TrainingError(f"The cluster at {address} could not be joined ({said}).", hint="See docs/cluster.md.")
