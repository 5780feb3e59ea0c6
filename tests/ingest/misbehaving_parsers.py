"""Parser subprocesses that misbehave."""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from map3d.subprocess import Handler, ReportProgress


def open_greedy(_setup: Mapping[str, Any]) -> Handler:
    """Allocates more memory than allowed."""

    def handle(_request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return {"size": len(bytearray(8 << 30))}, []

    return handle


def open_busy(_setup: Mapping[str, Any]) -> Handler:
    """Computes without end."""

    def handle(_request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        while True:
            pass

    return handle


def open_asleep(_setup: Mapping[str, Any]) -> Handler:
    """Sleeps without end."""

    def handle(_request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        time.sleep(3600)
        return {}, []

    return handle


def open_crash(_setup: Mapping[str, Any]) -> Handler:
    """Aborts."""

    def handle(_request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        os.abort()

    return handle


def open_curious(_setup: Mapping[str, Any]) -> Handler:
    """Tries to use the network and returns the outcome."""

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        import socket

        try:
            socket.create_connection(("127.0.0.1", request["port"]), timeout=2).close()
        except OSError:
            return {"network": "cut"}, []
        return {"network": "open"}, []

    return handle


def count_open_files(folder: Path) -> int:
    """Returns the number of files that can be open at once."""
    opened = []
    try:
        while len(opened) < 100_000:
            opened.append((folder / "f").open("w"))
    except OSError:
        return len(opened)
    finally:
        for file in opened:
            file.close()
    return len(opened)


def open_hoarder(_setup: Mapping[str, Any]) -> Handler:
    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return {"files": count_open_files(Path(request["folder"]))}, []

    return handle


def open_worker(_setup: Mapping[str, Any]) -> Handler:
    """Uses the requested processor time."""

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        end = time.process_time() + request["cpu_s"]
        while time.process_time() < end:
            pass
        return {}, []

    return handle
