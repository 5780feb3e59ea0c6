"""The settings of the server: command line before environment before configuration file before defaults (docs/server.md)."""

import os
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from map3d.errors import BadRequest, NotFound
from map3d.jobs.on_demand.worker import OnDemandSettings
from map3d.web.http.clients import THIS_HOST, Network, parse_networks
from map3d.web.http.headers import ANYWHERE

CONFIG_VARIABLE: Final = "MAP3D_CONFIG"
PREFIX: Final = "MAP3D_"
DEFAULT_CACHE_BYTES: Final = 128 << 20
LOG_FORMATS: Final = ("text", "json")
_FRAME: Final = re.compile(r"\*|'self'|'none'|https?://(\*\.)?[\w.-]+(:\d+)?", re.ASCII)
_TRUE, _FALSE = ("1", "true", "yes", "on"), ("0", "false", "no", "off")


@dataclass(frozen=True)
class ServerSettings:
    """`public_url`: the address of the server's root as browsers see it, without a slash at the end; None if only the requests know it.

    `cache_bytes`: size of the memory cache of tiles in each process. `on_demand`: None if tiles are not rendered when they are asked for. `metrics`:
    host and port that serve Prometheus metrics, None for nowhere. `drain_s`: how long running requests may take after a signal to stop.
    `trusted_proxies`: those whose X-Forwarded-For names the client, and whose X-Forwarded-Proto its scheme. `frame_ancestors`: pages that may show
    maps in a frame, as in a content security policy.
    """

    public_url: str | None = None
    cache_bytes: int = DEFAULT_CACHE_BYTES
    on_demand: OnDemandSettings | None = None
    host: str = "127.0.0.1"
    port: int = 8080
    processes: int = 1
    log_format: str = "text"
    access_log: bool = False
    metrics: tuple[str, int] | None = None
    drain_s: int = 30
    trusted_proxies: tuple[Network, ...] = THIS_HOST
    frame_ancestors: str = ANYWHERE


@dataclass(frozen=True)
class Setting:
    """A setting as it is written: `key` in the file, MAP3D_KEY in the environment. `parse` raises ValueError with what is expected."""

    key: str
    parse: Callable[[Any], Any]
    default: str
    text: str

    @property
    def variable(self) -> str:
        return PREFIX + self.key.upper()


def settings_from_environment() -> ServerSettings:
    """Returns the settings of the environment and of the configuration file that it names. Raises BadRequest for an invalid value."""
    return load_settings()


def load_settings(config: Path | None = None, options: Mapping[str, Any] | None = None) -> ServerSettings:
    """`config`: path of the configuration file, by default that in MAP3D_CONFIG; `options`: key → value, None for options that were not given. Raises
    NotFound without the file, BadRequest for an invalid or unknown setting."""
    path = config or (Path(os.environ[CONFIG_VARIABLE]) if os.environ.get(CONFIG_VARIABLE) else None)
    values = {} if path is None else _read_file(path)
    for setting in SETTINGS:
        if os.environ.get(setting.variable):
            values[setting.key] = _parse(setting, os.environ[setting.variable], setting.variable)
    for setting in SETTINGS:
        given = (options or {}).get(setting.key)
        if given is not None:
            values[setting.key] = _parse(setting, given, f"--{setting.key.replace('_', '-')}")
    return _build(values)


def _build(values: Mapping[str, Any]) -> ServerSettings:
    of_on_demand = {name: values[key] for key, name in _ON_DEMAND.items() if key in values}
    on_demand = OnDemandSettings(**of_on_demand) if values.get("on_demand") else None
    plain = {key: value for key, value in values.items() if key not in ("on_demand", *_ON_DEMAND, "cache_mb")}
    if "cache_mb" in values:
        plain["cache_bytes"] = values["cache_mb"] << 20
    return ServerSettings(on_demand=on_demand, **plain)


def _read_file(path: Path) -> dict[str, Any]:
    try:
        found = tomllib.loads(path.read_text("utf-8"))
    except FileNotFoundError as error:
        raise NotFound(f"{path}: no such configuration file") from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadRequest(f"{path}: not a TOML file: {error}") from error
    known = {setting.key: setting for setting in SETTINGS}
    unknown = sorted(found.keys() - known.keys())
    if unknown:
        raise BadRequest(f"{path}: unknown setting {unknown[0]!r}; the settings are {', '.join(known)}")
    return {key: _parse(known[key], value, f"{path}: {key}") for key, value in found.items()}


