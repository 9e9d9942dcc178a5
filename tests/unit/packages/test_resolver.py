"""Which versions are taken, and how a conflict is told."""

from collections.abc import Mapping

import pytest

from tests.unit.packages.made import entry
from urc.packages.index import IndexEntry
from urc.packages.names import PackageError, PackageId, PackageRequirement, parse_key
from urc.packages.resolver import choose, resolve

World = dict[str, Mapping[str, Mapping[str, str]]]


def entries(world: World) -> dict[PackageId, list[IndexEntry]]:
    return {
        parse_key(key): [entry(key, version, needs) for version, needs in versions.items()]
        for key, versions in world.items()
    }


def resolved(world: World, root: str, wanted: str = "*") -> dict[str, str]:
    found = resolve(parse_key(root), wanted, entries(world))
    return {str(key): one.version for key, one in found.items()}


def test_the_newest_that_fits_is_taken() -> None:
    """By number, not by text; no pre-release that nobody asked for."""
    world: World = {"widgets/dial": {"1.9.0": {}, "1.10.0": {}, "2.0.0-rc.1": {}}}
    assert resolved(world, "widgets/dial") == {"widgets/dial": "1.10.0"}
    assert resolved(world, "widgets/dial", "2.0.0-rc.1") == {"widgets/dial": "2.0.0-rc.1"}


def test_needs_are_followed_to_the_end() -> None:
    """A robot needs a driver, which needs a widget."""
    world: World = {
        "robots/bot": {"1.0.0": {"drivers/bot": "^1"}},
        "drivers/bot": {"1.0.0": {"widgets/dial": "^1"}, "2.0.0": {}},
        "widgets/dial": {"1.0.0": {}, "1.1.0": {}},
        "widgets/other": {"1.0.0": {}},
    }
    assert resolved(world, "robots/bot") == {
        "drivers/bot": "1.0.0", "robots/bot": "1.0.0", "widgets/dial": "1.1.0",
    }  # fmt: skip


def test_an_older_version_is_taken_where_the_newest_collides() -> None:
    """It goes back, rather than giving up."""
    world: World = {
        "drivers/bot": {"1.0.0": {"widgets/a": "*", "widgets/b": "*"}},
        "widgets/a": {"1.0.0": {"widgets/c": "^1"}, "2.0.0": {"widgets/c": "^2"}},
        "widgets/b": {"1.0.0": {"widgets/c": "^1"}},
        "widgets/c": {"1.5.0": {}, "2.0.0": {}},
    }
    found = resolved(world, "drivers/bot")
    assert (found["widgets/a"], found["widgets/c"]) == ("1.0.0", "1.5.0")


def test_packages_that_need_each_other_are_no_problem() -> None:
    """Both are taken once."""
    world: World = {
        "widgets/a": {"1.0.0": {"widgets/b": "*"}},
        "widgets/b": {"1.0.0": {"widgets/a": "*"}},
    }
    assert resolved(world, "widgets/a") == {"widgets/a": "1.0.0", "widgets/b": "1.0.0"}


def test_a_conflict_says_who_asks_for_what() -> None:
    """And which versions there are."""
    world: World = {
        "drivers/bot": {"1.0.0": {"widgets/a": "*", "widgets/b": "*"}},
        "widgets/a": {"1.0.0": {"widgets/c": "^1"}},
        "widgets/b": {"1.0.0": {"widgets/c": "^2"}},
        "widgets/c": {"1.5.0": {}, "2.0.0": {}},
    }
    with pytest.raises(PackageError) as told:
        resolved(world, "drivers/bot")
    assert str(told.value) == (
        "widgets/c: widgets/a 1.0.0 needs ^1, widgets/b 1.0.0 needs ^2; there is 1.5.0, 2.0.0"
    )


def test_what_nobody_has_is_told() -> None:
    """By name of the one that needs it."""
    world: World = {"drivers/bot": {"1.0.0": {"widgets/gone": "^1"}}}
    with pytest.raises(PackageError) as told:
        resolved(world, "drivers/bot")
    assert str(told.value) == "widgets/gone: drivers/bot 1.0.0 needs ^1; there is none"
    with pytest.raises(PackageError) as told:
        resolved(world, "drivers/bot", "^3")
    assert str(told.value) == "drivers/bot: you ask for ^3; there is 1.0.0"


def test_a_package_for_another_language_version_is_passed_over() -> None:
    """And named when it is the only one."""
    key = PackageId("widget", "dial")
    later = IndexEntry("widget", "dial", "2.0.0", "0" * 64, 1, language=2)
    found = resolve(key, "*", {key: [later, entry("widgets/dial", "1.0.0")]})
    assert found[key].version == "1.0.0"
    with pytest.raises(PackageError, match="every version requires a different version of URC"):
        resolve(key, "*", {key: [later]})


def test_a_name_means_the_one_package_that_has_it() -> None:
    """Else it is asked which."""
    known = entries({"drivers/bot": {"1.0.0": {}}, "robots/bot": {"1.0.0": {}}})
    assert choose(known, PackageRequirement("robot", "bot")) == PackageId("robot", "bot")
    with pytest.raises(
        PackageError, match="'bot' is ambiguous; expected one of drivers/bot, robots/bot"
    ):
        choose(known, PackageRequirement("", "bot"))
    with pytest.raises(PackageError, match="no repository has bod; did you mean 'bot'"):
        choose(known, PackageRequirement("", "bod"))
