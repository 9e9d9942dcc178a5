"""`urc discover`: robots that announce themselves, serial ports, and the topics of a rosbridge."""

import argparse
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from urc.cli.arguments import add_settings, duration, load
from urc.cli.output import complain, json_text
from urc.problems import UrcError, printable

if TYPE_CHECKING:
    from urc.model.profile import Profile
    from urc.model.values import Value

EXAMPLE = "urc discover generic-ros1 --set host=192.168.1.20"

DEFAULT_S = 3.0
_OPEN_S = 5.0

Row = Mapping[str, object]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the profile, how long, and the form of the output."""
    parser.add_argument(
        "profile",
        metavar="PROFILE",
        nargs="?",
        help="a robot file, or the name of a robot: its own kinds of lines and services only",
    )
    add_settings(parser)
    parser.add_argument(
        "--for", dest="seconds", type=duration, default=DEFAULT_S, metavar="TIME",
        help="how long to listen for announcements, 3s by default",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="a JSON line for each thing found")


def run(arguments: argparse.Namespace) -> int:
    """Look around; 1 when nothing was found."""
    from urc.cli.running import run_loop
    from urc.cli.settings import complete_settings

    if arguments.profile is None:
        return run_loop(_look_around(_known_robots(), arguments))
    profile = load(arguments.profile)
    settings = complete_settings(profile, arguments)
    return run_loop(_look_around([profile], arguments, settings))


def _known_robots() -> list["Profile"]:
    """Return the robots that ship with URC; one that does not load is another verb's matter."""
    from urc.shipped import shipped

    found = []
    for path in sorted(shipped("robots").glob("*.yaml")):
        try:
            found.append(load(str(path)))
        except UrcError as problem:
            complain(f"urc discover: {path.name} is left out: {str(problem).splitlines()[0]}")
    return found


async def _look_around(
    profiles: Sequence["Profile"],
    arguments: argparse.Namespace,
    settings: Mapping[str, "Value"] | None = None,
) -> int:
    rows: list[Row] = []
    lines = {spec.type for profile in profiles for spec in profile.driver.transports.values()}
    if settings is None or "serial" in lines:
        rows += _serial()
    rows += await _mdns(profiles, arguments.seconds)
    hint = ""
    if settings is not None and "rosbridge" in lines:
        topics, hint = await _topics(profiles[0], settings)
        rows += topics
    if arguments.json:
        for row in rows:
            print(json_text(dict(row)))
    elif rows:
        print(_table(rows))
        if hint:
            print("\nIn the profile, for what is known of them:\n")
            print("\n".join(map(printable, hint.split("\n"))))
    if not rows:
        complain("urc discover: nothing was found")
    return int(not rows)


def _serial() -> list[Row]:
    from urc.transports.base import TransportError
    from urc.transports.discover_serial import serial_ports

    try:
        ports = serial_ports()
    except TransportError as problem:
        complain(f"urc discover: {problem}")
        return []
    return [
        {"found": "serial", "place": one.device, "what": one.product or one.usb, "usb": one.usb,
         "serial_number": one.serial_number}
        for one in ports
    ]  # fmt: skip


async def _mdns(profiles: Sequence["Profile"], seconds: float) -> list[Row]:
    from urc.transports.base import TransportError
    from urc.transports.discover_mdns import announced

    types = sorted({kind for profile in profiles for kind in profile.driver.discovery})
    if not types:
        return []
    try:
        services = await announced(types, seconds)
    except TransportError as problem:
        complain(f"urc discover: {problem}")
        return []
    return [
        {"found": "mdns", "place": f"{one.host}:{one.port}", "what": f"{one.name} ({one.type})",
         "host": one.host, "port": one.port, "type": one.type, "name": one.name}
        for one in services
    ]  # fmt: skip


async def _topics(profile: "Profile", settings: Mapping[str, "Value"]) -> tuple[list[Row], str]:
    from urc.runtime.catalog import built_in_catalog
    from urc.runtime.discover import RosTopic, ros_topics, snippet
    from urc.runtime.lines import make_transports

    rows: list[Row] = []
    parts: list[str] = []
    made = make_transports(profile.driver, settings, built_in_catalog().transports)
    for name, spec in profile.driver.transports.items():
        if spec.type != "rosbridge":
            continue
        try:
            topics: list[RosTopic] = await ros_topics(made[name], _OPEN_S)
        except UrcError as problem:
            complain(f"urc discover: {name}: {problem}")
            continue
        rows += [
            {"found": "topic", "place": one.name, "what": one.type, "transport": name}
            for one in topics
        ]
        parts.append(snippet(topics, name))
    return rows, "\n\n".join(filter(None, parts))


def _table(rows: Sequence[Row]) -> str:
    cells = [[printable(str(row[key])) for key in ("found", "place", "what")] for row in rows]
    widths = [max(len(row[place]) for row in cells) for place in range(2)]
    return "\n".join(
        f"{row[0]:<{widths[0]}}  {row[1]:<{widths[1]}}  {row[2]}".rstrip() for row in cells
    )
