"""Network addresses of clients."""

import ipaddress
from collections.abc import Sequence
from typing import Final

from map3d.web.http.asgi import Scope
from map3d.web.http.conditions import header

Network = ipaddress.IPv4Network | ipaddress.IPv6Network
THIS_HOST: Final[tuple[Network, ...]] = (ipaddress.ip_network("127.0.0.0/8"), ipaddress.ip_network("::1/128"))


def parse_networks(text: str) -> tuple[Network, ...]:
    """Returns addresses and networks that stand between commas. Raises ValueError with what is expected."""
    try:
        return tuple(ipaddress.ip_network(part.strip(), strict=False) for part in text.split(",") if part.strip())
    except ValueError:
        raise ValueError("addresses and networks with commas between them, such as 127.0.0.1, 10.0.0.0/8") from None


def client_address(scope: Scope, proxies: Sequence[Network]) -> str:
    """Returns the client's address: that of the connection or, while that is one of `proxies`, the one before it in X-Forwarded-For. A proxy appends
    the address that it sees, so those on the left are what clients claim."""
    address = str((scope.get("client") or ("",))[0])
    before = header(scope["headers"], b"x-forwarded-for").decode("latin-1").split(",")
    while before and _is_in(address, proxies):
        earlier = before.pop().strip()
        try:
            address = str(_unmapped(earlier))
        except ValueError:
            break
    return address


def client_scheme(scope: Scope, proxies: Sequence[Network]) -> str:
    """Returns http or https: the scheme with which the client's request reached this server or, if it came from one of `proxies`, the proxy."""
    forwarded = header(scope["headers"], b"x-forwarded-proto").rpartition(b",")[2].strip().lower()
    is_named = forwarded in (b"http", b"https") and _is_in(str((scope.get("client") or ("",))[0]), proxies)
    return forwarded.decode() if is_named else str(scope.get("scheme", "http"))


def _is_in(address: str, networks: Sequence[Network]) -> bool:
    try:
        parsed = _unmapped(address)
    except ValueError:
        return False
    return any(parsed.version == network.version and parsed in network for network in networks)


def _unmapped(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """Returns an IPv4 address that is written in IPv6 as one of IPv4. Raises ValueError."""
    address = ipaddress.ip_address(text)
    return getattr(address, "ipv4_mapped", None) or address
