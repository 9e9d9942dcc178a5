"""Settings: from text to values, and one line for each way to get them wrong."""

import pytest

from urc.expressions import compile_template
from urc.model.driver import TransportSpec
from urc.model.profile import Profile, Setting
from urc.problems import UrcError
from urc.runtime.settings import options_of, parse_setting, resolve_settings
from urc.testing.profile import line_profile

GOOD = [
    (Setting("s", "string"), " a b ", " a b "),
    (Setting("s", "host"), "robot.local", "robot.local"),
    (Setting("s", "host"), " 10.0.0.1 ", "10.0.0.1"),
    (Setting("s", "host"), "[fe80::1]", "fe80::1"),
    (Setting("s", "host"), "fe80::1%eth0", "fe80::1%eth0"),
    (Setting("s", "port"), "1", 1),
    (Setting("s", "port"), "65535", 65535),
    (Setting("s", "integer"), "-7", -7),
    (Setting("s", "number"), "1e3", 1000.0),
    (Setting("s", "number"), ".5", 0.5),
    (Setting("s", "boolean"), "Yes", True),
    (Setting("s", "boolean"), "off", False),
    (Setting("s", "choice", choices=("a", "b")), "b", "b"),
    (Setting("s", "path"), "/dev/ttyUSB0", "/dev/ttyUSB0"),
]

BAD = [
    (Setting("s", "host"), "", "'' is not a host name or an address"),
    (Setting("s", "host"), "two words", "'two words' is not a host name or an address"),
    (Setting("s", "host"), "300.1.1.1", "'300.1.1.1' is not a host name or an address"),
    (Setting("s", "host"), "http://x", "'http://x' is not a host name or an address"),
    (Setting("s", "host"), "a\nb", "'a\\nb' is not a host name or an address"),
    (Setting("s", "port"), "0", "'0' is not a port from 1 to 65535"),
    (Setting("s", "port"), "65536", "'65536' is not a port from 1 to 65535"),
    (Setting("s", "port"), "٣", "'٣' is not a port from 1 to 65535"),
    (Setting("s", "integer", min=1), "0", "'0' is not a whole number of at least 1"),
    (Setting("s", "integer"), "1_0", "'1_0' is not a whole number"),
    (Setting("s", "integer"), "9" * 5000, "is 5000 characters long; at most 4096 are allowed"),
    (Setting("s", "number", max=2), "3", "'3' is not a number of at most 2"),
    (Setting("s", "number"), "nan", "'nan' is not a number"),
    (Setting("s", "number"), "1e999", "'1e999' is not a number"),
    (Setting("s", "boolean"), "maybe", "'maybe' is neither true nor false"),
    (Setting("s", "choice", choices=("a", "b")), "c", "'c' is not one of a, b"),
    (Setting("s", "string"), "a\udcff", r"'a\udcff' is not valid UTF-8 text"),
    (Setting("s", "string", is_secret=True), "a\udcff", "that is not valid UTF-8 text"),
    (Setting("s", "path"), " ", "' ' is not a path"),
    (
        Setting("s", "path"),
        "~no-such-user/x",
        "'~no-such-user/x' is not a path: its home folder is unknown",
    ),
    (Setting("s", "integer", is_secret=True), "x", "that is not a whole number"),
]


@pytest.mark.parametrize(("setting", "text", "value"), GOOD)
def test_text_becomes_a_typed_value(setting: Setting, text: str, value: object) -> None:
    """The type counts too: 1 is not True."""
    parsed = parse_setting(setting, text)
    assert (parsed, type(parsed)) == (value, type(value))


@pytest.mark.parametrize(("setting", "text", "message"), BAD)
def test_wrong_text_is_told_in_one_line(setting: Setting, text: str, message: str) -> None:
    """What was found, and what was expected; a secret is not repeated."""
    with pytest.raises(UrcError) as told:
        parse_setting(setting, text)
    assert str(told.value) == message


