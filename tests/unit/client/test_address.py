"""Addresses and tokens of servers: what is accepted, and why the rest is not."""

from pathlib import Path

import pytest

from urc.client.address import read_token, server_address, trust
from urc.problems import UrcError

GOOD = [
    ("https://robots.lab:8080", "https://robots.lab:8080", "wss://robots.lab:8080/ws?robot=a%20b"),
    ("https://robots.lab/", "https://robots.lab", "wss://robots.lab/ws?robot=a%20b"),
    ("http://127.0.0.1:8080/", "http://127.0.0.1:8080", "ws://127.0.0.1:8080/ws?robot=a%20b"),
    ("http://[::1]:8080", "http://[::1]:8080", "ws://[::1]:8080/ws?robot=a%20b"),
    ("http://localhost:1", "http://localhost:1", "ws://localhost:1/ws?robot=a%20b"),
]


@pytest.mark.parametrize(("server", "url", "socket"), GOOD)
def test_an_address_leads_to_the_socket(server: str, url: str, socket: str) -> None:
    """And to STOP; the name of a robot is quoted."""
    found = server_address(server)
    assert (found.url, found.socket("a b")) == (url, socket)
    assert found.socket("") == socket.partition("?")[0]
    assert found.stop("a/b") == f"{url}/api/v1/robots/a%2Fb/stop"


BAD = [
    ("robots.lab:8080", "expected an address like"),
    ("ftp://robots.lab", "expected an address like"),
    ("https://", "expected an address like"),
    ("https://robots.lab:80800", "is not an address"),
    ("https://[::1", "is not an address"),
    ("https://user:secret@robots.lab", "without a key"),
    ("https://robots.lab?key=secret", "without a key"),
    ("https://robots.lab#key", "without a key"),
    ("https://robots.lab/robots/cart", "without a path"),
    ("http://robots.lab", "would send the token without encryption"),
    ("http://192.168.1.5:8080", "would send the token without encryption"),
    ("http://127.0.0.1.evil.example", "would send the token without encryption"),
]


@pytest.mark.parametrize(("server", "told"), BAD)
def test_other_addresses_are_refused(server: str, told: str) -> None:
    """Secrets in them are not repeated."""
    with pytest.raises(UrcError, match=told) as refused:
        server_address(server)
    assert "secret" not in str(refused.value)


def test_plain_http_elsewhere_needs_a_word() -> None:
    """A long one."""
    assert server_address("http://192.168.1.5", allow_unencrypted=True).scheme == "http"


def test_a_token_comes_from_a_file(tmp_path: Path) -> None:
    """White space around it does not count."""
    file = tmp_path / "token"
    file.write_text("  abc-123\n", "ascii")
    assert read_token("", file) == "abc-123"
    assert read_token("abc", None) == "abc"
    assert read_token("", None) == ""


TOKENS = [
    (b"", "is empty"),
    (b"two words", "expected one word"),
    (b"line\nanother", "expected one word"),
    ("é".encode(), "not plain text"),
]


@pytest.mark.parametrize(("content", "told"), TOKENS)
def test_other_tokens_are_refused(content: bytes, told: str, tmp_path: Path) -> None:
    """Before they break a header."""
    file = tmp_path / "token"
    file.write_bytes(content)
    with pytest.raises(UrcError, match=told):
        read_token("", file)


def test_a_token_and_its_file_contradict_each_other(tmp_path: Path) -> None:
    """And a missing file is told."""
    with pytest.raises(UrcError, match="not both"):
        read_token("abc", tmp_path / "token")
    with pytest.raises(UrcError, match=r"cannot use .*: No such file"):
        read_token("", tmp_path / "token")


def test_a_file_that_is_no_authority_is_told(tmp_path: Path) -> None:
    """Missing, or something else."""
    file = tmp_path / "authority.pem"
    with pytest.raises(UrcError, match=r"authority: cannot use .*: No such file"):
        trust(file)
    file.write_text("not a certificate")
    with pytest.raises(UrcError, match="authority: cannot use"):
        trust(file)


def test_certificates_and_names_are_always_checked() -> None:
    """No parameter of ours turns that off."""
    context = trust(None)
    assert context.check_hostname
    assert context.verify_mode.name == "CERT_REQUIRED"
