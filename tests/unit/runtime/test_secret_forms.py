"""A secret is found in every form in which robots are told one."""

import base64
from urllib.parse import quote, quote_plus

import pytest

from urc.runtime.secret_forms import HIDDEN, SecretForms

SECRET = 'hunter "2" & co/äß'  # noqa: S105 - it is nobody's
BYTES = SECRET.encode()


@pytest.mark.parametrize(
    "form",
    [
        SECRET,
        quote(SECRET),
        quote(SECRET, safe=""),
        quote_plus(SECRET),
        BYTES.hex(),
        BYTES.hex().upper(),
        BYTES.hex(" "),
        base64.b64encode(BYTES).decode(),
        base64.urlsafe_b64encode(BYTES).decode(),
    ],
)
def test_a_secret_is_hidden_in_each_of_its_forms(form: str) -> None:
    known = SecretForms([SECRET])
    assert known.hide(f"key is {form} here") == f"key is {HIDDEN} here"
    assert known.are_in(f"key={form}\n".encode())


@pytest.mark.parametrize("before", ["u:", "us:", "use:", "user:"])
@pytest.mark.parametrize("after", ["", "!", "!!"])
def test_base64_of_more_than_the_secret_is_hidden_whole(before: str, after: str) -> None:
    """Its ends depend on what is around: they would tell some letters."""
    token = base64.b64encode(f"{before}{SECRET}{after}".encode()).decode()
    known = SecretForms([SECRET])
    assert known.hide(f"Authorization: Basic {token} end") == f"Authorization: Basic {HIDDEN} end"
    assert known.are_in(token.encode())


def test_other_text_stays() -> None:
    text = "drive 0.5 aHVudGVk 68756e74"
    assert SecretForms([SECRET, ""]).hide(text) == text
    assert not SecretForms([SECRET]).are_in(text.encode())
    assert SecretForms(["ab"]).hide("ab 6162") == f"{HIDDEN} 6162", "too short to tell in hex"
