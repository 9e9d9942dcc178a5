"""Servers that make an emulated robot reachable, for operators, tests and ``urc demo``.

The package `urc.simulator.servers` contains one server for each type of transport.
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
from urc.protocol.forms.json_text import filled
from urc.protocol.forms.topics import actions_of, listened, published
from urc.simulator.emulated_robot import EmulatedRobot
from urc.simulator.servers.base import (
    SERVERS,
    Endpoint,
    LastPeer,
    ServerContext,
    SimulatedServer,
    host_and_port,
)

__all__ = ["serve"]

_LOOPBACK = "127.0.0.1"
_PORTS = {"ssh": 22, "telnet": 23, "ros": 9090, "zenoh": 7447}
"""Default ports of the transport types whose `port` is optional."""


@asynccontextmanager
async def serve(
    profile: Profile,
    settings: Mapping[str, Value],
    host: str = "127.0.0.1",
    *,
    now: Callable[[], float] = time.time,
    is_anywhere: bool = False,
    emulated_robot: EmulatedRobot | None = None,
) -> AsyncIterator[Mapping[str, Endpoint]]:
    """Emulate the robot of `profile` until the context ends.

    Args:
        profile: profile with `simulator` rules.
        settings: values for ports and templates; for port 0, the system chooses a free port.
        host: local address to listen on; the default accepts only local clients.
        now: function that returns the time in seconds since the epoch, ``now`` in templates.
        is_anywhere: whether to listen on free ports instead of the profile's ports and paths.
        emulated_robot: emulated robot to serve; None to create one from the profile.

    Returns:
        Endpoint of each transport, keyed by transport name.

    Raises:
        UrcError: a transport cannot be emulated, or an address is not available.
    """
    robot = emulated_robot or EmulatedRobot(profile, settings)
    transports = profile.driver.transports
    inside: dict[str, dict[tuple[str, int], Endpoint]] = {name: {} for name in transports}
    last_peer = LastPeer()
    servers: list[SimulatedServer] = []
    listening: dict[str, Endpoint] = {}
    ready = asyncio.create_task(asyncio.to_thread(robot.prepare))
    try:
        for name in sorted(transports, key=lambda name: -_depth(transports, name)):
            spec = transports[name]
            context = ServerContext(
                name=name,
                spec=spec,
                options=_options_of(spec, settings),
                host=_LOOPBACK if spec.tunnel else host,  # only the robot connects through tunnels
                line=lambda name=name: robot.line(name),  # type: ignore[misc] # of this turn
                now=now,
                topics=listened(profile.driver, name, settings),
                taken={one.topic: one.type for one in published(profile.driver, name, settings)},
                actions=actions_of(profile.driver, name, settings),
                is_anywhere=is_anywhere or bool(spec.tunnel),
                picture=lambda topics, name=name: robot.picture(name, topics, now()),  # type: ignore[misc] # of this turn
                video=lambda name=name: robot.video(name, now()),  # type: ignore[misc] # of this turn
                last_peer=last_peer,
                carried=inside[name],
            )
            servers.append(server := _server(context))
            listening[name] = await server.open()
            if spec.tunnel:
                listening[name] = _put_inside(inside[spec.tunnel], context, listening[name])
        yield {name: listening[name] for name in transports}
    finally:
        for server in reversed(servers):
            await server.close()
        await asyncio.gather(ready, return_exceptions=True)


def _server(context: ServerContext) -> SimulatedServer:
    row = SERVERS.get(context.spec.type)
    if row is None:
        known = ", ".join(sorted(SERVERS))
        message = f"{context.spec.type} cannot be emulated; supported types: {known}"
        raise UrcError(f"transports.{context.name}: {message}")
    server: SimulatedServer = row.load()(context)
    return server


def _depth(transports: Mapping[str, TransportSpec], name: str) -> int:
    """Return the number of tunnels through which this transport connects."""
    tunnel = transports[name].tunnel
    return 1 + _depth(transports, tunnel) if tunnel else 0


def _put_inside(
    inside: dict[tuple[str, int], Endpoint], context: ServerContext, found: Endpoint
) -> Endpoint:
    """Make a transport reachable through its tunnel; return the endpoint for clients."""
    host, port, url = _known_as(context)
    if not isinstance(host, str) or not isinstance(port, int):
        message = f"{context.spec.type} cannot be emulated through a tunnel"
        raise UrcError(f"transports.{context.name}: {message}")
    inside[host.strip(), port] = found
    text = f"{context.spec.type} {host_and_port(host, port)} through {context.spec.tunnel}"
    options = {key: value for key, value in found.options.items() if key not in ("host", "port")}
    return found._replace(text=text, options=options | ({"url": url} if url else {}))


def _known_as(context: ServerContext) -> tuple[object, object, str]:
    """Return a transport's host, port and URL; the URL has a scheme without TLS, or is ""."""
    url = context.options.get("url")
    if not isinstance(url, str):
        host, port = context.options.get("host"), context.options.get("port")
        return host, _PORTS.get(context.spec.type) if port is None else port, ""
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:
        return None, None, ""
    plain = parts.scheme.removesuffix("s")
    if port is None:
        port = 80 if plain == parts.scheme else 443
    host = parts.hostname or ""
    return host, port, parts._replace(scheme=plain, netloc=host_and_port(host, port)).geturl()


def _options_of(spec: TransportSpec, settings: Mapping[str, Value]) -> dict[str, object]:
    options: dict[str, object] = {}
    for key, option in spec.options.items():
        try:
            options[key] = filled(option, {"settings": settings})
        except ExpressionError as problem:
            raise UrcError(f"transports.{spec.name}.{key}: {problem}") from problem
    return options
