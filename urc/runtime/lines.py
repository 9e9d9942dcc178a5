"""The transports of a driver, made in the order in which they carry each other."""

from collections.abc import Mapping
from typing import NamedTuple, cast

from urc.model.driver import Driver, TransportSpec
from urc.model.values import Value
from urc.protocol.topics import listened
from urc.registry import Table
from urc.runtime.settings import options_of
from urc.transports.base import Carrier, Setup, Subscription, Transport

__all__ = ["Made", "make_lines", "make_transports"]


class Made(NamedTuple):
    """A transport, and what it was made from."""

    spec: TransportSpec
    factory: str
    """``module:attribute``."""
    setup: Setup
    transport: Transport


def make_lines(driver: Driver, settings: Mapping[str, Value], table: Table) -> dict[str, Made]:
    """Return name → transport, none of them open; those that carry others come before them.

    Args:
        driver: as loaded: no transport goes through itself.
        settings: a value for every setting.
        table: the kinds of transport.

    Raises:
        UrcError: a transport cannot be made with these settings.
    """
    made: dict[str, Made] = {}

    def make(name: str) -> Transport:
        if name not in made:
            spec = driver.transports[name]
            # The loader saw to it that only what carries others is named by `via`.
            via = cast("Carrier", make(spec.via)) if spec.via else None
            topics = listened(driver, name, settings)
            setup = Setup(
                name,
                options_of(spec, settings),
                tuple(Subscription(*topic) for topic in topics.items()),
                via,
            )
            row = table[spec.type]
            made[name] = Made(spec, row.factory, setup, row.load()(setup))
        return made[name].transport

    for name in driver.transports:
        make(name)
    return made


def make_transports(
    driver: Driver, settings: Mapping[str, Value], table: Table
) -> dict[str, Transport]:
    """Return name → transport, none of them open; see `make_lines`."""
    return {name: made.transport for name, made in make_lines(driver, settings, table).items()}
