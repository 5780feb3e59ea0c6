"""A proxy in front of an S3 server: a seeded share of requests fails, is answered late, or loses its answer or a part of it."""

import http.client
import random
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Final
from urllib.parse import urlsplit

FAULTS: Final = ("error", "lost", "cut", "slow")
"""Refused with status 503; done but not answered; answered with half of the bytes; answered late."""
SLOW_S: Final = 0.2


@contextmanager
def faulty_proxy(endpoint: str, seed: int, share: float, ignored: str = "") -> Iterator[tuple[str, Counter[str]]]:
    """Yields the proxy's endpoint and the counts of faults. `share`: of the requests, for each fault; `ignored`: a header of requests
    that the server does not get."""
    choice, lock, counts = random.Random(seed), threading.Lock(), Counter[str]()
    target = urlsplit(endpoint).netloc

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_request(self) -> None:
            with lock:
                fault = FAULTS[int(draw / share)] if (draw := choice.random()) < share * len(FAULTS) else "none"
                counts[fault] += 1
            body = self.rfile.read(int(self.headers.get("content-length", 0)))
            if fault == "error":
                self.answer(503, [], b"<Error><Code>SlowDown</Code></Error>")
                return
            status, headers, data = self.forward(body)
            if fault == "lost":
                self.hang_up()
                return
            time.sleep(SLOW_S if fault == "slow" else 0)
            self.answer(status, headers, data, cut=fault == "cut")

        do_GET = do_PUT = do_HEAD = do_POST = do_DELETE = do_request

        def forward(self, body: bytes) -> tuple[int, list[tuple[str, str]], bytes]:
            connection = http.client.HTTPConnection(target, timeout=60)
            try:
                connection.request(self.command, self.path, body, {name: value for name, value in self.headers.items() if name.lower() != ignored})
                response = connection.getresponse()
                return response.status, response.getheaders(), response.read()
            finally:
                connection.close()

        def answer(self, status: int, headers: list[tuple[str, str]], data: bytes, *, cut: bool = False) -> None:
            self.send_response_only(status)
            length = next((value for name, value in headers if name.lower() == "content-length"), str(len(data)))
            for name, value in headers:
                if name.lower() not in ("content-length", "connection", "transfer-encoding"):
                    self.send_header(name, value)
            self.send_header("content-length", length if self.command == "HEAD" else str(len(data)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(data[: len(data) // 2] if cut else data)
            if cut:
                self.hang_up()

        def hang_up(self) -> None:
            self.close_connection = True
            self.wfile.flush()
            self.connection.shutdown(socket.SHUT_RDWR)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.handle_error = lambda *_: None  # type: ignore[method-assign]
    thread = threading.Thread(target=server.serve_forever, name="faulty proxy")
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}", counts
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
