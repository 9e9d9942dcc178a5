"""Grants: who may do what at which robot."""

import pytest

from urc.access.grants import AccessError, Grant, parse_grant, role_at


@pytest.mark.parametrize(
    ("text", "grant"),
    [
        ("watch", Grant("watch")),
        ("drive@puppet", Grant("drive", "puppet")),
        ("maintain@#lab", Grant("maintain", "#lab")),
        ("administer", Grant("administer")),
    ],
)
def test_a_grant_is_read_and_written_in_one_form(text: str, grant: Grant) -> None:
    assert parse_grant(text) == grant
    assert str(grant) == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("pilot", "expected a role (watch, drive, maintain, administer), found 'pilot' in 'pilot'"),
        ("drive@", "expected a robot or #tag after @, found 'drive@'"),
        ("drive@#", "expected a robot or #tag after @, found 'drive@#'"),
        ("administer@cart", "administer applies to all robots: write 'administer', found"
                            " 'administer@cart'"),
    ],
)  # fmt: skip
def test_a_wrong_grant_says_what_was_expected(text: str, message: str) -> None:
    with pytest.raises(AccessError) as caught:
        parse_grant(text)
    assert str(caught.value) == message


def test_the_highest_role_at_a_robot_counts() -> None:
    grants = (Grant("watch"), Grant("drive", "#lab"), Grant("maintain", "cart"))
    assert role_at(grants, "rover") == "watch"
    assert role_at(grants, "rover", ("lab", "indoor")) == "drive"
    assert role_at(grants, "cart", ("lab",)) == "maintain"
    assert role_at(grants) == "watch", "the server itself: only grants for all robots"
    assert role_at((Grant("drive", "cart"),), "rover", ("cart",)) is None, "a tag is no robot"
    assert role_at(()) is None
