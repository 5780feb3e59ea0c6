"""A visitor of the server: reads random tiles all the time, and accepts only tiles of a variant."""

import hashlib
import http.client
import json
import random
import re
import threading
import urllib.error
import urllib.request
from typing import Final

from tests.faults.processes import Command

PAUSE_S: Final = 0.02


class TileReader:
    """Runs in a thread of its own. A server that is away is no fault; a wrong tile or an unexpected status is."""

    def __init__(self, server: Command, rendering: str, expected: frozenset[str], seed: int) -> None:
        self._server, self._rendering, self._expected = server, rendering, expected
        self._choose = random.Random(seed)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read_all, name="tile reader")
        self.tiles = 0
        self.faults: list[str] = []

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _read_all(self) -> None:
        while not self._stop.wait(PAUSE_S):
            try:
                self._read_one()
            except urllib.error.HTTPError as error:
                if error.code not in (404, 503):
                    self.faults.append(f"{error.url}: status {error.code}")
                error.close()
            except (OSError, ValueError, http.client.HTTPException):
                continue  # killed, also in the middle of an answer, or not yet started

    def _read_one(self) -> None:
        found = re.search(r"http://[^\s/]+", self._server.output())
        if found is None:
            return
        base = f"{found[0]}/tiles/{self._rendering}"
        manifest = json.loads(_get(f"{base}/rendering.json"))
        view, layer = self._choose.choice(manifest["views"])["id"], self._choose.choice(manifest["layers"])["name"]
        z = self._choose.randrange(3)
        x, y = self._choose.randrange(1 << z), self._choose.randrange(1 << z)
        data = _get(f"{base}/{view}/{layer}/{z}/{x}/{y}")
        if data:
            self.tiles += 1
            if hashlib.sha256(data).hexdigest() not in self._expected:
                self.faults.append(f"{view}/{layer}/{z}/{x}/{y}: {len(data)} bytes that are a tile of no variant")


def _get(url: str) -> bytes:
    with urllib.request.urlopen(url, timeout=5) as response:
        data: bytes = response.read()
        return data
