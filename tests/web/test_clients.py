"""Whose address and scheme a request has."""

import pytest

from map3d.web.http.clients import THIS_HOST, client_address, client_scheme, parse_networks

PROXIES = parse_networks("10.0.0.0/8, 192.0.2.1, fd00::/8")


@pytest.mark.parametrize(
    ("connection", "forwarded", "expected"),
    [
        ("203.0.113.5", "198.51.100.7", "203.0.113.5"),
        ("10.1.2.3", "198.51.100.7", "198.51.100.7"),
        ("10.1.2.3", "", "10.1.2.3"),
        ("10.1.2.3", "1.1.1.1, 198.51.100.7", "198.51.100.7"),
        ("10.1.2.3", "1.1.1.1, 198.51.100.7, 192.0.2.1", "198.51.100.7"),
        ("10.1.2.3", "198.51.100.7, nonsense", "10.1.2.3"),
        ("10.1.2.3", "10.9.9.9", "10.9.9.9"),
        ("fd00::1", "2001:db8::7", "2001:db8::7"),
        ("::ffff:10.1.2.3", "198.51.100.7", "198.51.100.7"),
        ("", "198.51.100.7", ""),
    ],
)
def test_only_proxies_name_the_client(connection, forwarded, expected):
    scope = {"client": (connection, 1), "headers": [(b"x-forwarded-for", forwarded.encode())] if forwarded else []}
    assert client_address(scope, PROXIES) == expected


@pytest.mark.parametrize(
    ("connection", "forwarded", "expected"), [("127.0.0.1", b"https", "https"), ("127.0.0.1", b"gopher", "http"), ("203.0.113.5", b"https", "http")]
)
def test_only_proxies_name_the_scheme(connection, forwarded, expected):
    assert client_scheme({"client": (connection, 1), "scheme": "http", "headers": [(b"x-forwarded-proto", forwarded)]}, THIS_HOST) == expected
