"""A server of a folder, for pages that fetch ranges: it can lack them, fail, wait, and remember what was asked for."""

from __future__ import annotations

import re
import threading
import time
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

TYPES = {".html": "text/html; charset=utf-8", ".js": "text/javascript", ".bin": "application/octet-stream"}

PAUSE_S = 0.01


class RangeServer:
    """Serves a folder on a free port of this machine. A context manager.

    Attributes:
        has_ranges: Whether it knows ranges; otherwise it sends whole files.
        failing: How often each file of this name still ends in an error.
        failure: The status of these.
        held: By file name, what requests wait for before they are answered.
        piece_bytes: What is sent at once, with a pause after each piece; None to send all at once.
        asked: File name and Range of every request, in order.
        n_sent: Bytes of bodies.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.has_ranges, self.failure = folder, True, 503
        self.failing: dict[str, int] = {}
        self.held: dict[str, threading.Event] = {}
        self.piece_bytes: int | None = None
        self.asked: list[tuple[str, str]] = []
        self.n_sent = 0
        self._server = _Server(("127.0.0.1", 0), partial(_Handler, self))
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True)

    def __enter__(self) -> RangeServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        for event in self.held.values():
            event.set()
        self._server.shutdown()
        self._server.server_close()

    def url(self, name: str) -> str:
        """Address of a file."""
        return f"http://127.0.0.1:{self._server.server_port}/{name}"


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, request: object, client_address: object) -> None:
        """A browser may go away whenever it likes."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def __init__(self, owner: RangeServer, *args: object) -> None:
        self.owner = owner
        super().__init__(*args)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        """Send a file or a range of it."""
        owner, path = self.owner, self.owner.folder / self.path.partition("?")[0].lstrip("/")
        wanted = self.headers.get("Range", "")
        owner.asked.append((path.name, wanted))
        if path.name in owner.held:
            owner.held[path.name].wait()
        if owner.failing.get(path.name, 0) > 0:
            owner.failing[path.name] -= 1
            self.send_error(owner.failure)
            return
        if not path.is_file():
            self.send_error(404)
            return
        data, status = path.read_bytes(), 200
        found = re.fullmatch(r"bytes=(\d+)-(\d+)", wanted) if owner.has_ranges else None
        whole = len(data)
        if found is not None:
            first, last = int(found[1]), int(found[2])
            data, status = data[first : last + 1], 206
        self.send_response(status)
        self.send_header("Content-Type", TYPES.get(path.suffix, "application/octet-stream"))
        self.send_header("Content-Length", str(len(data)))
        if found is not None:
            self.send_header("Content-Range", f"bytes {found[1]}-{int(found[1]) + len(data) - 1}/{whole}")
        self.end_headers()
        try:
            size = owner.piece_bytes or max(len(data), 1)
            for at in range(0, len(data), size):
                self.wfile.write(data[at : at + size])
                time.sleep(PAUSE_S if owner.piece_bytes else 0.0)
            owner.n_sent += len(data)
        except (BrokenPipeError, ConnectionResetError):
            self.close_connection = True

    def log_message(self, format: str, *args: object) -> None:
        """Nobody reads it."""
