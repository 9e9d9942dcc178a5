"""An assertion counts for one site, for a short time, and only with the issuer's signature."""

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from joserfc import jwt
from joserfc.jwk import ECKey

from urc.fleet.assertion import (
    LASTS_S,
    Assertion,
    BadAssertion,
    sign_assertion,
    verified_assertion,
)

NOW = 1_800_000_000.0
ANN = Assertion("p1", "Ann", "person", "s1", "cart", "drive", "10.0.0.7")


def pair() -> tuple[bytes, bytes]:
    """Return a private and a public key, in PEM."""
    key = ec.generate_private_key(ec.SECP256R1())
    private = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    public = key.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    return private, public


PRIVATE, PUBLIC = pair()


def signed(now: float = NOW, audience: str = "bern", private: bytes = PRIVATE) -> str:
    """Return an assertion of zug."""
    return sign_assertion(ANN, issuer="zug", audience=audience, key_pem=private, now=now)


def verified(text: str, now: float = NOW, issuer: str = "zug") -> Assertion:
    """Return what bern reads."""
    return verified_assertion(text, issuer=issuer, audience="bern", key_pem=PUBLIC, now=now)


def test_the_other_site_reads_the_same() -> None:
    """Nothing is lost, and a clock may differ by a little."""
    assert verified(signed()) == ANN
    assert verified(signed(), NOW - 30) == ANN
    assert verified(signed(), NOW + LASTS_S) == ANN


def test_an_old_and_a_future_assertion_name_the_clocks() -> None:
    """A site whose clock is a day off is told so."""
    with pytest.raises(BadAssertion) as caught:
        verified(signed(), NOW + 86400)
    assert str(caught.value) == (
        "the assertion of the site zug ended 23 hours ago; compare the clocks of the sites zug and"
        " bern"
    )
    with pytest.raises(BadAssertion) as caught:
        verified(signed(), NOW - 86400)
    assert str(caught.value) == (
        "the clock of the site zug is 24 hours ahead of the clock of the site bern; set the wrong"
        " clock"
    )


def test_an_assertion_for_or_from_another_site_is_refused() -> None:
    """A recorded assertion is worthless elsewhere."""
    with pytest.raises(BadAssertion, match="from or for another site"):
        verified(signed(audience="thun"))
    with pytest.raises(BadAssertion, match="from or for another site"):
        verified(signed(), issuer="thun")


def test_another_key_and_damaged_text_are_refused() -> None:
    """Only the certificate of the connection signs."""
    foreign, _ = pair()
    for text in (signed(private=foreign), signed()[:-9] + "AAAAAAAAA", "", "a.b.c"):
        with pytest.raises(BadAssertion, match="not signed by the site"):
            verified(text)
    with pytest.raises(BadAssertion, match="too long"):
        verified("a" * 5000)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"role": "king"}, "unknown role or kind"),
        ({"kind": "ghost"}, "unknown role or kind"),
        ({"name": 7}, "no valid 'name'"),
        ({"robot": "x" * 201}, "no valid 'robot'"),
        ({"exp": "soon"}, "has no times"),
        ({"exp": int(NOW) + 86400}, "lasts 86400 s; at most 30 s are valid"),
    ],
)
def test_wrong_content_is_named(change: dict[str, object], fault: str) -> None:
    """A signed assertion may still be wrong, or last too long."""
    texts = {"iss": "zug", "aud": "bern", "sub": "p1", "name": "Ann", "kind": "person"}
    visit = {"sign_in": "s1", "robot": "cart", "role": "drive", "place": ""}
    claims = texts | visit | {"iat": int(NOW), "exp": int(NOW) + 30} | change
    text = jwt.encode({"alg": "ES256"}, claims, ECKey.import_key(PRIVATE))
    with pytest.raises(BadAssertion, match=fault):
        verified(text)
