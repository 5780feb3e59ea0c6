"""Entry functions of test subprocesses."""

import os
from collections.abc import Mapping
from typing import Any

from map3d.subprocess import Handler, ReportProgress


def open_echo(setup: Mapping[str, Any]) -> Handler:
    def handle(request: dict[str, Any], blobs: list[bytes], report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        for step in range(request.get("reports", 0)):
            report(step)
        if request.get("print"):
            print("noise on standard output")
            os.write(2, b"noise on standard error\n")
        if request.get("echo"):
            return {}, blobs
        return {"setup": dict(setup), "request": request, "pid": os.getpid()}, [bytes([k % 256]) * k for k in request.get("sizes", [])]

    return handle


def open_broken(_setup: Mapping[str, Any]) -> Handler:
    raise RuntimeError("cannot open")
