"""The kinds of transport a document may name, imported only when used."""

from urc.registry import Table

__all__ = ["TRANSPORTS"]

TRANSPORTS = Table("urc.transports", {"tcp": "urc.transports.tcp:from_options"})
"""Each row's factory takes the transport's own options, evaluated, and returns a `Transport`."""
