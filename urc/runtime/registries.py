"""The built-in tables of transports and framings.

The module imports no transport, framing or event loop; each is imported at its first use.
"""

from urc.registry import Registries

__all__ = ["built_in_catalog"]


def built_in_catalog() -> Registries:
    """Return the tables of transports and framings."""
    from urc.protocol.framing.table import FRAMINGS
    from urc.transports.table import TRANSPORTS

    return Registries(transports=TRANSPORTS, framings=FRAMINGS)
