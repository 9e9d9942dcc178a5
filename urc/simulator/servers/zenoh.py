"""The emulated robot as a Zenoh router with a device.

The router listens at the configured address, without encryption and scouting. The device publishes
the topics to which the driver subscribes, and declares the liveliness tokens that the driver
watches. It receives the values and requests of all other keys.
"""

import asyncio
import json
import socket
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib.util import find_spec
from typing import Any, Final

from urc._extras import missing
from urc.key_expressions import is_key_expression, key_matches
from urc.model.payload import Envelope, Payload
from urc.problems import UrcError
from urc.simulator.servers.base import Endpoint, ServerContext, host_and_port, option_port
from urc.simulator.servers.clients import ClientConnection, Clients, converse
from urc.transports._bodies import body_bytes
from urc.transports.zenoh_options import DEFAULT_PORT

__all__ = ["ZenohRobot"]

MAX_WAITING: Final = 256
"""Maximum number of received values and requests that wait for the robot; the oldest are dropped.
"""
MAX_QUERIES: Final = 64
"""Maximum number of unanswered requests; the oldest are dropped."""
_ATTEMPTS: Final = 5
_EVERYTHING: Final = "**"


class ZenohRobot:
    """One router and the emulated device behind it."""

    def __init__(self, context: ServerContext) -> None:
        self._context = context
        self._clients = Clients(context)
        self._loop = asyncio.get_running_loop()
        self._own = [key_matches(topic) for topic in context.topics]
        self._session: Any = None
        self._declared: list[object] = []
        self._waiting: deque[Any] = deque(maxlen=MAX_WAITING)
        self._arrived = asyncio.Event()
        self._queries: dict[int, Any] = {}
        self._number = 0

    async def open(self) -> Endpoint:
        """Listen at the address declared in the options."""
        context = self._context
        if find_spec("zenoh") is None:
            what = missing("an emulated Zenoh robot needs", "eclipse-zenoh", "zenoh")
            raise UrcError(f"transports.{context.name}: {what}")
        port = option_port(context, default=DEFAULT_PORT)
        for attempt in range(_ATTEMPTS):
            number = port or _free_port(context.host)
            try:
                self._session = await asyncio.to_thread(_listening, context.host, number)
                break
            except OSError as fault:
                if port or attempt == _ATTEMPTS - 1:
                    where = host_and_port(context.host, number)
                    text = f"transports.{context.name}: cannot listen on {where} ({fault})"
                    raise UrcError(text) from fault
        self._declare()
        self._clients.admit(self._talk, lambda: None)
        text = f"zenoh {host_and_port(context.host, number)}"
        options = {
            "host": context.host,
            "port": number,
            "tls": None,
            "username": "",
            "password": "",
        }
        return Endpoint(context.host, number, text, options)

    async def close(self) -> None:
        """Stop listening and disconnect every client."""
        await self._clients.close()
        session, self._session = self._session, None
        self._queries.clear()
        self._declared.clear()
        if session is not None:
            await asyncio.to_thread(session.close)

    def _declare(self) -> None:
        import zenoh

        session, remote = self._session, zenoh.Locality.REMOTE
        handler = zenoh.handlers.Callback(self._came, indirect=False)
        self._declared = [
            session.declare_subscriber(_EVERYTHING, handler, allowed_origin=remote),
            session.declare_queryable(_EVERYTHING, handler, allowed_origin=remote),
        ]
        for topic, how in self._context.topics.items():
            if how.get("liveliness") is True and not is_key_expression(topic):
                self._declared.append(session.liveliness().declare_token(topic))

    def _came(self, thing: Any) -> None:
        """Hand a sample or query over to the event loop; called from the library's threads."""
        self._waiting.append(thing)
        with suppress(RuntimeError):  # the event loop has ended
            self._loop.call_soon_threadsafe(self._arrived.set)

    async def _talk(self, client: ClientConnection) -> None:
        async def put(said: Sequence[Payload]) -> None:
            for payload in said:
                if isinstance(payload, Envelope):
                    self._say(payload)

        await converse(self._context, client, self._take, put)

    async def _take(self) -> Payload:
        while True:
            while self._waiting:
                said = self._read(self._waiting.popleft())
                if said is not None:
                    return said
            self._arrived.clear()
            await self._arrived.wait()

    def _read(self, thing: Any) -> Envelope | None:
        """Return a received sample or query as an envelope; None if it is not for the robot."""
        key = str(thing.key_expr)
        payload = thing.payload
        body = b"" if payload is None else payload.to_bytes()
        if not hasattr(thing, "reply"):
            is_ours = any(fits(key) for fits in self._own)
            return None if is_ours else Envelope("publish", {"topic": key}, body)
        self._number += 1
        while len(self._queries) >= MAX_QUERIES:
            del self._queries[next(iter(self._queries))]
        self._queries[self._number] = thing
        attributes: dict[str, object] = {"topic": key, "id": self._number}
        parameters = _parameters(thing)
        if parameters:
            attributes["parameters"] = parameters
        return Envelope("get", attributes, body)

    def _say(self, payload: Envelope) -> None:
        attributes, key = payload.attributes, str(payload.attributes.get("topic"))
        if payload.verb == "message" and not is_key_expression(key):
            self._session.put(key, body_bytes(payload.body), express=True)
        elif payload.verb == "response":
            number = attributes.get("id")
            query = self._queries.pop(number, None) if isinstance(number, int) else None
            if query is None:
                return
            if attributes.get("ok", True):
                query.reply(str(query.key_expr), body_bytes(payload.body))
            else:
                query.reply_err(str(attributes.get("reason") or "refused").encode())
            query.drop()


def _listening(host: str, port: int) -> Any:
    """Return a router that listens; raise OSError if the address is not available."""
    import zenoh

    settings = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/{host_and_port(host, port)}"], "exit_on_failure": True},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    try:
        return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
    except zenoh.ZError as fault:
        raise OSError(_why(host, port) or str(fault)) from fault


def _why(host: str, port: int) -> str:
    """Return the system's reason why an address is not available; "" if it is available."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        with socket.socket(family) as line:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            line.bind((host, port))
    except OSError as fault:
        return str(fault.strerror or fault).lower()
    return ""


def _free_port(host: str) -> int:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as line:
        line.bind((host, 0))
        return int(line.getsockname()[1])


def _parameters(query: Any) -> Mapping[str, str]:
    from urllib.parse import unquote

    pairs = [part.partition("=") for part in str(query.parameters).split(";") if part]
    return {unquote(name): unquote(value) for name, _, value in pairs}
