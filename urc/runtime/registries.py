"""The built-in tables of transport types and framing types.

This module does not import any transports or framings. Each transport and framing is imported on
first use.
"""

from urc.registry import Registries

__all__ = ["built_in_catalog"]


def built_in_catalog() -> Registries:
    """Return the table of built-in transport types, and the table of built-in framing types."""
    from urc.protocol.framing.table import FRAMINGS
    from urc.transports.table import TRANSPORTS

    return Registries(transports=TRANSPORTS, framings=FRAMINGS)
