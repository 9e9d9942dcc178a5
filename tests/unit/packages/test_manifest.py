"""What a manifest says, and one line with a place for each way to get it wrong."""

import pytest

from tests.unit.packages.made import files_of
from urc.packages.manifest import parse_manifest
from urc.packages.names import PackageError, PackageId

GOOD = files_of("driver", "puppet", "1.2.0", {"widgets/dial": "^1.0"})["package.yaml"].decode()


def test_a_manifest_is_read() -> None:
    """Everything it says, checked."""
    said = parse_manifest(GOOD.encode(), "package.yaml")
    assert (said.key, said.version, said.licence) == (PackageId("driver", "puppet"), "1.2.0", "MIT")
    assert (said.authors, said.needs) == (("A. Author",), {"widgets/dial": "^1.0"})
    assert said.main == "driver.yaml"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("urc: 1", "urc: 2", "p.yaml:1:6: urc: expected language version 1"),
        (
            "package: driver",
            "package: script",
            "p.yaml:2:10: package: expected one of driver, interface",
        ),
        (
            "name: puppet",
            "name: Puppet",
            "p.yaml:3:7: name: expected at most 64 lower-case letters, digits and '-'",
        ),
        (
            "name: puppet",
            "name: ../up",
            "p.yaml:3:7: name: expected at most 64 lower-case letters, digits and '-'",
        ),
        ("1.2.0", "1.2", "p.yaml:4:10: version: '1.2' is not a version"),
        ("licence: MIT\n", "", "p.yaml:1:1: 'licence' is missing"),
        (
            "licence: MIT",
            "licence: 7",
            "p.yaml:5:10: licence: expected text of 1 to 500 characters",
        ),
        ("[A. Author]", "[]", "p.yaml:6:10: authors: expected a list of 1 to 32 names"),
        ("[A. Author]", '["a\\nb"]', "p.yaml:6:11: authors.0: expected text on one line"),
        ("widgets/dial", "dial", "p.yaml:9:9: needs.dial: 'dial' is not a package name"),
        ("^1.0", "soon", "p.yaml:9:17: needs.widgets/dial: 'soon' is not a range of versions"),
        ("licence:", "license:", "unknown key 'license'; expected one of: urc, package, name"),
        ("urc: 1", "urc: [", "p.yaml:"),
    ],
)
def test_a_fault_is_told_with_its_place(old: str, new: str, told: str) -> None:
    """File, line, column, key, and what is expected."""
    assert old in GOOD
    with pytest.raises(PackageError) as refused:
        parse_manifest(GOOD.replace(old, new, 1).encode(), "p.yaml")
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)
