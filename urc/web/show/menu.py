"""The menu with all served robots and their settings, as well as the navigation between pages.

Layer 5. Pure. The template `menu.html.j2` receives a `MenuPage`; all other pages except robot pages
have a `Nav`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from time import gmtime, strftime
from typing import Final, Protocol
from urllib.parse import quote

from urc.model.profile import Setting
from urc.model.values import Value
from urc.web.fleet.fleet import BrokenRobot
from urc.web.fleet.robots import Robot, missing_settings
from urc.web.show.cells import spoken
from urc.web.show.pages import PageHead, render
from urc.web.show.robot_address import robot_address
from urc.web.words import t

__all__ = [
    "Card",
    "FarRobot",
    "MenuPage",
    "Nav",
    "SettingRow",
    "NavigationLinks",
    "menu_page",
    "setting_row",
]

_CLAUSE_END: Final = re.compile(r"[,;:]\s|\.(?:\s|$)")


@dataclass(frozen=True, slots=True)
class NavigationLinks:
    """The optional pages of this server, which the navigation links to."""

    has_managers: bool = False
    """Whether the server has pages for drivers, interfaces, widgets and settings."""
    has_new: bool = False
    """Whether the server has the page for a new ROS robot, and shows the robot in the menu."""
    has_dev: bool = False
    has_audit: bool = False
    """Whether the server has an audit log."""


@dataclass(frozen=True, slots=True)
class Nav:
    """Context for ``nav.html.j2``: the navigation bar."""

    current: str
    """Name of the current page: ``menu``, ``drivers``, ``interfaces``, ``widgets``, ``dev``,
    ``audit``, ``people``, ``account`` or ``settings``, which belongs to the menu."""
    ways: NavigationLinks


@dataclass(frozen=True, slots=True)
class SettingRow:
    """One row in the list of a robot's settings."""

    title: str
    name: str
    value: str
    """Displayed value of the setting; "" if it has no value."""
    description: str
    is_missing: bool


@dataclass(frozen=True, slots=True)
class Card:
    """One robot, as shown on the menu."""

    name: str
    """The robot's name in URLs."""
    title: str
    summary: str
    kind: str
    """First clause of the summary, which the card shows in one line; "" for no such line."""
    url: str
    link: str
    """URL of the robot's page, or of its settings while a setting is missing; "" if there is no URL
    to open."""
    link_label: str
    """Name of the card's link, for screen readers."""
    driver: str
    """Name and version of the driver's package, or the driver's file name."""
    interface: str
    """Title of the robot's first interface."""
    tags: tuple[str, ...]
    rows: tuple[SettingRow, ...]
    missing: tuple[str, ...]
    """Titles of missing required settings."""
    missing_names: tuple[str, ...]
    """Names of the missing settings, for use on the command line."""
    initials: str
    """One or two letters, shown in place of a missing image."""
    address: str = ""
    """Kind and address of the robot's connection; "" if unknown."""
    settings_url: str = ""
    """URL of the robot's settings page; "" if it has no settings page."""
    dev_url: str = ""
    """URL of the robot's developer page; "" for a robot without a developer page."""
    is_live: bool = False
    """Whether the card shows the robot's state and image."""
    is_emulated: bool = False
    fault: str = ""
    """Reason why the robot cannot be used; "" if it can."""
    recorded: str = ""
    """Start time of the recording; "" if the card does not show a playback."""


class FarRobot(Protocol):
    """A robot of another site; see `urc.web.api.wire.RobotSummary`."""

    @property
    def name(self) -> str:
        """Name in URLs of this server, such as ``cart@bern``."""

    @property
    def title(self) -> str:
        """Display name."""

    @property
    def summary(self) -> str:
        """Short description."""

    @property
    def tags(self) -> tuple[str, ...]:
        """The site, followed by the robot's tags."""

    @property
    def emulated(self) -> bool:
        """Whether the robot is emulated."""


@dataclass(frozen=True, slots=True)
class MenuPage:
    """Context for ``menu.html.j2``: the served robots."""

    head: PageHead
    nav: Nav
    cards: tuple[Card, ...]
    tags: tuple[str, ...]
    """All tags of the robots, in alphabetical order."""
    states: object
    """States of the robots, in the format of the API call ``/api/v1/robots``."""
    is_emulated: bool
    """Whether all of several robots are emulated, so that one mark serves all cards."""
    has_stop_all: bool
    """Whether the page has STOP ALL, because several robots can be stopped."""


