"""The file of `--oidc`: values, roles by claims, and a line for each mistake."""

from pathlib import Path
from typing import Any

import pytest

from urc.access.grants import Grant
from urc.access.oidc_options import OidcOptions, claim_values, read_oidc_options
from urc.problems import ProblemsError

GOOD = """
issuer: https://id.example/realms/lab
client_id: urc
client_secret_file: secret
title: Lab account
address: https://robots.example/
scopes: [openid, groups]
name: email
hours: 8
grants:
  - {claim: groups, value: drivers, grant: "drive@#lab"}
  - {claim: realm_access.roles, value: admin, grant: administer}
  - {claim: email_verified, value: true, grant: watch}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "secret").write_text("  s3cret\n")
    (tmp_path / "secret").chmod(0o600)
    return tmp_path


def read(folder: Path, text: str) -> OidcOptions:
    (folder / "oidc.yaml").write_text(text)
    return read_oidc_options(str(folder / "oidc.yaml"))


def test_all_options_are_read(folder: Path) -> None:
    options = read(folder, GOOD)
    assert options.issuer == "https://id.example/realms/lab"
    assert (options.client_id, options.client_secret) == ("urc", "s3cret")
    assert (options.title, options.address) == ("Lab account", "https://robots.example")
    assert (options.scopes, options.name, options.longest_s) == (
        ("openid", "groups"), "email", 28800.0,
    )  # fmt: skip
    assert [str(rule.grant) for rule in options.rules] == ["drive@#lab", "administer", "watch"]
    assert "s3cret" not in repr(options)


def test_few_options_are_enough(folder: Path) -> None:
    options = read(
        folder,
        "issuer: https://id.example\nclient_id: urc\n"
        "grants: [{claim: sub, value: '*', grant: watch}]",
    )
    assert (options.client_secret, options.title, options.address) == ("", "id.example", "")
    assert (options.scopes, options.longest_s) == (("openid", "profile"), 43200.0)
    assert options.grants({"sub": "17"}) == (Grant("watch"),)


@pytest.mark.parametrize(
    ("claims", "grants"),
    [
        ({}, []),
        ({"groups": "drivers"}, ["drive@#lab"]),
        ({"groups": ["a", "drivers"]}, ["drive@#lab"]),
        ({"groups": ["drivers2"]}, []),
        ({"groups": {"drivers": True}}, []),
        ({"realm_access": {"roles": ["admin"]}}, ["administer"]),
        ({"realm_access.roles": ["admin"]}, ["administer"]),
        ({"realm_access": ["admin"]}, []),
        ({"email_verified": True}, ["watch"]),
        ({"email_verified": False}, []),
        ({"email_verified": True, "groups": ["drivers"]}, ["drive@#lab", "watch"]),
    ],
)
def test_grants_follow_from_claims(folder: Path, claims: dict[str, Any], grants: list[str]) -> None:
    assert [str(grant) for grant in read(folder, GOOD).grants(claims)] == grants


def test_a_star_needs_a_claim_with_a_value(folder: Path) -> None:
    options = read(folder, GOOD.replace("value: drivers", "value: '*'"))
    assert options.grants({"groups": []}) == ()
    assert options.grants({"groups": ""}) == ()
    assert options.grants({"groups": None}) == ()
    assert options.grants({"groups": ["any"]}) == (Grant("drive", "#lab"),)


def test_claims_are_lists_of_text() -> None:
    assert claim_values({"a": [1, 2.5, "x", True, None, {}]}, "a") == ("1", "2.5", "x", "true")
    assert claim_values({"a": {"b": {"c": "x"}}}, "a.b.c") == ("x",)
    assert claim_values({"https://x.example/roles": ["r"]}, "https://x.example/roles") == ("r",)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("client_id: urc\n", "", ":2:1: error missing-key: 'client_id' is missing"),
        ("client_id:", "clientid:", ":3:1: error unknown-key clientid: unknown key 'clientid'"),
        ("https://id.example", "http://id.example", "expected an address with https://"),
        ("https://id.example", "https://u:p@id.example", "expected an address with https://"),
        ("https://robots.example/", "https://robots.example/x", "an address without a path"),
        ("[openid, groups]", "[groups]", "expected a list of scopes that contains 'openid'"),
        ("[openid, groups]", "openid", "expected a list"),
        ("hours: 8", "hours: 13", "expected a number of hours up to 12, found 13"),
        ("hours: 8", "hours: 0", "expected a number of hours up to 12, found 0"),
        ('"drive@#lab"', "fly", "grants.0.grant: expected a role"),
        ("claim: groups,", "", "grants.0: 'claim' is missing"),
        ("claim: groups", "claims: groups", "unknown key 'claims'"),
        ("client_secret_file: secret", "client_secret_file: no", "no cannot be read: No such file"),
        ("hours: 8", "authority_file: no.pem", "there is no file"),
    ],
)
def test_each_mistake_has_its_line(folder: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(ProblemsError) as error:
        read(folder, GOOD.replace(old, new))
    assert message in str(error.value)


def test_a_file_without_rules_lets_nobody_in(folder: Path) -> None:
    with pytest.raises(ProblemsError, match="without a rule, no account gets a role"):
        read(folder, GOOD[: GOOD.index("grants:")])


def test_plain_http_is_for_this_machine(folder: Path) -> None:
    assert read(folder, GOOD.replace("https://id.example", "http://127.0.0.1:9400")).issuer


def test_a_secret_is_readable_by_its_owner_only(folder: Path) -> None:
    (folder / "secret").chmod(0o604)
    with pytest.raises(ProblemsError, match="run: chmod o= "):
        read(folder, GOOD)
    (folder / "secret").chmod(0o640)
    read(folder, GOOD)
    (folder / "secret").write_text("  \n")
    with pytest.raises(ProblemsError, match="expected 1 to 4096 characters in "):
        read(folder, GOOD)
