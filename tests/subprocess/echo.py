"""Children for tests of the conversation itself."""

import os
from collections.abc import Mapping
from typing import Any

from map3d.subprocess import Tell, Work


def open_echo(setup: Mapping[str, Any]) -> Work:
    def work(question: dict[str, Any], _blobs: list[bytes], tell: Tell) -> tuple[dict[str, Any], list[bytes]]:
        for step in range(question.get("tell", 0)):
            tell(step)
        if question.get("print"):
            print("noise on standard output")
            os.write(2, b"noise on standard error\n")
        return {"setup": dict(setup), "question": question, "pid": os.getpid()}, [bytes([k % 256]) * k for k in question.get("sizes", [])]

    return work


def open_broken(_setup: Mapping[str, Any]) -> Work:
    raise RuntimeError("cannot open")