def menu_page(
    head: PageHead,
    robots: Mapping[str, Robot],
    *,
    states: object = None,
    ways: NavigationLinks = NavigationLinks(),
    drivers: Mapping[str, str] | None = None,
    broken: Mapping[str, BrokenRobot] | None = None,
    far: Sequence[FarRobot] = (),
    stoppable: int = 0,
) -> str:
    """Return the menu.

    Args:
        head: data for the head of the page.
        robots: the robots in display order, keyed by their names in URLs.
        states: states of the robots, in the format of the API call ``/api/v1/robots``.
        ways: navigation links of this server.
        drivers: installed package and version of each robot, keyed by robot name.
        broken: unusable robots, keyed by name.
        far: robots of other sites.
        stoppable: number of robots that STOP ALL stops.
    """
    cards = [
        _card(name, robot, ways, (drivers or {}).get(name, "")) for name, robot in robots.items()
    ]
    cards += [
        _broken(name, one, ways) for name, one in (broken or {}).items() if name not in robots
    ]
    cards += [_far(one) for one in far]
    tags = tuple(sorted({tag for card in cards for tag in card.tags}))
    is_emulated = len(cards) > 1 and all(card.is_emulated for card in cards)
    page = MenuPage(head, Nav("menu", ways), tuple(cards), tags, states, is_emulated, stoppable > 1)
    return render("menu.html.j2", page)


def _far(robot: FarRobot) -> Card:
    """Return the card of a robot of another site."""
    url = f"/robots/{quote(robot.name, safe='')}/"
    return Card(
        name=robot.name,
        title=robot.title,
        summary=robot.summary,
        kind=_kind(robot.summary, robot.title),
        url=url,
        link=url,
        link_label=t("Connect to {title}", title=robot.title),
        driver="",
        interface="",
        tags=robot.tags,
        rows=(),
        missing=(),
        missing_names=(),
        initials=_initials(robot.title),
        is_live=True,
        is_emulated=robot.emulated,
    )


def setting_row(setting: Setting, value: Value) -> SettingRow:
    """Return a setting in readable form, with a secret's value hidden."""
    if value is None or value == "":
        shown = ""
    elif setting.is_secret:
        shown = "••••••"
    elif isinstance(value, bool):
        shown = t("yes") if value else t("no")
    else:
        shown = str(value)
    title = setting.title or spoken(setting.name)
    is_missing = setting.is_missing(value)
    return SettingRow(title, setting.name, shown, setting.description, is_missing)


def _card(name: str, robot: Robot, ways: NavigationLinks, driver: str) -> Card:
    profile = robot.profile
    missing = missing_settings(robot)
    rows = tuple(
        setting_row(one, None if one in missing else robot.settings.get(one.name, one.default))
        for one in profile.settings.values()
    )
    first = next(iter(profile.interfaces.values()), None)
    url = f"/robots/{quote(name, safe='')}/"
    settings_url = f"{url}settings" if ways.has_managers else ""
    title = profile.title or name
    link, label = url, t("Connect to {title}", title=title)
    if missing:
        link, label = settings_url, t("Settings of {title}", title=title)
    elif robot.playback is not None:
        label = t("Play {title}", title=title)
    return Card(
        name=name,
        title=title,
        summary=profile.summary,
        kind=_kind(profile.summary, title),
        url=url,
        link=link,
        link_label=label,
        driver=driver or PurePath(profile.file).name,
        interface=(first.title or first.name) if first is not None else "",
        tags=profile.tags,
        rows=rows,
        missing=tuple(row.title for row in rows if row.is_missing),
        missing_names=tuple(one.name for one in missing),
        initials=_initials(title),
        address=robot_address(robot) if robot.playback is None else "",
        settings_url=settings_url,
        dev_url=f"{url}dev" if ways.has_dev else "",
        is_live=not missing and robot.playback is None,
        is_emulated=robot.is_emulated,
        recorded=_utc(robot.playback.began_s) if robot.playback is not None else "",
    )


def _kind(summary: str, title: str) -> str:
    """Return the first clause of a summary; "" if it only repeats the title."""
    clause = _CLAUSE_END.split(summary.strip(), maxsplit=1)[0]
    return "" if clause.casefold() == title.casefold() else clause


def _initials(title: str) -> str:
    """Return the initials of a title's first two words, in upper case."""
    words = title.replace("-", " ").split()
    return "".join(word[0] for word in words[:2]).upper()


def _utc(time_s: float) -> str:
    return strftime("%Y-%m-%d %H:%M UTC", gmtime(time_s))


def _broken(name: str, one: BrokenRobot, ways: NavigationLinks) -> Card:
    url = f"/robots/{quote(name, safe='')}/"
    settings_url = f"{url}settings" if ways.has_managers else ""
    label = t("Settings of {title}", title=one.title)
    return Card(
        name=name,
        title=one.title,
        summary="",
        kind="",
        url=url,
        link=settings_url,
        link_label=label,
        driver=name,
        interface="",
        tags=(),
        rows=(),
        missing=(),
        missing_names=(),
        initials=_initials(one.title or name),
        settings_url=settings_url,
        fault=one.fault,
    )
