"""Detection of data that the remote program has sent, as opposed to envelopes made in URC.

Some transports deliver envelopes of their own, or deliver messages some time after their arrival.
Neither shows that the remote program still works. Such a transport counts the messages that have
arrived (`SupportsArrivals`). All data that other transports deliver has just arrived.
"""

from urc.transports.base import SupportsArrivals, Transport

__all__ = ["ArrivalCheck"]


class ArrivalCheck:
    """Returns whether the remote program has sent data since the last call."""

    def __init__(self, transport: Transport) -> None:
        """Create the check of one transport, for all its connections."""
        self._transport = transport if isinstance(transport, SupportsArrivals) else None
        self._seen = -1

    @property
    def is_counted(self) -> bool:
        """Whether the transport counts arrivals."""
        return self._transport is not None

    def begin(self) -> None:
        """Record that a connection is open; the first call of `is_new` then returns True."""
        self._seen = -1

    def is_new(self) -> bool:
        """Return whether data has arrived since the last call; True if the transport has no count.

        Callers ask only after a delivery, unless `is_counted` is true.
        """
        if self._transport is None:
            return True
        before, self._seen = self._seen, self._transport.arrivals()
        return self._seen != before
