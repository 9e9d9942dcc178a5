"""Who may come in to an emulated web server."""

from base64 import b64encode

import pytest

from urc.simulator.doors.http_guard import Guard

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
def test_who_knows_the_secret_comes_in(auth: object, given: str, told: str | None) -> None:
    """Everybody else is told what is asked for."""
    assert Guard(auth).challenge("GET", "/", given) == told


def test_digest_of_another_request_is_none() -> None:
    """The answer to a challenge is good for the target that it names, and for this nonce."""
    guard = Guard({"type": "digest", "user": "u", "password": "p"})
    told = guard.challenge("GET", "/a", "")
    assert told is not None
    nonce = told.partition('nonce="')[2].rstrip('"')
    for given in (
        f'Digest username="u", uri="/b", nonce="{nonce}", response="x"',
        'Digest username="u", uri="/a", nonce="old", response="x"',
        f'Digest username="u", uri="/a", nonce="{nonce}", response="x"',
        "Digest",
    ):
        assert guard.challenge("GET", "/a", given) == told
