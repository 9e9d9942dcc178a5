"""The check of ID tokens: one good token, and everything that makes one bad."""

from typing import Any

import pytest
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.access.tokens import EC_KEY, OTHER_RSA_KEY, RSA_KEY, jwk, sign
from urc.access.grants import AccessError
from urc.access.oidc_tokens import LEEWAY_S, UnknownKey, verified_claims

NOW = 1_000_000.0
ISSUER = "https://id.example/lab"
CLAIMS: dict[str, Any] = {
    "iss": ISSUER, "aud": "urc", "sub": "17", "nonce": "n", "iat": NOW - 1, "exp": NOW + 300,
    "groups": ["drivers"],
}  # fmt: skip
KEYS = [jwk(EC_KEY, kid="ec", use="sig"), jwk(RSA_KEY, kid="rsa", alg="RS256")]


def check(token: str, keys: Any = KEYS, now: float = NOW) -> dict[str, Any]:
    return verified_claims(token, keys, issuer=ISSUER, client_id="urc", nonce="n", now=now)


def test_a_good_token_has_claims() -> None:
    assert check(sign(CLAIMS, kid="rsa")) == CLAIMS
    assert check(sign(CLAIMS, algorithm="ES256", key=EC_KEY, kid="ec")) == CLAIMS
    assert check(sign(CLAIMS, kid="rsa", typ="JWT", x_vendor="fine")) == CLAIMS


def test_a_token_without_a_key_id_is_tried_with_all_keys() -> None:
    assert check(sign(CLAIMS)) == CLAIMS
    with pytest.raises(UnknownKey):
        check(sign(CLAIMS, key=OTHER_RSA_KEY))


def test_the_time_may_differ_a_little() -> None:
    token = sign(CLAIMS, kid="rsa")
    assert check(token, now=NOW + 300 + LEEWAY_S - 1)
    assert check(token, now=NOW - LEEWAY_S)
    for now in (NOW + 300 + LEEWAY_S, NOW - LEEWAY_S - 2):
        with pytest.raises(AccessError, match="check both clocks"):
            check(token, now=now)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"iss": "https://evil.example"}, "a different issuer"),
        ({"iss": ISSUER + "/"}, "a different issuer"),
        ({"iss": None}, "a different issuer"),
        ({"aud": "another"}, "for another server"),
        ({"aud": []}, "for another server"),
        ({"aud": None}, "for another server"),
        ({"aud": ["urc", "another"]}, "for another server"),
        ({"azp": "another"}, "for another server"),
        ({"nonce": "other"}, "for another sign-in"),
        ({"nonce": None}, "for another sign-in"),
        ({"sub": ""}, "names no account"),
        ({"sub": 17}, "names no account"),
        ({"sub": "s" * 256}, "names no account"),
        ({"exp": None}, "no valid time 'exp'"),
        ({"exp": True}, "no valid time 'exp'"),
        ({"exp": "2099-01-01"}, "no valid time 'exp'"),
        ({"iat": None}, "no valid time 'iat'"),
    ],
)
def test_a_bad_claim_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(AccessError, match=message):
        check(sign(CLAIMS | change, kid="rsa"))


def test_several_audiences_need_the_authorized_party() -> None:
    claims = CLAIMS | {"aud": ["urc", "another"], "azp": "urc"}
    assert check(sign(claims, kid="rsa")) == claims


def test_a_changed_token_is_refused() -> None:
    token = sign(CLAIMS, kid="rsa")
    other = sign(CLAIMS | {"groups": ["admins"]}, kid="rsa")
    mixed = ".".join([*other.split(".")[:2], token.split(".")[2]])
    with pytest.raises(AccessError, match="signature of the provider's token is wrong"):
        check(mixed)


@pytest.mark.parametrize("algorithm", ["none", "HS256", "RS1", "", "EdDSA"])
def test_other_algorithms_are_refused(algorithm: str) -> None:
    """With `none` or a public key as the secret of HS256, each page could sign."""
    public = RSA_KEY.public_key().public_bytes(
        serialization.Encoding.PEM, serialization.PublicFormat.SubjectPublicKeyInfo
    )
    token = sign(CLAIMS, algorithm=algorithm, key=public.decode(), kid="rsa")
    with pytest.raises(AccessError, match="which is not allowed"):
        check(token)


def test_a_key_of_another_kind_signs_nothing() -> None:
    with pytest.raises(UnknownKey):
        check(sign(CLAIMS, kid="rsa"), [jwk(EC_KEY, kid="rsa")])
    with pytest.raises(UnknownKey):
        check(sign(CLAIMS, kid="rsa"), [jwk(RSA_KEY, kid="rsa", use="enc")])
    with pytest.raises(UnknownKey):
        check(sign(CLAIMS, kid="x"), [{"kty": "oct", "k": "AAAA", "kid": "x"}])
    short = rsa.generate_private_key(65537, 1024)  # noqa: S505 - to be refused
    with pytest.raises(UnknownKey):
        check(sign(CLAIMS, key=short, kid="rsa"), [jwk(short, kid="rsa")])


@given(st.text(max_size=200) | st.lists(st.text(max_size=20), max_size=4).map(".".join))
def test_no_text_breaks_the_check(text: str) -> None:
    with pytest.raises(AccessError):
        check(text)


@given(
    st.dictionaries(st.sampled_from(["kty", "n", "e", "kid", "crv", "x", "y", "use"]),
                    st.none() | st.integers() | st.text(max_size=8) | st.lists(st.text())),
)  # fmt: skip
def test_no_key_breaks_the_check(key: dict[str, Any]) -> None:
    with pytest.raises(UnknownKey):
        check(sign(CLAIMS), [key])


def test_a_deep_or_long_token_is_refused() -> None:
    deep: Any = []
    for _ in range(500):
        deep = [deep]
    with pytest.raises(AccessError):
        check(sign(deep, kid="rsa"))
    with pytest.raises(AccessError, match="too long"):
        check("a" * 70_000)
