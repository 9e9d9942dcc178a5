"""Groups of settings, and the field at which a failed test is shown."""

import pytest

from urc.expressions import compile_template
from urc.model.driver import Driver, TransportSpec
from urc.model.profile import Profile, Setting
from urc.web.manage.setting_groups import CONNECTION, FURTHER, failed_field, groups_of, place_field


def uses(text: str) -> object:
    """Return an option that uses settings."""
    return compile_template(text)


SETTINGS = {
    one.name: one
    for one in (
        Setting("speed", "number", default=0.5),
        Setting("topic", "string", default="/odom", group="Topics"),
        Setting("host", "host", default="127.0.0.1"),
        Setting("port", "port", default=80),
        Setting("serial", "string"),
        Setting("password", "string", is_secret=True, is_required=False),
        Setting("imu", "string", default="/imu", group="Topics"),
        Setting("note", "string", is_required=False),
    )
}
WIRE = TransportSpec(
    "wire",
    "ssh",
    {
        "host": uses("{{ settings.host }}"),
        "port": uses("{{ settings.port }}"),
        "password": uses("{{ settings.password }}"),
    },
)
WEB = TransportSpec("web", "http", {"url": uses("http://{{ settings.host }}:{{ settings.port }}")})
INNER = TransportSpec("inner", "tcp", {"port": 6571}, tunnel="wire")
PROFILE = Profile(
    "rover",
    "Rover",
    "rover.yaml",
    settings=SETTINGS,
    driver=Driver({"wire": WIRE, "web": WEB, "inner": INNER}),
)


def test_the_connection_comes_first_and_the_rest_last() -> None:
    groups = {title: [one.name for one in found] for title, found in groups_of(PROFILE).items()}
    assert [*groups] == [CONNECTION, "Topics", FURTHER]
    assert groups == {
        CONNECTION: ["host", "port", "serial", "password"],
        "Topics": ["topic", "imu"],
        FURTHER: ["speed", "note"],
    }


def test_an_address_is_in_the_connection_even_if_no_transport_uses_it() -> None:
    """The transports of an emulated robot have other addresses."""
    emulated = PROFILE._replace(driver=Driver({"wire": TransportSpec("wire", "tcp", {"port": 1})}))
    names = [one.name for one in groups_of(emulated)[CONNECTION]]
    assert names == ["host", "port", "serial"]


def test_no_group_is_empty() -> None:
    assert groups_of(PROFILE._replace(settings={})) == {}
    only = {"topic": SETTINGS["topic"]}
    assert [*groups_of(PROFILE._replace(settings=only))] == ["Topics"]


@pytest.mark.parametrize(
    ("transport", "cause", "field"),
    [
        ("wire", "refused", "port"),
        ("wire", "timeout", "host"),
        ("wire", "name", "host"),
        ("wire", "sign-in", "password"),
        ("wire", "", ""),
        ("web", "unreachable", "host"),
        ("web", "sign-in", ""),
        ("inner", "timeout", "host"),
        ("gone", "refused", ""),
    ],
)
def test_a_failure_is_shown_at_the_field_behind_it(transport: str, cause: str, field: str) -> None:
    assert failed_field(PROFILE, transport, cause) == field  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("transport", "field"), [("wire", "host"), ("web", "host"), ("inner", "host"), ("gone", "")]
)
def test_a_transport_that_answers_is_shown_at_its_address(transport: str, field: str) -> None:
    assert place_field(PROFILE, transport) == field
