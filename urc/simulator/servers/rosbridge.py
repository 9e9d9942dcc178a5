"""An emulated robot behind a rosbridge server: protocol version 2 over WebSocket."""

import asyncio
import base64
import hashlib
import struct
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

from urc.model.payload import Envelope, Payload
from urc.model.values import NOTHING
from urc.simulator.servers.base import Endpoint, ServerContext
from urc.simulator.servers.clients import ClientConnection, converse
from urc.simulator.servers.websocket import MessageServer
from urc.transports.ros.goal_status import STATUS
from urc.transports.ros.rosbridge_cancellations import CANCEL_GOAL
from urc.transports.ros.types import spelled

__all__ = ["RosbridgeServer"]


MAX_TOPICS = 512
"""Maximum number of topics, services and subscriptions per client."""
_ENDS = {True: 4, False: 6}
"""Status codes of action results: succeeded or aborted."""
_EXECUTING, _CANCELLED = 2, 5
"""Status codes of a running and of a cancelled goal (action_msgs/GoalStatus)."""
_UNKNOWN_GOAL = 2
"""Return code of a cancellation of an unknown goal (action_msgs/CancelGoal)."""

EARLY = 0.1
"""Fraction of the throttle interval by which a message may be early. Robots often send at exactly
the throttle interval. Without this tolerance, delays on this machine would cause every other
message to be dropped."""

_decode = msgspec.json.Decoder().decode
_encode = msgspec.json.Encoder().encode


class _Wanted(NamedTuple):
    """One client's subscription to one topic."""

    throttle_s: float
    compression: str
    fragment_bytes: int


class Bridge:
    """The state shared by all clients of one bridge."""

    def __init__(
        self,
        declared: Mapping[str, str],
        taken: Mapping[str, str] = NOTHING,
        actions: Iterable[str] = (),
    ) -> None:
        """Create the bridge.

        Args:
            declared: types of the topics that the robot publishes; "" means an unknown type.
            taken: types of the topics that the robot subscribes to.
            actions: names of the robot's actions.
        """
        self.actions = frozenset(actions)
        self.types = dict(declared)
        self.declared = frozenset(declared)
        self.taken = taken
        self.clients: list[BridgeClient] = []
        self.servers: dict[str, BridgeClient] = {}
        """Client that offers each service, keyed by service name."""
        self.asked: dict[str, tuple[BridgeClient, object]] = {}
        """Caller and original identifier of each forwarded call, keyed by new identifier."""
        self.goals: dict[str | int, tuple[BridgeClient, str]] = {}
        """Sender and action of each running goal, keyed by identifier. As in the real bridge, any
        client may cancel a goal, and a goal outlives its sender's connection."""
        self._count = 0

    def passed_on(self, service: str, client: "BridgeClient", number: object, args: object) -> None:
        """Forward a call to the client that offers the service."""
        self._count += 1
        key = f"call_service:{service}:{self._count}"
        while len(self.asked) >= MAX_TOPICS:
            del self.asked[next(iter(self.asked))]
        self.asked[key] = client, number
        self.servers[service].write(
            {"op": "call_service", "id": key, "service": service, "args": args}
        )

    def add_goal(self, number: str | int, sender: "BridgeClient", action: str) -> None:
        """Keep a running goal; above the limit, drop the oldest."""
        while len(self.goals) >= MAX_TOPICS:
            self.remove_goal(next(iter(self.goals)))
        self.goals[number] = sender, action
        self._show_status(action)

    def remove_goal(self, number: str | int) -> tuple["BridgeClient", str]:
        """Remove a goal that has ended; return its sender and action."""
        sender, action = self.goals.pop(number)
        self._show_status(action)
        return sender, action

    def running(self, action: str) -> list[dict[str, object]]:
        """Return the running goals of an action, as in action_msgs/GoalInfo."""
        goals = [goal for goal, (_, name) in self.goals.items() if name == action]
        ids = [hashlib.blake2b(str(goal).encode(), digest_size=16).digest() for goal in goals]
        stamp = {"sec": 0, "nanosec": 0}
        return [{"goal_id": {"uuid": list(one)}, "stamp": stamp} for one in ids]

    def status(self, topic: str) -> dict[str, object] | None:
        """Return the states of the goals (action_msgs/GoalStatusArray); None for other topics."""
        action = topic.removesuffix(STATUS)
        if action == topic or action not in self.actions:
            return None
        running = self.running(action)
        return {"status_list": [{"goal_info": one, "status": _EXECUTING} for one in running]}

    def _show_status(self, action: str) -> None:
        topic = action + STATUS
        said = self.status(topic)
        for client in self.clients if said is not None else ():
            if topic in client.wanted:
                client.write({"op": "publish", "topic": topic, "msg": said})

    def publish(self, topic: str, message: object, now_s: float) -> None:
        """Send a message to every subscriber."""
        for client in self.clients:
            client.show(topic, message, now_s)


