"""Where the lines of a robot lead: equal for the same places, another text for any other one."""

from typing import Any

import pytest

from urc.expressions import compile_template
from urc.model.driver import Driver, TransportSpec
from urc.model.profile import Profile, Setting
from urc.runtime.destination import destination_of

VALUES = {"host": "10.0.0.5", "port": 22, "user": "pilot", "key": "hush"}
SETTINGS = {
    "host": Setting("host", "host"),
    "port": Setting("port", "port"),
    "user": Setting("user", "string"),
    "key": Setting("key", "string", is_secret=True),
}


def rover(*more: TransportSpec, **options: Any) -> Profile:
    """Return a robot with one line, and some more."""
    usual = {
        "host": compile_template("{{ settings.host }}"),
        "port": compile_template("{{ settings.port }}"),
        "username": compile_template("{{ settings.user }}"),
        "password": compile_template("{{ settings.key }}"),
    }
    lines = (TransportSpec("wire", "ssh", usual | options), *more)
    driver = Driver({one.name: one for one in lines})
    return Profile("rover", "", "", settings=SETTINGS, driver=driver)


BEFORE = destination_of(rover(), "drivers/rover", VALUES)


@pytest.mark.parametrize(
    "changed", [{"user": "root"}, {"key": "open sesame"}], ids=["another user", "another secret"]
)
def test_how_one_talks_there_makes_no_other_place(changed: dict[str, str]) -> None:
    assert destination_of(rover(), "drivers/rover", VALUES | changed) == BEFORE


def test_options_of_manner_make_no_other_place() -> None:
    assert destination_of(rover(keepalive_interval=5), "drivers/rover", VALUES) == BEFORE


@pytest.mark.parametrize("changed", [{"host": "10.0.0.6"}, {"port": 2222}])
def test_another_address_is_another_place(changed: dict[str, Any]) -> None:
    assert destination_of(rover(), "drivers/rover", VALUES | changed) != BEFORE


@pytest.mark.parametrize(
    "options",
    [
        {"host": "203.0.113.66"},
        {"tls": {"verify": False}},
        {"command": "curl http://203.0.113.66"},
        {"known_hosts": "/etc/known"},
        {"an_option_of_a_strange_transport": "203.0.113.66"},
    ],
    ids=lambda one: next(iter(one)),
)
def test_a_document_that_names_another_place_is_another_place(options: dict[str, Any]) -> None:
    assert destination_of(rover(**options), "drivers/rover", VALUES) != BEFORE


def test_another_package_and_another_line_are_another_place() -> None:
    for package in ("robots/rover", ""):
        assert destination_of(rover(), package, VALUES) != BEFORE
    added = TransportSpec("leak", "udp", {"host": "203.0.113.66", "port": 53})
    assert destination_of(rover(added), "drivers/rover", VALUES) != BEFORE


def test_a_place_behind_a_gateway_counts_too() -> None:
    """A host that stands in no option goes into what is sent."""
    settings = SETTINGS | {"arm": Setting("arm", "host")}
    behind = rover()._replace(settings=settings)
    first = destination_of(behind, "", VALUES | {"arm": "10.0.0.7"})
    assert destination_of(behind, "", VALUES | {"arm": "10.0.0.8"}) != first
