"""Versions and ranges: what is read, what is in, what is refused."""

import pytest

from urc.packages.names import PackageError
from urc.packages.versions import parse_range, parse_version


@pytest.mark.parametrize(
    ("wanted", "inside", "outside"),
    [
        ("*", "0.0.1 9.9.9", "1.0.0-rc.1"),
        ("1.2.3", "1.2.3", "1.2.2 1.2.4 1.2.3-rc.1"),
        ("=1.2", "1.2.0 1.2.9", "1.1.9 1.3.0 1.3.0-rc.1"),
        ("1", "1.0.0 1.9.9", "0.9.9 2.0.0 2.0.0-alpha"),
        ("^1.2", "1.2.0 1.9.0", "1.1.9 2.0.0 2.0.0-rc.1"),
        ("^0.2.3", "0.2.3 0.2.9", "0.2.2 0.3.0"),
        ("^0.0.3", "0.0.3", "0.0.4 0.0.2"),
        ("^0", "0.0.0 0.9.9", "1.0.0"),
        ("^0.0", "0.0.0 0.0.9", "0.1.0"),
        ("~1.2.3", "1.2.3 1.2.9", "1.2.2 1.3.0"),
        ("~1", "1.0.0 1.9.0", "2.0.0"),
        (">=1.2, <2", "1.2.0 1.99.0", "1.1.0 2.0.0 2.0.0-rc.1"),
        (">1.2", "1.3.0", "1.2.9"),
        (">1.2.3", "1.2.4", "1.2.3"),
        ("<=1.2", "1.2.9 0.1.0", "1.3.0"),
        ("<=1.2.3", "1.2.3", "1.2.4"),
        (">=1.0.0-rc.1", "1.0.0-rc.1 1.0.0-rc.2 1.0.0 2.0.0", "1.0.0-beta 1.1.0-rc.1"),
    ],
)
def test_a_range_holds_what_it_says(wanted: str, inside: str, outside: str) -> None:
    """Pre-releases only for those who name one."""
    found = parse_range(wanted)
    assert [one for one in inside.split() if not found.allows(parse_version(one))] == []
    assert [one for one in outside.split() if found.allows(parse_version(one))] == []


@pytest.mark.parametrize(
    "text", ["", ">", "1.x", "01.2", "1.2.3+build", "^^1", "1 2", "latest", "1" * 200, "1.2-rc"]
)
def test_what_is_no_range_is_told(text: str) -> None:
    """One line, with what is expected."""
    with pytest.raises(
        PackageError, match=r"is not a range of versions; expected \^1\.2, ~1\.2\.3"
    ):
        parse_range(text)


@pytest.mark.parametrize(
    "text", ["", "1", "1.2", "01.2.3", "1.2.3.4", "v1.2.3", "1.2.٣", "1.2.3\n", "1" * 99]
)
def test_what_is_no_version_is_told(text: str) -> None:
    """Semantic Versioning asks for three numbers."""
    with pytest.raises(PackageError, match=r"is not a version; expected MAJOR\.MINOR\.PATCH"):
        parse_version(text)


def test_build_metadata_is_refused() -> None:
    """Two builds of one version would be one version with different bytes."""
    with pytest.raises(PackageError, match="cannot have build metadata"):
        parse_version("1.2.3+4")