class BridgeClient:
    """The state of one client of the bridge, and the operations that it sends."""

    def __init__(self, bridge: Bridge, send: Callable[[str | bytes], None]) -> None:
        """Join `bridge`. The function `send` transmits one text or binary frame."""
        self._bridge = bridge
        self._send = send
        self.wanted: dict[str, _Wanted] = {}
        """Subscriptions of the client, keyed by topic."""
        self._shown_s: dict[str, float] = {}
        self._calls: dict[object, str] = {}
        """Services of the unanswered calls, keyed by identifier."""
        self._fragments = 0
        bridge.clients.append(self)

    def leave(self) -> None:
        """Remove the client and all services that it offered."""
        bridge = self._bridge
        bridge.clients.remove(self)
        bridge.servers = {
            name: client for name, client in bridge.servers.items() if client is not self
        }
        bridge.asked = {key: who for key, who in bridge.asked.items() if who[0] is not self}

    def hears(self, text: str | bytes, now_s: float) -> Envelope | None:
        """Handle a frame from the client; return the message for the emulated robot, or None."""
        try:
            operation = _decode(text)
        except (msgspec.DecodeError, UnicodeDecodeError):
            return None  # silent, as in the real bridge
        if not isinstance(operation, dict):
            return None
        work = _WORK.get(str(operation.get("op")))
        return None if work is None else work(self, operation, now_s)

    def says(self, payload: Payload, now_s: float) -> None:
        """Send a message from the emulated robot to the client."""
        if not isinstance(payload, Envelope):
            return
        payload = payload._replace(body=_fields(payload.body))
        number, body = payload.attributes.get("id"), payload.body
        match payload.verb:
            case "message":
                topic = str(payload.attributes.get("topic"))
                self._bridge.types.setdefault(topic, "")
                self.show(topic, body, now_s)
            case "feedback" if action := self._own_goal(number):
                self._feedback(action, number, body)
            case "response" if number in self._calls:
                self._respond(self._calls.pop(number), number, payload)
            case "response" if action := self._own_goal(number, ends=True):
                self._finish(action, number, payload)

    def refuses(self, asked: Envelope) -> None:
        """Report to the client that the emulated robot lacks the service or action."""
        number = asked.attributes.get("id")
        if number in self._calls:
            service = self._calls.pop(number)
            self.answer(service, number, f"Service {service} does not exist", False)
        elif action := self._own_goal(number, ends=True):
            reason = {"reason": "no such action"}
            self._finish(action, number, Envelope("response", {"ok": False}, reason))

    def _own_goal(self, number: object, *, ends: bool = False) -> str:
        """Return the action of this client's goal, or ""; with `ends`, also remove the goal."""
        if not isinstance(number, str | int):
            return ""
        sender, action = self._bridge.goals.get(number, (None, ""))
        if sender is not self:
            return ""
        if ends:
            self._bridge.remove_goal(number)
        return action

    def show(self, topic: str, message: object, now_s: float) -> None:
        """Send a message to the client if the client's subscription and throttle rate permit it."""
        wanted = self.wanted.get(topic)
        if wanted is None:
            return
        if now_s < self._shown_s.get(topic, float("-inf")) + wanted.throttle_s * (1 - EARLY):
            return
        self._shown_s[topic] = now_s
        operation = {"op": "publish", "topic": topic, "msg": message}
        if wanted.compression == "cbor":
            import cbor2  # only on demand

            self._send(cbor2.dumps(operation))
        elif wanted.compression == "png":
            self.write({"op": "png", "data": _png(_encode(operation))})
        elif wanted.fragment_bytes:
            self._write_pieces(_encode(operation).decode(), wanted.fragment_bytes)
        else:
            self.write(operation)

    def write(self, operation: Mapping[str, object]) -> None:
        """Send one rosbridge operation to the client, as JSON text."""
        self._send(_encode(operation).decode())

    def _write_pieces(self, text: str, size: int) -> None:
        self._fragments += 1
        pieces = [text[start : start + size] for start in range(0, len(text), size)]
        for number, piece in enumerate(pieces):
            self.write(
                {
                    "op": "fragment",
                    "id": str(self._fragments),
                    "data": piece,
                    "num": number,
                    "total": len(pieces),
                }
            )

    # -- replies of the robot

    def answer(self, service: str, number: object, values: object, is_ok: bool) -> None:
        """Send the reply to a service call that this client has made."""
        operation = {"op": "service_response", "service": service, "values": values}
        if number is not None:
            operation["id"] = number
        self.write({**operation, "result": is_ok})

    def _respond(self, service: str, number: object, said: Envelope) -> None:
        is_ok = said.attributes.get("ok") is not False
        values = said.body if is_ok else said.attributes.get("reason") or said.body
        self.answer(service, number, {} if values is None else values, is_ok)

    def _feedback(self, action: str, number: object, body: object) -> None:
        self.write({"op": "action_feedback", "id": number, "action": action, "values": body})

    def _finish(self, action: str, number: object, said: Envelope) -> None:
        is_ok = said.attributes.get("ok") is not False
        self.write(
            {
                "op": "action_result",
                "id": number,
                "action": action,
                "values": {} if said.body is None else said.body,
                "status": _ENDS[is_ok],
                "result": is_ok,
            }
        )

    # -- the client's operations

    def subscribe(self, operation: Mapping[str, Any], now_s: float) -> None:
        """Subscribe to a topic.

        A repeated subscription replaces the previous subscription and its throttle rate.
        """
        topic = _text(operation, "topic")
        if not topic or len(self.wanted) >= MAX_TOPICS:
            return
        status = self._bridge.status(topic)
        if status is None:
            self._learn(topic, operation)
        throttle_ms, fragment = operation.get("throttle_rate"), operation.get("fragment_size")
        self.wanted[topic] = _Wanted(
            max(0, throttle_ms) / 1000 if isinstance(throttle_ms, int | float) else 0.0,
            str(operation.get("compression") or "none"),
            max(0, fragment) if isinstance(fragment, int) else 0,
        )
        if status is not None:  # latched
            self.write({"op": "publish", "topic": topic, "msg": status})

    def unsubscribe(self, operation: Mapping[str, Any], now_s: float) -> None:
        """Forget a subscription."""
        self.wanted.pop(_text(operation, "topic"), None)

    def advertise(self, operation: Mapping[str, Any], now_s: float) -> None:
        """Record the type of a topic that the client announces."""
        self._learn(_text(operation, "topic"), operation)

    def publish(self, operation: Mapping[str, Any], now_s: float) -> Envelope | None:
        """Send a message to all subscribers and to the robot; ignore unannounced topics."""
        topic, message = _text(operation, "topic"), operation.get("msg")
        if topic not in self._bridge.types or not isinstance(message, dict):
            return None
        self._bridge.publish(topic, message, now_s)
        kind = self._bridge.types[topic]
        attributes = {"topic": topic, "type": kind} if kind else {"topic": topic}
        return Envelope("publish", attributes, message)

    def call(self, operation: Mapping[str, Any], now_s: float) -> Envelope | None:
        """Reply to a call to rosapi.

        Forward other calls to the client or robot that offers the service.
        """
        service, number = _text(operation, "service"), operation.get("id")
        args = operation.get("args")
        args = {} if args is None else args
        known = self._rosapi(service, args)
        if known is not None:
            self.answer(service, number, known, True)
        elif service in self._bridge.servers:
            self._bridge.passed_on(service, self, number, args)
        elif service.removesuffix(CANCEL_GOAL) in self._bridge.actions:
            return self._cancel_all(service, number, args)
        else:
            self._remember(self._calls, number, service)
            attributes = {"service": service, "id": number}
            return Envelope("call", attributes, args)
        return None

    def offer(self, operation: Mapping[str, Any], now_s: float) -> None:
        """Register this client as the server of a service."""
        if len(self._bridge.servers) < MAX_TOPICS:
            self._bridge.servers[_text(operation, "service")] = self

    def withdraw(self, operation: Mapping[str, Any], now_s: float) -> None:
        """Remove a service."""
        name = _text(operation, "service")
        if self._bridge.servers.get(name) is self:
            del self._bridge.servers[name]

    def respond(self, operation: Mapping[str, Any], now_s: float) -> None:
        """Forward the reply of a client that offers a service to the caller."""
        asked = self._bridge.asked.pop(str(operation.get("id")), None)
        if asked is not None:
            client, number = asked
            values = operation.get("values")
            is_ok = operation.get("result") is not False
            client.answer(_text(operation, "service"), number, values, is_ok)

    def start(self, operation: Mapping[str, Any], now_s: float) -> Envelope:
        """Return the envelope that sends a client's action goal to the robot."""
        action, number = _text(operation, "action"), operation.get("id")
        if isinstance(number, str | int):
            self._bridge.add_goal(number, self, action)
        attributes = {
            "action": action,
            "type": _text(operation, "action_type"),
            "feedback": operation.get("feedback") is True,
            "id": number,
        }
        return Envelope("goal", attributes, operation.get("args") or {})

    def cancel(self, operation: Mapping[str, Any], now_s: float) -> Envelope | None:
        """Cancel a goal of any client; ignore unknown identifiers, as the real bridge does.

        The bridge sends the result to the goal's sender, and drops a later reply of the robot.
        """
        action, number = _text(operation, "action"), operation.get("id")
        if not isinstance(number, str | int) or number not in self._bridge.goals:
            return None
        self._end(action, number)
        return Envelope("cancel", {"action": action, "id": number})

    def _cancel_all(self, service: str, number: object, args: object) -> Envelope | None:
        """Answer the hidden service of an action: a zero id cancels the goals of all clients."""
        bridge, action = self._bridge, service.removesuffix(CANCEL_GOAL)
        if not _is_zero(args):
            self.answer(
                service, number, {"return_code": _UNKNOWN_GOAL, "goals_canceling": []}, True
            )
            return None
        listed = bridge.running(action)
        for goal in [goal for goal, (_, name) in bridge.goals.items() if name == action]:
            self._end(action, goal)
        self.answer(service, number, {"return_code": 0, "goals_canceling": listed}, True)
        return Envelope("cancel", {"action": action})

    def _end(self, action: str, number: str | int) -> None:
        """End a goal as cancelled, and send the result to the goal's sender if it is connected."""
        sender, _ = self._bridge.remove_goal(number)
        if sender in self._bridge.clients:
            sender.write(
                {
                    "op": "action_result",
                    "id": number,
                    "action": action,
                    "values": {},
                    "status": _CANCELLED,
                    "result": False,
                }
            )

    def _learn(self, topic: str, operation: Mapping[str, Any]) -> None:
        kind = _text(operation, "type")
        if topic and kind and len(self._bridge.types) < MAX_TOPICS:
            self._bridge.types[topic] = self._bridge.types.get(topic) or kind

    def _remember(self, table: dict[object, str], number: object, name: str) -> None:
        if not isinstance(number, str | int):
            return  # replies could not be matched
        while len(table) >= MAX_TOPICS:
            del table[next(iter(table))]
        table[number] = name

    def _rosapi(self, service: str, args: object) -> dict[str, object] | None:
        """Return the reply of the rosapi node; None for other services."""
        folder, _, question = service.rpartition("/")
        if folder not in ("/rosapi", "rosapi"):
            return None
        given = args if isinstance(args, dict) else {}
        types = dict(sorted({**self._bridge.types, **self._bridge.taken}.items()))
        match question:
            case "topics":
                return {"topics": list(types), "types": list(types.values())}
            case "topic_type":
                return {"type": types.get(str(given.get("topic")), "")}
            case "topics_for_type":
                kind = given.get("type")
                return {"topics": [name for name, known in types.items() if known == kind]}
            case "subscribers":
                topic = str(given.get("topic"))
                nodes = ["/robot"] if topic in types else []
                if any(topic in client.wanted for client in self._bridge.clients):
                    nodes.append("/rosbridge_websocket")
                return {"subscribers": nodes}
            case "publishers":
                topic = str(given.get("topic"))
                is_known = topic in self._bridge.declared or self._bridge.status(topic) is not None
                return {"publishers": ["/robot"] if is_known else []}
            case "services":
                return {"services": sorted(self._bridge.servers)}
        return None


