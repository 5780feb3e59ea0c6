"""The logs of the server, on standard error: text, or one JSON object in each line."""

import json
import logging
import sys
import time
from datetime import UTC, datetime
from typing import Any, Final

ACCESS: Final = logging.getLogger("map3d.access")
_ESCAPES: Final = {code: ascii(chr(code))[1:-1] for code in (*range(32), 127, 0x85, 0x2028, 0x2029)}
"""Characters that end a line or control a terminal → how they are written."""
_NAMES: Final = ("map3d", "_granian")


class JsonFormatter(logging.Formatter):
    """Writes time (UTC), level, logger and message, the fields of `extra={"fields": {…}}`, and the traceback of an exception."""

    def format(self, record: logging.LogRecord) -> str:
        entry: dict[str, Any] = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
            **getattr(record, "fields", {}),
        }
        if record.exc_info:
            entry["traceback"] = self.formatException(record.exc_info)
        return json.dumps(entry, ensure_ascii=False, default=str)


class TextFormatter(logging.Formatter):
    def __init__(self) -> None:
        super().__init__("%(asctime)sZ %(levelname)s %(name)s: %(message)s", "%Y-%m-%dT%H:%M:%S")
        self.converter = time.gmtime

    def formatMessage(self, record: logging.LogRecord) -> str:
        """Messages may have names that users chose; each stays one line."""
        record.message = record.message.translate(_ESCAPES)
        return super().formatMessage(record)

    def format(self, record: logging.LogRecord) -> str:
        fields = getattr(record, "fields", {})
        return super().format(record) + "".join(f" {name}={value}" for name, value in fields.items())


def configure_logs(log_format: str, *, access: bool) -> None:
    """Sends the logs of this process to standard error. `access`: whether requests are logged, too."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonFormatter() if log_format == "json" else TextFormatter())
    for name in _NAMES:
        logger = logging.getLogger(name)
        logger.handlers, logger.propagate = [handler], False
        logger.setLevel(logging.INFO if name == "map3d" else logging.WARNING)
    ACCESS.setLevel(logging.INFO if access else logging.WARNING)