def test_given_wins_over_environment_wins_over_default() -> None:
    """The nearest word counts, and what nobody said is missing."""
    settings = {name: Setting(name, "string", default="default") for name in ("a", "b", "c")}
    settings["my-key"] = Setting("my-key", "string")
    profile = Profile("p", "P", "p.yaml", settings=settings)
    environ = {"URC_SET_A": "environment", "URC_SET_B": "environment", "HOME": "/"}
    values, missing = resolve_settings(profile, {"a": "given"}, environ)
    assert values == {"a": "given", "b": "environment", "c": "default"}
    assert missing == ("my-key",)
    values, missing = resolve_settings(profile, {}, {"URC_SET_MY_KEY": "k"})
    assert values["my-key"] == "k"
    assert missing == ()


WRONG_NAMES = [
    ({"prot": "1"}, {}, "liner has no setting 'prot'; did you mean 'port'?"),
    ({"zzz": "1"}, {}, "liner has no setting 'zzz'; it has host, port"),
    ({"port": "x"}, {}, "--set port: 'x' is not a port from 1 to 65535"),
    ({}, {"URC_SET_PORT": "x"}, "URC_SET_PORT: 'x' is not a port from 1 to 65535"),
]


@pytest.mark.parametrize(("given", "environ", "message"), WRONG_NAMES)
def test_wrong_setting_says_where_it_came_from(
    given: dict[str, str], environ: dict[str, str], message: str
) -> None:
    """A typing mistake gets a suggestion."""
    with pytest.raises(UrcError) as told:
        resolve_settings(line_profile(), given, environ)
    assert str(told.value) == message


def test_port_0_is_for_servers_only() -> None:
    """A server lets the system choose; a client cannot connect to 0."""
    values, _ = resolve_settings(line_profile(), {"port": "0"}, allows_any_port=True)
    assert values["port"] == 0


def test_options_of_a_transport_keep_their_type() -> None:
    """A template that is one expression gives the setting's own value."""
    spec = line_profile().driver.transports["wire"]
    assert options_of(spec, {"host": "h", "port": 5}) == {"host": "h", "port": 5}
    with pytest.raises(UrcError, match=r"^transports\.wire\.port: "):
        options_of(spec, {"host": "h"})


OPTIONAL = {
    "user": Setting("user", "string", is_required=False),
    "key": Setting("key", "string", is_secret=True, is_required=False),
    "port": Setting("port", "port", is_required=False),
    "host": Setting("host", "host"),
    "name": Setting("name", "string", default=""),
}


def test_what_may_stay_empty_is_an_empty_text_or_nothing() -> None:
    """And does not keep the robot from being connected."""
    profile = line_profile()._replace(settings=OPTIONAL)
    values, missing = resolve_settings(profile, {"key": ""})
    assert missing == ("host",)
    assert values == {"user": "", "key": "", "port": None, "name": ""}
    given = {"host": "bot", "port": "80", "user": "pilot"}
    values, missing = resolve_settings(profile, given)
    assert (missing, values["port"], values["user"]) == ((), 80, "pilot")


@pytest.mark.parametrize("name", ["port", "user", "key"])
def test_it_may_be_emptied(name: str) -> None:
    assert parse_setting(OPTIONAL[name], " ") == OPTIONAL[name].empty


def test_an_option_that_is_nothing_but_an_empty_setting_is_left_out() -> None:
    options = {
        "host": compile_template("{{ settings.host }}"),
        "port": compile_template("{{ settings.port }}"),
        "auth": {"user": "x", "password": compile_template("{{settings.key}}")},
        "path": compile_template("/{{ settings.user }}"),
    }
    spec = TransportSpec("wire", "http", options)
    values = {"host": "bot", "port": None, "key": "", "user": ""}
    assert options_of(spec, values) == {"host": "bot", "auth": {"user": "x"}, "path": "/"}
    full = {"host": "bot", "port": 80, "key": "hush", "user": "a"}
    assert options_of(spec, full) == {
        "host": "bot",
        "port": 80,
        "auth": {"user": "x", "password": "hush"},
        "path": "/a",
    }
