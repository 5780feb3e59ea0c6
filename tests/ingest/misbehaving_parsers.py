"""Children that misbehave while they parse."""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from map3d.subprocess import Handler, ReportProgress


def open_greedy(_setup: Mapping[str, Any]) -> Handler:
    """Takes more memory than it may."""

    def work(_question: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return {"size": len(bytearray(8 << 30))}, []

    return work


def open_busy(_setup: Mapping[str, Any]) -> Handler:
    """Computes for ever."""

    def work(_question: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        while True:
            pass

    return work


def open_asleep(_setup: Mapping[str, Any]) -> Handler:
    """Waits for ever."""

    def work(_question: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        time.sleep(3600)
        return {}, []

    return work


def open_crash(_setup: Mapping[str, Any]) -> Handler:
    """Dies."""

    def work(_question: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        os.abort()

    return work


def open_curious(_setup: Mapping[str, Any]) -> Handler:
    """Tries what it must not be able to do, and says what happened."""

    def work(question: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        import socket

        try:
            socket.create_connection(("127.0.0.1", question["port"]), timeout=2).close()
        except OSError:
            return {"network": "cut"}, []
        return {"network": "open"}, []

    return work


def many_files(folder: Path) -> int:
    """How many files can be open at a time."""
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
    def work(question: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return {"files": many_files(Path(question["folder"]))}, []

    return work


def open_worker(_setup: Mapping[str, Any]) -> Handler:
    """Uses as much processor time as it is asked to."""

    def work(question: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        end = time.process_time() + question["cpu_s"]
        while time.process_time() < end:
            pass
        return {}, []

    return work
