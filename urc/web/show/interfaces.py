"""Selection of the interface, and of the interface's page, that a robot's page shows.

Layer 5. Pure. Each robot also has a generated debug interface.
"""

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote

from urc.model.driver import Argument, Command, Driver
from urc.model.interface import DEBUG, Interface
from urc.model.profile import Profile
from urc.model.values import NOTHING, Reading, Signal
from urc.web import words
from urc.web.show.layout import needs_turning
from urc.web.show.outputs import asked_before, sight_config

__all__ = [
    "DEBUGGING",
    "DEBUG_STYLES",
    "KEPT",
    "InterfaceChoice",
    "DebugPart",
    "PageTab",
    "choices",
    "chosen",
    "debug_part",
    "is_turned",
    "page_tabs",
]

DEBUGGING: Final = Interface(DEBUG, "Debug")
"""Placeholder for the debug interface, which has no grid."""
DEBUG_STYLES: Final = ("/static/dev/dev.css", "/static/dev/debug.css")
KEPT: Final = "urc-interface"
"""Name of the cookie that stores which interface of a robot this device last showed. The cookie's
path is the robot's page; ``interfaces.js`` writes the cookie."""


@dataclass(frozen=True, slots=True)
class InterfaceChoice:
    """An entry in a robot's list of interfaces."""

    name: str
    title: str
    url: str
    is_current: bool


@dataclass(frozen=True, slots=True)
class PageTab:
    """One page of an interface."""

    number: int
    title: str
    name: str
    is_current: bool


@dataclass(frozen=True, slots=True)
class DebugPart:
    """Context for ``debug.html.j2``: all of a robot's signals and commands."""

    signals: tuple[Signal, ...]
    commands: str
    """JSON list of commands for ``debug_commands.js``."""
    count: int
    """Number of commands."""
    wire: str
    """Path of the developer page's socket; "" if there is no developer page."""
    dev_url: str


def chosen(
    profile: Profile, wanted: str | None, kept: str = "", *, dark: Collection[str] = ()
) -> Interface | None:
    """Return the interface to show; None if the robot has no interface named `wanted`.

    The first interface whose background can have an image is the default.

    Args:
        profile: profile of the robot.
        wanted: name of the interface in the URL; None for a URL without an interface.
        kept: name of the interface that the device last showed; ignored if the interface no longer
            exists.
        dark: signals that never have an image, because a camera's package is missing.
    """
    known = {**profile.interfaces, DEBUG: DEBUGGING}
    if wanted is not None:
        return known.get(wanted)
    bright = (one for one in profile.interfaces.values() if not _is_dark(profile, one, dark))
    return known.get(kept) or next(bright, None) or next(iter(known.values()))


def _is_dark(profile: Profile, interface: Interface, dark: Collection[str]) -> bool:
    """Return whether the interface's background shows only signals in `dark`."""
    slot = interface.background
    use = interface.widgets.get(slot) or profile.slots.get(slot)
    return use is not None and bool(use.inputs) and all(one in dark for one in use.inputs.values())


def choices(
    profile: Profile, interface: Interface, url: str, more: str
) -> tuple[InterfaceChoice, ...]:
    """Return all interfaces of a robot, with the debug interface last.

    Args:
        profile: profile of the robot.
        interface: the interface that the page shows.
        url: path of the robot's page.
        more: further query parameters for each URL, beginning with ``&``; may be empty.
    """
    every = (*profile.interfaces.values(), DEBUGGING)
    return tuple(
        InterfaceChoice(
            each.name,
            words.t("Debug") if each is DEBUGGING else each.title or each.name,
            f"{url}?interface={quote(each.name)}{more}",
            each is interface,
        )
        for each in every
    )


def page_tabs(interface: Interface, wanted: str = "") -> tuple[PageTab, ...]:
    """Return the pages of an interface as tabs; exactly one tab is current."""
    names = list(interface.tabs)
    current = wanted if wanted in interface.tabs else next(iter(names), "")
    return tuple(
        PageTab(number, page.title or page.name, page.name, page.name == current)
        for number, page in enumerate(interface.tabs.values())
    )


def is_turned(interface: Interface, slots: tuple[str, ...]) -> bool:
    """Return whether phones show the designed layout only in landscape."""
    return any(needs_turning(page, slots) for page in interface.pages)


def debug_part(profile: Profile, dev_url: str = "") -> DebugPart:
    """Return the content of the debug interface."""
    driver = profile.driver
    commands = [_command(one, driver) for one in driver.commands.values()]
    signals = tuple(driver.signals.values())
    wire = f"{dev_url}/ws" if dev_url else ""
    return DebugPart(signals, json.dumps(commands), len(commands), wire, dev_url)


def _command(command: Command, driver: Driver) -> dict[str, object]:
    hold = command.hold
    release = hold.release if hold is not None else NOTHING
    spec = driver.transports.get(command.transport)
    is_kept = spec is not None and spec.connection != "per_request"
    return {
        "name": command.name,
        "title": command.title,
        "description": command.description,
        "line": command.transport if is_kept else "",
        "steps": len(command.steps),
        "isAnswered": command.reply is not None or bool(command.steps),
        "leaseMs": round(hold.lease_s * 1000) if hold is not None else 0,
        "sees": sight_config(hold),
        "asks": asked_before(command),
        "requires": [one.text for one in command.requires],
        "arguments": [_argument(one, release) for one in command.arguments.values()],
    }


def _argument(argument: Argument, release: Mapping[str, Reading]) -> dict[str, object]:
    return {
        "name": argument.name,
        "title": argument.title,
        "type": argument.type,
        "items": argument.items,
        "unit": argument.unit,
        "min": argument.min,
        "max": argument.max,
        "choices": list(argument.choices),
        "default": argument.default,
        "rest": release.get(argument.name),
        "required": argument.is_required,
        "description": argument.description,
    }
