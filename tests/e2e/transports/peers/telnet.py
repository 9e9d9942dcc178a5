"""A robot that speaks over Telnet and negotiates nothing; the real servers have their own tests."""

from tests.e2e.transports.peers.tcp import TcpPeer
from urc.transports.base import Transport, TransportSetup
from urc.transports.telnet import from_setup

__all__ = ["TelnetPeer"]


class TelnetPeer(TcpPeer):
    """Listens on a free port of loopback."""

    def transport(self) -> Transport:
        """Return a line that leads here."""
        return from_setup(TransportSetup("wire", {"host": "127.0.0.1", "port": self.port}))