def _is_zero(args: object) -> bool:
    """Return whether the request of a cancellation has a zero id; omitted fields are zero."""
    goal = args.get("goal_info") if isinstance(args, dict) else None
    info = goal.get("goal_id") if isinstance(goal, dict) else None
    uuid = info.get("uuid") if isinstance(info, dict) else None
    return not uuid or (isinstance(uuid, list) and not any(uuid))


_Work = Callable[[BridgeClient, Mapping[str, Any], float], Envelope | None]
_WORK: Mapping[str, _Work] = {
    "subscribe": BridgeClient.subscribe,
    "unsubscribe": BridgeClient.unsubscribe,
    "advertise": BridgeClient.advertise,
    "publish": BridgeClient.publish,
    "call_service": BridgeClient.call,
    "advertise_service": BridgeClient.offer,
    "unadvertise_service": BridgeClient.withdraw,
    "service_response": BridgeClient.respond,
    "send_action_goal": BridgeClient.start,
    "cancel_action_goal": BridgeClient.cancel,
}


def _text(operation: Mapping[str, Any], name: str) -> str:
    value = operation.get(name)
    return value if isinstance(value, str) else ""


def _fields(body: object) -> object:
    """Return the body of a message as an object; parse JSON text if necessary."""
    if not isinstance(body, bytes):
        return body
    try:
        return _decode(body) if body.strip() else {}
    except (msgspec.DecodeError, UnicodeDecodeError):
        return {"data": body}


