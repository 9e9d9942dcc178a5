"""Puts an emulated robot on real lines, for people, tests and ``urc demo``.

How a client gets in is the matter of a door (`urc.simulator.doors`), one a kind of transport.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from urllib.parse import urlsplit

from urc.expressions import ExpressionError
from urc.model.driver import TransportSpec
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.protocol.json_text_form import filled
from urc.protocol.topics import listened
from urc.simulator.doors.base import DOORS, Caller, Door, Listening, Place, shown_place
from urc.simulator.twin import Twin

__all__ = ["serve"]

_LOOPBACK = "127.0.0.1"
_PORTS = {"ssh": 22, "telnet": 23, "rosbridge": 9090}
"""Ports of kinds of transport that need not be told one."""


@asynccontextmanager
async def serve(
    profile: Profile,
    settings: Mapping[str, Value],
    host: str = "127.0.0.1",
    *,
    now: Callable[[], float] = time.time,
    is_anywhere: bool = False,
    twin: Twin | None = None,
) -> AsyncIterator[Mapping[str, Listening]]:
    """Emulate the robot of `profile` until the context ends.

    Args:
        profile: its `simulator` rules answer.
        settings: for ports and templates; a port of 0 lets the system choose.
        host: address to listen on; the default can be reached from this machine only.
        now: seconds since the epoch, the templates' ``now``.
        is_anywhere: listen where it is free, whatever the profile says about ports and paths.
        twin: the emulated robot, for who wants to look at it; made from the profile by default.

    Returns:
        Transport → where it listens.

    Raises:
        UrcError: a transport that cannot be emulated, or a place that cannot be had.
    """
    robot = twin or Twin(profile, settings)
    transports = profile.driver.transports
    inside: dict[str, dict[tuple[str, int], Listening]] = {name: {} for name in transports}
    caller = Caller()
    doors: list[Door] = []
    listening: dict[str, Listening] = {}
    ready = asyncio.create_task(asyncio.to_thread(robot.prepare))
    try:
        for name in sorted(transports, key=lambda name: -_depth(transports, name)):
            spec = transports[name]
            place = Place(
                name=name,
                spec=spec,
                options=_options_of(spec, settings),
                # What is reached through another line is known inside the robot alone.
                host=_LOOPBACK if spec.via else host,
                line=lambda name=name: robot.line(name),  # type: ignore[misc] # of this turn
                now=now,
                topics=listened(profile.driver, name, settings),
                is_anywhere=is_anywhere or bool(spec.via),
                picture=lambda topics, name=name: robot.picture(name, topics, now()),  # type: ignore[misc] # of this turn
                caller=caller,
                carried=inside[name],
            )
            door = _door(place)
            doors.append(door)
            listening[name] = await door.open()
            if spec.via:
                listening[name] = _put_inside(inside[spec.via], place, listening[name])
        yield {name: listening[name] for name in transports}
    finally:
        for door in reversed(doors):
            await door.close()
        await asyncio.gather(ready, return_exceptions=True)


def _door(place: Place) -> Door:
    row = DOORS.get(place.spec.type)
    if row is None:
        known = ", ".join(sorted(DOORS))
        message = f"{place.spec.type} cannot be emulated; these can: {known}"
        raise UrcError(f"transports.{place.name}: {message}")
    door: Door = row.load()(place)
    return door


def _depth(transports: Mapping[str, TransportSpec], name: str) -> int:
    """Return how many others a transport goes through."""
    via = transports[name].via
    return 1 + _depth(transports, via) if via else 0


def _put_inside(
    inside: dict[tuple[str, int], Listening], place: Place, found: Listening
) -> Listening:
    """Let a line be reached through another one as the driver says; return how it looks outside."""
    host, port, url = _known_as(place)
    if not isinstance(host, str) or not isinstance(port, int):
        message = f"{place.spec.type} cannot be emulated behind another transport"
        raise UrcError(f"transports.{place.name}: {message}")
    inside[host.strip(), port] = found
    text = f"{place.spec.type} {shown_place(host, port)} through {place.spec.via}"
    options = {key: value for key, value in found.options.items() if key not in ("host", "port")}
    return found._replace(text=text, options=options | ({"url": url} if url else {}))


def _known_as(place: Place) -> tuple[object, object, str]:
    """Return host and port by which the driver knows a line, and its URL without TLS, if any."""
    url = place.options.get("url")
    if not isinstance(url, str):
        host, port = place.options.get("host"), place.options.get("port")
        return host, _PORTS.get(place.spec.type) if port is None else port, ""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        return None, None, ""
    plain = parts.scheme.removesuffix("s")
    if port is None:
        port = 80 if plain == parts.scheme else 443
    host = parts.hostname or ""
    return host, port, parts._replace(scheme=plain, netloc=shown_place(host, port)).geturl()


def _options_of(spec: TransportSpec, settings: Mapping[str, Value]) -> dict[str, object]:
    options: dict[str, object] = {}
    for key, option in spec.options.items():
        try:
            options[key] = filled(option, {"settings": settings})
        except ExpressionError as problem:
            raise UrcError(f"transports.{spec.name}.{key}: {problem}") from problem
    return options
