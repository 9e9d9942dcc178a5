"""Which addresses people are told to open."""

import ipaddress

import pytest

from urc.web.serve import server
from urc.web.serve.server import reachable_urls

HERE = tuple(ipaddress.ip_address(text) for text in ("192.0.2.7", "198.51.100.1", "2001:db8::7"))


@pytest.mark.parametrize(
    ("host", "found", "urls"),
    [
        ("127.0.0.1", HERE, ["http://127.0.0.1:8080/"]),
        ("192.0.2.7", HERE, ["http://192.0.2.7:8080/"]),
        ("::1", HERE, ["http://[::1]:8080/"]),
        ("robot-pi", HERE, ["http://robot-pi:8080/"]),
        ("0.0.0.0", HERE, ["http://192.0.2.7:8080/", "http://198.51.100.1:8080/"]),
        (
            "::",
            HERE,
            [
                "http://192.0.2.7:8080/",
                "http://198.51.100.1:8080/",
                "http://[2001:db8::7]:8080/",
            ],
        ),
        ("0.0.0.0", HERE[2:], ["http://127.0.0.1:8080/"]),
        ("::", (), ["http://[::1]:8080/"]),
    ],
)
def test_addresses_to_open_are_those_of_the_machine(
    monkeypatch: pytest.MonkeyPatch,
    host: str,
    found: tuple[ipaddress.IPv4Address | ipaddress.IPv6Address, ...],
    urls: list[str],
) -> None:
    """What is listened on everywhere is opened at an interface, the rest as it is."""
    monkeypatch.setattr(server, "local_addresses", lambda: found)
    assert list(reachable_urls(host, 8080)) == urls
