"""A driver's transports, ordered so that each tunnel precedes the transports that it carries."""

from collections.abc import Collection, Mapping
from typing import NamedTuple, cast

from urc.model.driver import Driver, TransportSpec
from urc.model.values import Value
from urc.problems import UrcError
from urc.protocol.forms.topics import listened, packed_topics
from urc.registry import Table
from urc.runtime.settings import options_of
from urc.transports.base import (
    MissingPackage,
    TopicSubscription,
    Transport,
    TransportSetup,
    Tunnel,
)

__all__ = [
    "BuiltTransport",
    "absent_cameras",
    "alone",
    "make_lines",
    "make_transports",
    "without",
]


class BuiltTransport(NamedTuple):
    """A transport, with the declaration, factory and setup from which it was built."""

    spec: TransportSpec
    factory: str
    """Factory, as ``module:attribute``."""
    setup: TransportSetup
    transport: Transport


def make_lines(
    driver: Driver, settings: Mapping[str, Value], table: Table
) -> dict[str, BuiltTransport]:
    """Return the closed transports by name; each tunnel precedes the transports that it carries.

    Args:
        driver: the loaded driver, without circular tunnels.
        settings: a value for every setting.
        table: table of the available transport types.

    Raises:
        UrcError: a transport cannot be built with these settings.
    """
    made: dict[str, BuiltTransport] = {}

    def make(name: str) -> Transport:
        if name not in made:
            spec = driver.transports[name]
            # The loader has checked that `tunnel` names a tunnel.
            tunnel = cast("Tunnel", make(spec.tunnel)) if spec.tunnel else None
            options, topics = options_of(spec, settings), listened(driver, name, settings)
            if spec.type == "ros" and options.get("via") == "zenoh":
                topics = _with_hashes(topics)
            elif spec.type == "ros":
                topics = _with_packed(topics, packed_topics(driver, name, settings))
            setup = TransportSetup(
                name,
                options,
                tuple(TopicSubscription(*topic) for topic in topics.items()),
                tunnel,
            )
            row = table[spec.type]
            made[name] = BuiltTransport(spec, row.factory, setup, row.load()(setup))
        return made[name].transport

    for name in driver.transports:
        make(name)
    return made


def _with_hashes(topics: dict[str, Mapping[str, Value]]) -> dict[str, Mapping[str, Value]]:
    """Add the hash of each known type, which a transport to rmw_zenoh needs for its tokens."""
    from urc.protocol.ros.known_types import known_hash  # only for these robots

    return {
        topic: {**how, "hash": known_hash(str(how["type"]))} if "type" in how else how
        for topic, how in topics.items()
    }


def _with_packed(
    topics: dict[str, Mapping[str, Value]], packed: frozenset[str]
) -> dict[str, Mapping[str, Value]]:
    """Mark the topics whose cells the driver reads as bytes."""
    return {
        topic: {**how, "packed": True} if topic in packed else how for topic, how in topics.items()
    }


def make_transports(
    driver: Driver,
    settings: Mapping[str, Value],
    table: Table,
    *,
    only_cameras: bool = False,
) -> dict[str, Transport]:
    """Return the closed transports by name, in the order of `make_lines`.

    Args:
        driver: the loaded driver, without circular tunnels.
        settings: a value for every setting.
        table: table of the available transport types.
        only_cameras: whether to return only the transports of cameras.

    Raises:
        UrcError: a transport cannot be built with these settings.
    """
    lines = make_lines(driver, settings, table)
    return {
        name: made.transport
        for name, made in lines.items()
        if made.spec.is_camera or not only_cameras
    }


def absent_cameras(
    driver: Driver, settings: Mapping[str, Value], table: Table
) -> dict[str, MissingPackage]:
    """Return the cameras whose package is not installed, each with the reason.

    Cameras accept no data and move nothing, so the robot's other transports work without them. For
    a robot whose transports are all cameras, the result is empty: without its package, such a robot
    cannot be opened.

    Args:
        driver: the loaded driver.
        settings: a value for every setting.
        table: table of the available transport types.
    """
    cameras = [name for name, spec in driver.transports.items() if spec.is_camera]
    found: dict[str, MissingPackage] = {}
    if len(cameras) == len(driver.transports):
        return found
    for name in cameras:
        try:
            make_transports(alone(driver, name), settings, table)
        except MissingPackage as fault:
            found[name] = fault
        except UrcError:
            continue  # reported when all transports are built
    return found


def without(driver: Driver, names: Collection[str]) -> Driver:
    """Return the driver without the transports `names`, which carry no other transport."""
    kept = {name: spec for name, spec in driver.transports.items() if name not in names}
    return driver._replace(transports=kept)


def alone(driver: Driver, name: str) -> Driver:
    """Return the driver with one transport and its tunnels.

    The loader has checked that tunnels are not circular.
    """
    kept = {}
    while name:
        kept[name] = driver.transports[name]
        name = kept[name].tunnel
    return driver._replace(transports=kept)
