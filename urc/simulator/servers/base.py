"""A simulated server: its protocol, its context, and the table of its kinds."""

import os
import socket
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, Protocol

from urc.model.driver import TransportSpec
from urc.model.values import NOTHING, Value
from urc.problems import UrcError
from urc.registry import Table
from urc.simulator.emulated_robot import EmulatedConnection

__all__ = [
    "SERVERS",
    "Endpoint",
    "LastPeer",
    "ServerContext",
    "SimulatedServer",
    "cannot_listen",
    "host_and_port",
    "option_port",
    "reason",
]


class Endpoint(NamedTuple):
    """The address of an open server."""

    host: str
    """Address, or "" without one."""
    port: int
    """0 without a port."""
    text: str
    """For people and ``urc simulate``: ``tcp 127.0.0.1:6789``, ``serial /dev/pts/3``."""
    options: Mapping[str, object] = NOTHING
    """Options that the driver's transport needs to connect here. These options override those of
    the driver.
    """
    path: str = ""
    """Path of the device file, for serial ports."""


class LastPeer:
    """The host that last sent something to the robot, through any of its servers."""

    def __init__(self) -> None:
        self.host = ""
        """Address of the client, or "" before its first message."""


class ServerContext(NamedTuple):
    """The context of a server: its transport, its address, and the robot behind it."""

    name: str
    """Name of the transport in the driver."""
    spec: TransportSpec
    options: Mapping[str, object]
    """Options of the transport, evaluated over the settings."""
    host: str
    """Address to listen on, for kinds of transport that listen."""
    line: Callable[[], EmulatedConnection]
    """Makes the robot's side of a new connection."""
    now: Callable[[], float]
    """Seconds since the epoch, the templates' ``now``."""
    topics: Mapping[str, Mapping[str, Value]] = NOTHING
    """Subscriptions of the driver, on a message transport: topic → options."""
    is_anywhere: bool = False
    """Whether to listen on any free port, in place of the port of the options."""
    picture: Callable[[Sequence[str]], bytes | None] = lambda _: None
    """Names of a topic → the current image of the robot's world, None without one."""
    last_peer: LastPeer | None = None
    """Shared by all servers of the robot; None: not tracked."""
    carried: Mapping[tuple[str, int], Endpoint] = MappingProxyType({})
    """Targets that clients can reach through this server: host and port in the driver → endpoint
    of the emulated robot."""


class SimulatedServer(Protocol):
    """One transport of the emulated robot."""

    async def open(self) -> Endpoint:
        """Accept clients from now on.

        Raises:
            UrcError: the address is not available, in one line that starts with
                ``transports.NAME``.
        """

    async def close(self) -> None:
        """Accept no more clients and disconnect all; leave no task, socket or file behind."""


SERVERS = Table(
    "urc.simulated_servers",
    {
        "tcp": "urc.simulator.servers.tcp:TcpServer",
        "udp": "urc.simulator.servers.udp:UdpServer",
        "serial": "urc.simulator.servers.serial:SerialServer",
        "ssh": "urc.simulator.servers.ssh:SshServer",
        "telnet": "urc.simulator.servers.telnet:TelnetServer",
        "http": "urc.simulator.servers.http:HttpServer",
        "websocket": "urc.simulator.servers.websocket:WebSocketServer",
        "ros": "urc.simulator.servers.rosbridge:RosbridgeServer",
        "mqtt": "urc.simulator.servers.mqtt:MqttRobot",
    },
)
"""Kind of transport → class of a `SimulatedServer`, which is made from a `ServerContext`."""


def option_port(context: ServerContext, key: str = "port", default: int | None = None) -> int:
    """Return the port to listen on, 0..65535; 0 lets the system choose.

    Args:
        context: context of the server.
        key: name of the option.
        default: the usual port of this kind of transport.

    Raises:
        UrcError: the option is not a port.
    """
    if context.is_anywhere:
        return 0
    port = context.options.get(key, default)
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise UrcError(f"transports.{context.name}.{key}: {port!r} is not a port to listen on")
    return port


def host_and_port(host: str, port: int) -> str:
    """Return a host and port in the usual notation."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def cannot_listen(context: ServerContext, port: int, fault: OSError, kind: str = "") -> UrcError:
    """Return the error for an address that is not available."""
    where = f"{kind}{host_and_port(context.host, port)}"
    return UrcError(f"transports.{context.name}: cannot listen on {where} ({reason(fault)})")


def reason(fault: OSError) -> str:
    """Return the system's error text without the address, which asyncio repeats."""
    if isinstance(fault, socket.gaierror) or not fault.errno:
        return str(fault.strerror or fault).lower()
    return os.strerror(fault.errno).lower()
