"""Runs the app with granian."""

import os
import socket
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from granian.constants import HTTPModes, Interfaces
from granian.log import LogLevels
from granian.server import Server

from map3d.errors import BadRequest
from map3d.subprocess.limits import die_with_parent
from map3d.web.asgi_app import App, create_app
from map3d.web.tile_route import DEFAULT_CACHE_BYTES

START_TIMEOUT_S: Final = 60.0
BACKLOG: Final = 2048


def serve(
    workspace: Path,
    host: str = "127.0.0.1",
    port: int = 8080,
    *,
    workers: int = 1,
    cache_bytes: int = DEFAULT_CACHE_BYTES,
    on_ready: Callable[[str], Any] = print,
) -> None:
    """Serves until interrupted; call it from the main thread. Port 0 chooses a free port. Calls `on_ready` with the address once the server answers.

    Each of the `workers` processes has its own cache of `cache_bytes`. Raises NotFound (no workspace), BadRequest (port in use).
    """
    create_app(workspace)
    chosen = find_port(host, port)
    server = Server(
        target="map3d",
        address=host,
        port=chosen,
        interface=Interfaces.ASGI,
        workers=workers,
        http=HTTPModes.http1,
        websockets=False,
        backlog=BACKLOG,
        log_level=LogLevels.warning,
        respawn_failed_workers=True,
        workers_kill_timeout=5,
    )
    threading.Thread(target=_announce, args=(host, chosen, on_ready), daemon=True).start()
    server.serve(target_loader=partial(_load, workspace.absolute(), cache_bytes, os.getpid()), wrap_loader=False)


def find_port(host: str, port: int) -> int:
    """Returns `port`, or a free one for 0. Raises BadRequest if the port is in use: two servers on one port would silently share its requests."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            return int(probe.getsockname()[1])
    except (OSError, OverflowError) as error:
        raise BadRequest(f"cannot listen on {host} port {port}: {error}; choose another port with --port, or 0 for a free one") from error


def _load(workspace: Path, cache_bytes: int, server_pid: int) -> App:
    """Runs in each process of the server; they end with it, also when it is killed."""
    die_with_parent(server_pid)
    return create_app(workspace, cache_bytes=cache_bytes)


def _announce(host: str, port: int, on_ready: Callable[[str], Any]) -> None:
    deadline_s = time.monotonic() + START_TIMEOUT_S
    name = f"[{host}]" if ":" in host else host
    while time.monotonic() < deadline_s:
        try:
            socket.create_connection((host, port), timeout=1).close()
        except OSError:
            time.sleep(0.05)
        else:
            on_ready(f"http://{name}:{port}/")
            return
