"""The tables that URC ships, gathered for whoever loads or connects a robot.

Imports no transport, no framing and no event loop: a row is imported when it is used.
"""

from urc.registry import Catalog

__all__ = ["built_in_catalog"]


def built_in_catalog() -> Catalog:
    """Return the tables of transports and framings."""
    from urc.protocol.framing import FRAMINGS
    from urc.transports.table import TRANSPORTS

    return Catalog(transports=TRANSPORTS, framings=FRAMINGS)
