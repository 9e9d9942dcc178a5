"""Which interface a page shows, its tabs, and what the interface for finding faults is given."""

import json

from urc.model.driver import Argument, Command, Driver
from urc.model.exchange import Confirm, Hold
from urc.model.interface import Interface, Tab, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.profile import Profile
from urc.model.values import Signal
from urc.web.show.interfaces import DEBUGGING, choices, chosen, debug_part, page_tabs

ONE, TWO = Interface("one", "One"), Interface("two", "Two")
SET = Command(
    "set",
    "wire",
    WriteSpec("text", {}),
    {"c": Argument("c", "number", unit="degC", min=0, max=90, default=20.0, is_required=False)},
    title="Set point",
    confirm=Confirm(),
)
DRIVE = Command("drive", "wire", WriteSpec("text", {}), {}, hold=Hold(0.05, {}, 0.25))
PROFILE = Profile(
    "bot",
    "Bot",
    "bot.yaml",
    driver=Driver(signals={"v": Signal("v")}, commands={"set": SET, "drive": DRIVE}),
    interfaces={"one": ONE, "two": TWO},
)


def test_the_address_goes_before_what_the_device_has_kept() -> None:
    """And that before the first one."""
    assert chosen(PROFILE, None) is ONE
    assert chosen(PROFILE, None, "two") is TWO
    assert chosen(PROFILE, "one", "two") is ONE
    assert chosen(PROFILE, "debug") is DEBUGGING


def test_a_background_that_never_has_an_image_is_not_the_first() -> None:
    """Without the package for video, the next interface is shown, unless a person chose."""
    camera = WidgetUse("eye", "camera", {"image": "video"})
    fly = Interface("fly", background="eye", widgets={"eye": camera})
    level = WidgetUse("level", "attitude", {"roll": "r", "pitch": "video"})
    hover = Interface("hover", background="level", widgets={"level": level})
    both = PROFILE._replace(interfaces={"fly": fly, "hover": hover})
    assert chosen(both, None) is fly
    assert chosen(both, None, dark={"video"}) is hover
    assert chosen(both, "fly", dark={"video"}) is fly
    assert chosen(both, None, "fly", dark={"video"}) is fly
    alone = PROFILE._replace(interfaces={"fly": fly})
    assert chosen(alone, None, dark={"video"}) is fly, "nothing else to show"


def test_what_is_not_there_any_more_is_passed_over_when_it_was_only_kept() -> None:
    """An address that leads nowhere says so."""
    assert chosen(PROFILE, None, "gone") is ONE
    assert chosen(PROFILE, "gone") is None


def test_every_robot_offers_the_one_for_finding_faults_last() -> None:
    """A page that only watches goes on watching."""
    found = choices(PROFILE, TWO, "/robots/bot/", "&watch")
    assert [(each.name, each.is_current) for each in found] == [
        ("one", False),
        ("two", True),
        ("debug", False),
    ]
    assert found[0].url == "/robots/bot/?interface=one&watch"


def test_exactly_one_tab_is_open() -> None:
    """The one that the address names, else the first."""
    both = Interface("i", tabs={"a": Tab("a", "A"), "b": Tab("b", "B")})
    assert [tab.is_current for tab in page_tabs(both, "b")] == [False, True]
    assert [tab.is_current for tab in page_tabs(both, "c")] == [True, False]
    assert page_tabs(ONE) == ()


def test_the_forms_know_what_a_command_takes() -> None:
    """Types, ranges, units, defaults, questions, and what is held."""
    part = debug_part(PROFILE, "/robots/bot/dev")
    assert [signal.name for signal in part.signals] == ["v"]
    given, held = json.loads(part.commands)
    (argument,) = given["arguments"]
    assert {name: argument[name] for name in ("type", "unit", "min", "max", "default")} == {
        "type": "number",
        "unit": "degC",
        "min": 0,
        "max": 90,
        "default": 20.0,
    }
    assert [question["text"] for question in given["asks"]] == ["Set point"]
    assert (given["leaseMs"], held["leaseMs"]) == (0, 250)
    assert (part.wire, debug_part(PROFILE).wire) == ("/robots/bot/dev/ws", "")