def _png(data: bytes) -> str:
    """Return `data`, padded with newlines, as the pixels of a nearly square base64 PNG image."""
    side = max(1, round((len(data) / 3) ** 0.5))
    height = -(-len(data) // (side * 3))
    padded = data.ljust(side * height * 3, b"\n")
    stride = side * 3
    rows = b"".join(b"\0" + padded[at : at + stride] for at in range(0, len(padded), stride))
    chunks: Iterable[tuple[bytes, bytes]] = (
        (b"IHDR", struct.pack(">IIBBBBB", side, height, 8, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(rows)),
        (b"IEND", b""),
    )
    image = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
    return base64.b64encode(image).decode()


MAX_BYTES = 10_000_000
"""Maximum frame size in bytes, equal to the default of the real server."""
MAX_UNSENT_BYTES = 4_194_304
"""Maximum number of unsent bytes per client. While a client is above the limit, messages to the
client are dropped."""


class RosbridgeServer(MessageServer):
    """A rosbridge server on one port; all clients share one bridge."""

    DEFAULT_PORT = 9090

    def __init__(self, context: ServerContext) -> None:
        super().__init__(context)
        # A bridge names types in the style of its ROS version. The default is ROS 2.
        ros = {1: 1, 2: 2, "auto": 2}.get(context.options.get("version"))
        types = {name: str(how.get("type") or "") for name, how in context.topics.items()}
        self._bridge = Bridge(
            {name: spelled(kind, "msg", ros) for name, kind in types.items()},
            {name: spelled(kind, "msg", ros) for name, kind in context.taken.items()},
            context.actions,
        )

    def _endpoint(self, host: str, port: int) -> Endpoint:
        found = super()._endpoint(host, port)
        return found._replace(options={**found.options, "via": "rosbridge"})

    async def _serve(self, host: str, port: int) -> Server:
        return await serve(
            self._accept,
            host,
            port,
            compression=None,
            max_size=MAX_BYTES,
            max_queue=16,
            ping_interval=None,  # off by default in the real server too
        )

    async def _talk(self, client: ClientConnection, socket: ServerConnection) -> None:
        clock = asyncio.get_running_loop().time

        def send(frame: str | bytes) -> None:
            # Do not wait: a message to one client must not delay the others.
            if socket.transport.get_write_buffer_size() <= MAX_UNSENT_BYTES:
                broadcast([socket], frame)

        member = BridgeClient(self._bridge, send)
        asked: list[tuple[Envelope, int]] = []

        async def take() -> Payload | None:
            if asked:  # with the reply, if there is any
                envelope, faults = asked.pop()
                if client.line.faults > faults:
                    member.refuses(envelope)
            try:
                while True:
                    heard = member.hears(await socket.recv(), clock())
                    await socket.drain()
                    if heard is not None:
                        asked[:] = [(heard, client.line.faults)]
                        return heard
            except ConnectionClosed:
                return None

        async def put(said: Sequence[Payload]) -> None:
            for payload in said:
                member.says(payload, clock())
            await socket.drain()

        try:
            await converse(self._context, client, take, put)
            await socket.close()
        finally:
            member.leave()
