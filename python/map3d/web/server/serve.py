"""Runs the app with granian."""

import logging
import os
import resource
import socket
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

from granian.constants import HTTPModes, Interfaces
from granian.http import HTTP1Settings
from granian.log import LogLevels
from granian.server import Server
from granian.server.common import AbstractServer

from map3d.catalogue import Workspace
from map3d.errors import BadRequest, Map3dError
from map3d.subprocess.limits import die_with_parent
from map3d.web.http.settings import ServerSettings, settings_from_environment
from map3d.web.server.asgi_app import App, check_workspace, create_app
from map3d.web.server.early_answers import answer_early
from map3d.web.server.logs import configure_logs
from map3d.web.server.metrics import Metrics, MetricsServer

START_TIMEOUT_S: Final = 60.0
BACKLOG: Final = 2048
MOST_CONNECTIONS: Final = 16_384
"""Connections that a process accepts at once, idle ones included; fewer if it may open fewer files."""
HEADER_TIMEOUT_MS: Final = 10_000
"""A client has this time to send the head of a request, and to begin the next one on the same connection."""
_OTHER_FILES: Final = 512
_PAUSES_S: Final = (1.0, 30.0)
"""First and longest pause before web processes that die within seconds are started again."""
_STEADY_S: Final = 60.0
"""A server that ran for this long starts again after the first pause."""

log: Final = logging.getLogger("map3d.web")


def serve(
    workspace: Path,
    host: str = "127.0.0.1",
    port: int = 8080,
    *,
    workers: int = 1,
    settings: ServerSettings | None = None,
    reload_settings: Callable[[], ServerSettings] | None = None,
    on_ready: Callable[[str], Any] = print,
    parts: Mapping[str, Callable[[], bool]] | None = None,
) -> None:
    """Serves until interrupted; call it from the main thread. Port 0 chooses a free port. Calls `on_ready` with the address once the server answers.

    Without `settings`, uses those of the environment. SIGHUP replaces the processes one by one; the new ones take the settings that
    `reload_settings`, which is pickled, returns. SIGTERM and SIGINT end the server when the running requests are answered, after `drain_s` at the
    latest. `parts`: further parts of the server that /readyz names, and functions, which are pickled, that tell whether they work.
    Raises NotFound (no workspace), BadRequest (port in use, invalid setting).
    """
    chosen_settings = settings or settings_from_environment()
    check_workspace(Workspace(workspace))
    configure_logs(chosen_settings.log_format, access=chosen_settings.access_log)
    chosen = find_port(host, port)
    threading.Thread(target=_announce, args=(host, chosen, on_ready), daemon=True).start()
    with _metrics_folder(chosen_settings) as folder:
        load = partial(_load, workspace.absolute(), chosen_settings, reload_settings, folder, os.getpid(), dict(parts or {}))
        _serve_always(lambda: _make_server(host, chosen, workers, chosen_settings.drain_s), load)


def _serve_always(make_server: Callable[[], AbstractServer[Any]], load: Callable[[], App]) -> None:
    """Serves until interrupted. granian starts a process that dies again, and gives up when it dies twice within seconds; then all start again after
    a pause that grows while that happens."""
    pause_s = _PAUSES_S[0]
    while True:
        server, start_s = make_server(), time.monotonic()
        try:
            server.serve(target_loader=load, wrap_loader=False)
            return
        except SystemExit:
            if server.interrupt_signal or not server.interrupt_children:
                raise
        if time.monotonic() - start_s > _STEADY_S:
            pause_s = _PAUSES_S[0]
        log.error("web processes die within seconds; they are started again in %g s", pause_s)
        server.main_loop_interrupt.clear()
        if server.main_loop_interrupt.wait(pause_s) and server.interrupt_signal:
            return
        pause_s = min(2 * pause_s, _PAUSES_S[1])


def _make_server(host: str, port: int, workers: int, drain_s: int) -> AbstractServer[Any]:
    return Server(
        target="map3d",
        address=host,
        port=port,
        interface=Interfaces.ASGI,
        workers=workers,
        http=HTTPModes.http1,
        websockets=False,
        backlog=BACKLOG,
        backpressure=_most_connections(),
        http1_settings=HTTP1Settings(header_read_timeout=HEADER_TIMEOUT_MS),
        log_level=LogLevels.warning,
        respawn_failed_workers=True,
        workers_kill_timeout=drain_s,
    )


@contextmanager
def _metrics_folder(settings: ServerSettings) -> Iterator[Path | None]:
    """Serves the metrics of the processes that count in the folder, if the settings say so. Raises BadRequest for an address in use."""
    if settings.metrics is None:
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="map3d-metrics-") as folder:
        try:
            server = MetricsServer(Path(folder), *settings.metrics)
        except OSError as error:
            raise BadRequest(f"cannot serve metrics at {settings.metrics[0]}:{settings.metrics[1]}: {error}") from error
        try:
            yield Path(folder)
        finally:
            server.close()


def _most_connections() -> int:
    """Allows this process, and those that it starts, to open as many files as the system lets them; returns the number of connections to accept.

    granian stops accepting at this number until a connection closes, so idle connections must not reach it easily.
    """
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    wanted = MOST_CONNECTIONS + _OTHER_FILES
    allowed = wanted if hard == resource.RLIM_INFINITY else min(hard, wanted)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(allowed, resource.getrlimit(resource.RLIMIT_NOFILE)[0]), hard))
    return max(allowed - _OTHER_FILES, 64)


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


def _load(
    workspace: Path,
    settings: ServerSettings,
    reload_settings: Callable[[], ServerSettings] | None,
    metrics: Path | None,
    server_pid: int,
    parts: Mapping[str, Callable[[], bool]],
) -> App:
    """Runs in each process of the server; they end with it, also when it is killed. A process that starts after a signal to reload takes the settings
    of that time, or the old ones if they are invalid."""
    die_with_parent(server_pid)
    error: Map3dError | None = None
    try:
        settings = settings if reload_settings is None else reload_settings()
    except Map3dError as invalid:
        error = invalid
    configure_logs(settings.log_format, access=settings.access_log)
    if error is not None:
        log.error("the settings stay as they were: %s", error)
    app = create_app(workspace, settings, None if metrics is None else Metrics(metrics), parts)
    answer_early(app.answer_early)
    return app


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
