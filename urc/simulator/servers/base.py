"""The protocol, the context and the registry of simulated servers."""

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
    """The address at which clients reach a simulated server."""

    host: str
    """Network address; "" for a server without an address."""
    port: int
    """TCP or UDP port; 0 for a server without a port."""
    text: str
    """Description for people, such as ``tcp 127.0.0.1:6789`` or ``serial /dev/pts/3``."""
    options: Mapping[str, object] = NOTHING
    """Options for connecting the driver's transport to this server. These options override the
    driver's options.
    """
    path: str = ""
    """Path of a serial port's device file."""


class LastPeer:
    """The host that last sent data to the robot, through any server."""

    def __init__(self) -> None:
        self.host = ""
        """Address of the host; "" before any data has arrived."""


class ServerContext(NamedTuple):
    """All that a simulated server needs: its transport, its address and the emulated robot."""

    name: str
    """Name of the transport in the driver."""
    spec: TransportSpec
    options: Mapping[str, object]
    """Transport options with evaluated settings."""
    host: str
    """Local address to listen on."""
    line: Callable[[], EmulatedConnection]
    """Function that creates the robot's side of a new connection."""
    now: Callable[[], float]
    """Function that returns the current time, in seconds since the epoch; templates read the time
    as ``now``."""
    topics: Mapping[str, Mapping[str, Value]] = NOTHING
    """Options of the driver's subscriptions on a message transport, keyed by topic."""
    taken: Mapping[str, str] = NOTHING
    """Types of the topics that the driver publishes, keyed by topic."""
    actions: tuple[str, ...] = ()
    """Names of the actions to which the driver sends goals or cancellations."""
    is_anywhere: bool = False
    """Whether to listen on any free port instead of the configured port."""
    picture: Callable[[Sequence[str]], bytes | None] = lambda _: None
    """Function that returns the current world image for the given topic names; None if there is no
    image."""
    video: Callable[[], bytes | None] = lambda: None
    """Function that returns the current image of a camera transport's video. The result is b"" if
    the robot has no world, and None while the robot sends no video."""
    last_peer: LastPeer | None = None
    """Host that last sent data, shared by all of the robot's servers; None means that the host is
    not recorded."""
    carried: Mapping[tuple[str, int], Endpoint] = MappingProxyType({})
    """Other servers of the robot that clients can reach through this server, as through a tunnel.
    The keys are hosts and ports in the driver, and the values are endpoints of the emulated
    robot."""


class SimulatedServer(Protocol):
    """A server for one transport of the emulated robot."""

    async def open(self) -> Endpoint:
        """Start accepting clients.

        Raises:
            UrcError: the address is not available. The error message starts with
                ``transports.NAME``.
        """

    async def close(self) -> None:
        """Stop accepting clients and disconnect all clients.

        Release all tasks, sockets and files.
        """


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
        "zenoh": "urc.simulator.servers.zenoh:ZenohRobot",
        "camera": "urc.simulator.servers.camera:CameraServer",
    },
)
"""Class of simulated server for each type of transport. Each class implements `SimulatedServer` and
takes a `ServerContext`."""


def option_port(context: ServerContext, key: str = "port", default: int | None = None) -> int:
    """Return the port to listen on, 0 to 65535. For port 0, the system chooses a port.

    Args:
        context: context of the server.
        key: name of the option.
        default: default port of the transport type.

    Raises:
        UrcError: the option is not a valid port.
    """
    if context.is_anywhere:
        return 0
    port = context.options.get(key, default)
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise UrcError(f"transports.{context.name}.{key}: {port!r} is not a port to listen on")
    return port


def host_and_port(host: str, port: int) -> str:
    """Return a host and port as ``HOST:PORT``, with brackets around an IPv6 address."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def cannot_listen(context: ServerContext, port: int, fault: OSError, kind: str = "") -> UrcError:
    """Return the error for an address on which the server cannot listen."""
    where = f"{kind}{host_and_port(context.host, port)}"
    return UrcError(f"transports.{context.name}: cannot listen on {where} ({reason(fault)})")


def reason(fault: OSError) -> str:
    """Return the system's error text, without the address that asyncio repeats."""
    if isinstance(fault, socket.gaierror) or not fault.errno:
        return str(fault.strerror or fault).lower()
    return os.strerror(fault.errno).lower()
