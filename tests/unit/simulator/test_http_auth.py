"""Authentication of clients of a simulated web server."""

from base64 import b64encode

import pytest

from urc.simulator.servers.http_auth import HttpAuth

BASIC = {"type": "basic", "user": "operator", "password": "s3cret"}


def basic(text: str) -> str:
    return f"Basic {b64encode(text.encode()).decode()}"


@pytest.mark.parametrize(
    ("auth", "given", "told"),
    [
        (None, "", None),
        (BASIC, basic("operator:s3cret"), None),
        (BASIC, basic("operator:guess"), 'Basic realm="robot"'),
        (BASIC, "", 'Basic realm="robot"'),
        ({"type": "bearer", "token": "t"}, "Bearer t", None),
        ({"type": "bearer", "token": "t"}, "Bearer u", "Bearer"),
    ],
)
def test_credentials_are_checked(auth: object, given: str, told: str | None) -> None:
    """A request without them gets the challenge."""
    assert HttpAuth(auth).challenge("GET", "/", given) == told


def test_digest_of_another_request_is_refused() -> None:
    """A digest is valid for its target and nonce only."""
    auth = HttpAuth({"type": "digest", "user": "u", "password": "p"})
    told = auth.challenge("GET", "/a", "")
    assert told is not None
    nonce = told.partition('nonce="')[2].rstrip('"')
    for given in (
        f'Digest username="u", uri="/b", nonce="{nonce}", response="x"',
        'Digest username="u", uri="/a", nonce="old", response="x"',
        f'Digest username="u", uri="/a", nonce="{nonce}", response="x"',
        "Digest",
    ):
        assert auth.challenge("GET", "/a", given) == told
