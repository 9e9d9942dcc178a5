"""The server of the Foxglove SDK as a robot with ROS 2, for tests; rosbags writes its messages."""

import threading
import time
from collections.abc import Callable
from typing import Any

import foxglove
from foxglove import (
    Channel,
    Context,
    MessageSchema,
    Parameter,
    Schema,
    Service,
    ServiceRequest,
    ServiceSchema,
)
from foxglove.websocket import Capability, ServerListener

from bench.rig.ros_messages import ROS1, ROS2

__all__ = ["FoxgloveRobot", "definition"]

CAPABILITIES = [
    Capability.ClientPublish,
    Capability.Parameters,
    Capability.Services,
    Capability.ConnectionGraph,
]


def definition(name: str) -> str:
    """Return the definition of a type as text of ``.msg`` files."""
    return ROS2.generate_msgdef(name, ros_version=2)[0]


class FoxgloveRobot(ServerListener):
    """A robot that records what its clients do."""

    def __init__(
        self, port: int = 0, encodings: tuple[str, ...] = ("cdr", "json"), **options: Any
    ) -> None:
        self.context = Context()
        self.subscribed: list[str] = []
        self.advertised: list[tuple[str, str, str]] = []
        self.heard: list[tuple[str, bytes]] = []
        self.parameters = {"/driver.rate": 10, "/driver.name": "base"}
        self._topics: dict[int, str] = {}
        self._latched: dict[str, bytes] = {}
        """Newest message of each latched topic, which a new subscriber receives."""
        self._channels: dict[str, Channel] = {}
        self._lock = threading.Lock()
        self.server = foxglove.start_server(
            name="robot",
            host="127.0.0.1",
            port=port,
            context=self.context,
            server_listener=self,
            capabilities=CAPABILITIES,
            supported_encodings=list(encodings),
            **options,
        )

    @property
    def port(self) -> int:
        return self.server.port

    def close(self) -> None:
        self.server.stop()

    def publish(self, topic: str, name: str, message: Any, text: str | None = None) -> None:
        """Publish a message of rosbags, announcing the topic if necessary."""
        channel = self._channels.get(topic)
        if channel is None:
            schema = Schema(name=name, encoding="ros2msg", data=(text or definition(name)).encode())
            channel = self._channels[topic] = Channel(
                topic, message_encoding="cdr", schema=schema, context=self.context
            )
        data = message if isinstance(message, bytes) else bytes(ROS2.serialize_cdr(message, name))
        channel.log(data, log_time=time.time_ns())

    def offer_topic(self, topic: str, name: str, text: str) -> Channel:
        """Announce a topic without a message."""
        schema = Schema(name=name, encoding="ros2msg", data=text.encode())
        channel = self._channels[topic] = Channel(
            topic, message_encoding="cdr", schema=schema, context=self.context
        )
        return channel

    def latch(self, topic: str, data: bytes) -> None:
        """Publish a message on an announced topic; later subscribers receive it, too."""
        self._latched[topic] = data
        self._channels[topic].log(data, log_time=time.time_ns())

    def publish_ros1(self, topic: str, name: str, message: Any, text: str | None = None) -> None:
        """Publish a message of ROS 1, as a bridge of ROS 1 does."""
        channel = self._channels.get(topic)
        if channel is None:
            text = text or ROS1.generate_msgdef(name, ros_version=1)[0]
            schema = Schema(name=name.replace("/msg/", "/"), encoding="ros1msg", data=text.encode())
            channel = self._channels[topic] = Channel(
                topic, message_encoding="ros1", schema=schema, context=self.context
            )
        data = message if isinstance(message, bytes) else bytes(ROS1.serialize_ros1(message, name))
        channel.log(data, log_time=time.time_ns())

    def withdraw(self, topic: str) -> None:
        """End a topic."""
        self._channels.pop(topic).close()

    def offer(self, name: str, kind: str, handler: Callable[[bytes], bytes]) -> None:
        """Offer a service of a type whose definitions rosbags knows."""

        def answer(request: ServiceRequest) -> bytes:
            return handler(request.payload)

        parts = []
        for part in ("Request", "Response"):
            full = f"{kind}_{part}"
            schema = Schema(name=full, encoding="ros2msg", data=_service_text(full).encode())
            parts.append(MessageSchema(encoding="cdr", schema=schema))
        described = ServiceSchema(name=kind, request=parts[0], response=parts[1])
        self.server.add_services([Service(name=name, schema=described, handler=answer)])

    # -- callbacks of the server, from its own threads

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self.subscribed.append(channel.topic)
        data = self._latched.get(channel.topic)
        if data is not None:  # the server subscribes after this callback
            late = threading.Timer(0.05, lambda: self.latch(channel.topic, data))
            late.daemon = True
            late.start()

    def on_client_advertise(self, client: Any, channel: Any) -> None:
        self._topics[channel.id] = channel.topic
        self.advertised.append((channel.topic, channel.encoding, channel.schema_name))

    def on_message_data(self, client: Any, client_channel_id: int, data: bytes) -> None:
        self.heard.append((self._topics.get(client_channel_id, "?"), bytes(data)))

    def on_get_parameters(
        self, client: Any, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        names = param_names or list(self.parameters)
        return [
            Parameter(one, value=self.parameters[one]) for one in names if one in self.parameters
        ]

    def on_set_parameters(
        self, client: Any, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        for one in parameters:
            self.parameters[one.name] = one.get_value()
        return parameters


_SERVICES = {
    "std_srvs/srv/Trigger_Request": "",
    "std_srvs/srv/Trigger_Response": "bool success\nstring message",
    "std_srvs/srv/SetBool_Request": "bool data",
    "std_srvs/srv/SetBool_Response": "bool success\nstring message",
}


def _service_text(name: str) -> str:
    return _SERVICES[name]