def _parse(setting: Setting, value: Any, where: str) -> Any:
    try:
        return setting.parse(value)
    except ValueError as error:
        raise BadRequest(f"{where}: expected {error}, got {str(value)[:100]!r}") from None


def check_public_url(url: str) -> str:
    """Returns the URL without slashes at its end. Raises BadRequest unless it is an http(s) URL with a host and without user, query and fragment."""
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.username or parts.query or parts.fragment or not url.isprintable():
        raise BadRequest(f"public URL {url!r}: expected the address of the server's root, such as https://example.org/maps")
    return url.rstrip("/")


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value:
        raise ValueError("a text")
    return value


def _integer(least: int, greatest: int) -> Callable[[Any], int]:
    def parse(value: Any) -> int:
        text = str(value)
        if isinstance(value, bool) or not (text.isascii() and text.isdigit() and len(text) < 12) or not least <= int(text) <= greatest:
            raise ValueError(f"a whole number from {least} to {greatest}")
        return int(text)

    return parse


def _boolean(value: Any) -> bool:
    text = str(value).lower()
    if text not in _TRUE + _FALSE:
        raise ValueError("true or false")
    return text in _TRUE


def _gigabytes(value: Any) -> int:
    message = "a number of GB greater than 0"
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(message) from None
    if isinstance(value, bool) or not 0 < number < 1e9:
        raise ValueError(message)
    return int(number * 1e9)


def _one_of(choices: tuple[str, ...]) -> Callable[[Any], str]:
    def parse(value: Any) -> str:
        if value not in choices:
            raise ValueError(" or ".join(choices))
        return str(value)

    return parse


def _networks(value: Any) -> tuple[Network, ...]:
    return parse_networks(", ".join(map(str, value)) if isinstance(value, list) else str(value))


def _frames(value: Any) -> str:
    sources = str(value).split()
    if not sources or not all(_FRAME.fullmatch(source) for source in sources):
        raise ValueError("*, 'self', 'none', or origins with spaces between them, such as https://example.org https://*.example.net")
    return " ".join(sources)


def _address(value: Any) -> tuple[str, int]:
    host, _, port = str(value).rpartition(":")
    if not host:
        raise ValueError("HOST:PORT, such as 127.0.0.1:9464")
    return host.strip("[]"), _integer(0, 65535)(port)


_ON_DEMAND: Final = {
    "on_demand_quota_gb": "quota_bytes",
    "on_demand_queue": "queue",
    "on_demand_blocks": "most_blocks",
    "on_demand_workers": "workers",
}

SETTINGS: Final = (
    Setting("host", _text, "127.0.0.1", "address to listen on; 0.0.0.0 for all interfaces"),
    Setting("port", _integer(0, 65535), "8080", "port to listen on; 0 selects a free one"),
    Setting("processes", _integer(1, 64), "1", "number of server processes"),
    Setting("public_url", check_public_url, "", "address of the server's root as browsers see it, behind a proxy"),
    Setting("cache_mb", _integer(1, 1 << 20), "128", "memory cache of tiles in each process, MiB"),
    Setting("on_demand", _boolean, "false", "render missing and changed tiles when they are asked for (on-demand.md)"),
    Setting("on_demand_quota_gb", _gigabytes, "5", "disk space for blocks rendered on demand, GB"),
    Setting("on_demand_queue", _integer(1, 100_000), "64", "blocks that requests may wait for in each process"),
    Setting(
        "on_demand_blocks", _integer(1, 1_000_000), "256", "a tile of an upper level is rendered if at most this many base blocks below it are open"
    ),
    Setting("on_demand_workers", _integer(1, 64), "1", "subprocesses that render in each process"),
    Setting("log_format", _one_of(LOG_FORMATS), "text", "text, or json: one JSON object in each line"),
    Setting("access_log", _boolean, "false", "log every request"),
    Setting("metrics", _address, "", "HOST:PORT of the Prometheus metrics, such as 127.0.0.1:9464; without it there are none"),
    Setting(
        "trusted_proxies",
        _networks,
        ", ".join(map(str, THIS_HOST)),
        "addresses and networks of proxies, whose X-Forwarded-For and X-Forwarded-Proto name the client's address and scheme",
    ),
    Setting(
        "frame_ancestors", _frames, ANYWHERE, "pages that may show maps in a frame: * for all, 'self', 'none', or origins such as https://example.org"
    ),
    Setting("drain_s", _integer(1, 3600), "30", "seconds that running requests may take after a signal to stop or reload"),
)
