"""Sites work together if their versions differ by at most one minor version."""

import pytest

from urc.fleet.versions import parse_version, version_refusal


@pytest.mark.parametrize(
    ("one", "other", "older"),
    [
        ("0.1.0", "0.1.9", ""), ("0.1.0", "0.2.0", ""), ("0.2", "0.1.0+local", ""),
        ("", "0.9.0", ""), ("0.1.0", "0.3.0", "bern"), ("0.10.0", "0.9.5", ""),
        ("0.10.0", "0.8.0", "zug"), ("1.0.0", "0.9.0", "zug"), ("1.0.0", "2.0.0rc1", "bern"),
        ("new", "0.1.0", "bern"), ("9" * 5 + ".1", "0.1.0", "bern"),
        ("0.1." + "x" * 40, "0.1.0", "bern"), ("0.1\n", "0.1.0", "bern"),
    ],
)  # fmt: skip
def test_the_older_site_is_to_be_updated(one: str, other: str, older: str) -> None:
    refusal = version_refusal("bern", one, "zug", other)
    assert refusal == "" if not older else refusal.endswith(f"; update URC at the site {older}")
    assert "\n" not in refusal
    assert len(refusal) < 200


def test_a_version_is_major_and_minor() -> None:
    assert parse_version("0.4.1") == (0, 4)
    assert parse_version("٠.٤") is None
