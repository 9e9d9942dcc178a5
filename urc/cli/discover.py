"""`urc discover`: find announced robots, serial ports, cameras and ROS topics."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from urc.cli.arguments import add_settings, duration, is_loopback, load
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
    """Declare the command-line arguments: profile, duration and output format."""
    parser.add_argument(
        "profile",
        metavar="PROFILE",
        nargs="?",
        help="robot file or robot name: search only for its transports and services",
    )
    add_settings(parser)
    parser.add_argument(
        "--for", dest="seconds", type=duration, default=DEFAULT_S, metavar="TIME",
        help="time to listen for announcements (default: 3s)",
    )  # fmt: skip
    parser.add_argument(
        "--cameras", action="store_true", help="also search for ONVIF cameras on all networks"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON line per result")


def run(arguments: argparse.Namespace) -> int:
    """Search for robots and print the results; return 1 if nothing was found."""
    from urc.cli.event_loop import run_loop
    from urc.cli.settings import complete_settings, settings_given

    if arguments.profile is None:
        known = _known_robots()
        given = [values for values, _ in settings_given(known, arguments)]
        return run_loop(_look_around(known, arguments, nearby=given))
    profile = load(arguments.profile)
    settings = complete_settings(profile, arguments)
    return run_loop(_look_around([profile], arguments, settings))


def _known_robots() -> list["Profile"]:
    """Return the shipped robots with valid profiles."""
    from urc.shipped import shipped

    found = []
    for path in sorted(shipped("robots").glob("*.yaml")):
        try:
            found.append(load(str(path)))
        except UrcError as problem:
            complain(f"urc discover: {path.name} is omitted: {str(problem).splitlines()[0]}")
    return found


async def _look_around(
    profiles: Sequence["Profile"],
    arguments: argparse.Namespace,
    settings: Mapping[str, "Value"] | None = None,
    nearby: Sequence[Mapping[str, "Value"]] = (),
) -> int:
    rows: list[Row] = []
    lines = {spec.type for profile in profiles for spec in profile.driver.transports.values()}
    if settings is None or "serial" in lines:
        rows += _serial()
    rows += await _mdns(profiles, arguments.seconds)
    if arguments.cameras:
        rows += await _cameras(arguments.seconds)
    hint = ""
    if settings is not None and "ros" in lines:
        topics, hint = await _topics(profiles[0], settings)
        rows += topics
    if nearby:
        typed = {text for _, text in arguments.settings}
        lines_here, hint = await _nearby(profiles, nearby, typed)
        rows += lines_here
    if arguments.json:
        for row in rows:
            print(json_text(dict(row)))
    elif rows:
        print(_table(rows))
        if hint:
            print("\nFor the profile:\n")
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


async def _cameras(seconds: float) -> list[Row]:
    from urc.transports.discover_onvif import cameras

    try:
        found = await cameras(seconds)
    except OSError as fault:
        complain(f"urc discover: the search for cameras is not available ({fault})")
        return []
    return [
        {"found": "camera", "place": f"{one.host}:{one.port}", "what": f"{one.name} ({one.path})",
         "host": one.host, "port": one.port, "path": one.path, "name": one.name}
        for one in found
    ]  # fmt: skip


async def _nearby(
    profiles: Sequence["Profile"], settings: Sequence[Mapping[str, "Value"]], typed: set[str]
) -> tuple[list[Row], str]:
    """Return the shipped robots whose ports are open, on this machine or on the given hosts.

    A setting without a value in `settings` has its default value.

    For each rosbridge that replies, the result includes its topics.
    """
    from urc.transports.discover_local import listening

    robots: dict[tuple[str, int], list[str]] = {}
    bridges: dict[tuple[str, int], tuple[Profile, Mapping[str, Value]]] = {}
    for profile, values in zip(profiles, settings, strict=True):
        for kind, place in _places(profile, values):
            if is_loopback(place[0]) or place[0] in typed:
                robots.setdefault(place, []).append(profile.name)
                if kind == "ros":
                    bridges.setdefault(place, (profile, values))
    rows: list[Row] = []
    hints: list[str] = []
    for place in await listening(robots):
        names = ", ".join(dict.fromkeys(robots[place]))
        rows.append(
            {"found": "port", "place": f"{place[0]}:{place[1]}", "what": f"possibly {names}",
             "host": place[0], "port": place[1]}
        )  # fmt: skip
        if place in bridges:
            topics, hint = await _topics(*bridges[place])
            rows += topics
            hints.append(hint)
    return rows, "\n\n".join(filter(None, hints))


def _places(
    profile: "Profile", settings: Mapping[str, "Value"]
) -> Iterator[tuple[str, tuple[str, int]]]:
    """Yield the type, host and port of each transport whose settings are complete."""
    from urc.runtime.settings import options_of
    from urc.transports.ros.choice import PORTS

    for spec in profile.driver.transports.values():
        if spec.type not in ("tcp", "ros", "mqtt", "zenoh", "telnet", "ssh") or spec.tunnel:
            continue
        try:
            options = options_of(spec, settings)
        except UrcError:
            continue  # a setting without a value: the address is unknown
        usual = PORTS.get(str(options.get("via", "rosbridge")), ()) if spec.type == "ros" else ()
        host, port = options.get("host"), options.get("port")
        for number in usual if port is None else (port,):
            if isinstance(host, str) and host and isinstance(number, int):
                yield spec.type, (host, number)


async def _topics(profile: "Profile", settings: Mapping[str, "Value"]) -> tuple[list[Row], str]:
    from urc.runtime.discover import RosTopic, ros_topics, snippet
    from urc.runtime.registries import built_in_catalog
    from urc.runtime.transport_chain import make_transports

    rows: list[Row] = []
    parts: list[str] = []
    # Make no subscriptions, because a ROS 1 bridge would list them as topics.
    driver = profile.driver._replace(messages={})
    made = make_transports(driver, settings, built_in_catalog().transports)
    for name, spec in profile.driver.transports.items():
        if spec.type != "ros":
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
