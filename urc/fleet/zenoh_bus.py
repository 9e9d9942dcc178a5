"""The network of a fleet over Eclipse Zenoh: two sessions, liveliness tokens and one inbox each.

Layer 4. A site that listens is a Zenoh router; a site that only connects is a client of routers, so
it needs no open port. Each lane has a session and a port of its own, so that a full data line never
delays a control message. The sessions neither scout nor use shared memory.

The library runs in its own threads. A thread appends each message to a bounded queue, and wakes the
event loop once for all waiting messages.
"""

import asyncio
import json
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from urc._extras import missing
from urc.fleet.bus import LANES, MAX_MESSAGE_BYTES, Arrival, BusFailed, FleetBus, Lane

__all__ = ["BusOptions", "ZenohBus", "endpoint_of", "session_settings"]

VERSION: Final = 1
"""Version of the messages between sites. Sites of other versions do not see each other."""
LEASE_MS: Final = 1000
"""Time without data after which Zenoh gives a connection up, in milliseconds."""
MAX_WAITING: Final = 8192
"""Maximum number of messages between the library's threads and the event loop; above the limit, the
oldest is lost."""
MAX_SITE_BYTES: Final = 63
_OPEN_S: Final = 5.0
_CLOSE_S: Final = 2.0
_RETRY_MS: Final = 200
_LONGEST_RETRY_MS: Final = 2000
_BATCHES: Final = 16
"""Number of batches of up to 64 KiB that wait for a connection; the library permits no more."""
_DROP_US: Final = 20_000
"""Longest wait of a message for a full queue, in microseconds. The event loop waits too."""
_ALL_MS: Final = -1
"""Zenoh's value for “without end”."""


@dataclass(frozen=True, slots=True)
class BusOptions:
    """How a site joins the network of its fleet."""

    fleet: str
    site: str
    listen: tuple[str, ...] = ()
    """Endpoints such as ``tls/0.0.0.0:7447`` for connections of other sites; the data lane uses the
    next port."""
    connect: tuple[str, ...] = ()
    """Endpoints of sites that listen."""
    root: Path | None = None
    """Root certificate of the fleet; None for a network without TLS, such as in tests."""
    certificate: Path | None = None
    """Certificate of this site, with its chain."""
    key: Path | None = None


class ZenohBus(FleetBus):
    """One site's connection to the fleet."""

    def __init__(self, options: BusOptions) -> None:
        self._options = options
        self._loop = asyncio.get_running_loop()
        self._sessions: dict[Lane, Any] = {}
        self._publishers: dict[tuple[str, Lane], Any] = {}
        self._declared: list[Any] = []
        """Subscribers and tokens, which end when nothing refers to them."""
        self._alive: dict[Lane, frozenset[str]] = dict.fromkeys(LANES, frozenset())
        """Sites whose tokens are alive on each lane."""
        self._seen: frozenset[str] = frozenset()
        self._joining: asyncio.Task[None] | None = None
        self._came: deque[Callable[[], None]] = deque(maxlen=MAX_WAITING)
        self._is_woken = False
        self.on_arrival = _ignore
        self.on_sites = _rest

    @property
    def site(self) -> str:
        """Name of this site."""
        return self._options.site

    @property
    def sites(self) -> frozenset[str]:
        """Names of the other sites that are present.

        A site appears as soon as it is connected on both lanes, and is absent without control.
        """
        return self._seen

    async def open(self) -> None:
        """Open both sessions; raise `BusFailed` if the library refuses them.

        Without a reachable site, a site that only connects tries again in the background.
        """
        try:
            import zenoh  # noqa: F401 - an extra
        except ImportError as fault:
            raise BusFailed(missing("a fleet needs", "eclipse-zenoh", "fleet")) from fault
        try:
            await self._join()
        except _errors() as fault:
            if self._options.listen:
                await self.close()
                text = f"the network of the fleet cannot be opened ({_line(fault)})"
                raise BusFailed(text) from fault
            self._joining = asyncio.create_task(self._join_later())

    async def _join(self) -> None:
        for lane in LANES:
            if lane not in self._sessions:
                settings = session_settings(self._options, lane)
                self._sessions[lane] = await asyncio.to_thread(_opened, settings)
        await asyncio.to_thread(self._declare)

    async def _join_later(self) -> None:
        """Try to join until it succeeds; the library reconnects later by itself."""
        wait_ms = _RETRY_MS
        while True:
            await asyncio.sleep(wait_ms / 1000)
            wait_ms = min(2 * wait_ms, _LONGEST_RETRY_MS)
            with suppress(*_errors()):
                await self._join()
                return

    def send(self, site: str, lane: Lane, body: bytes) -> bool:
        """Put one message; the library drops it if its own queue stays full."""
        if len(body) > MAX_MESSAGE_BYTES:
            raise ValueError(f"a message has {len(body)} bytes; at most {MAX_MESSAGE_BYTES}")
        if site not in self._seen or site not in self._alive[lane]:
            return False
        try:
            self._publisher(site, lane).put(body)
        except _errors():
            return False
        return True

    async def refresh(self) -> None:
        """Open both sessions again if this site listens: Zenoh reads a listener's files only once.

        For each connection to another site, Zenoh reads the files again.
        """
        if self._options.listen:
            await self.close()
            self.on_sites()
            await self.open()

    async def close(self) -> None:
        """Undeclare the token, and close both sessions."""
        if self._joining is not None:
            self._joining.cancel()
            await asyncio.wait((self._joining,))
            self._joining = None
        sessions, self._sessions = self._sessions, {}
        self._declared.clear()
        self._publishers.clear()
        self._alive = dict.fromkeys(LANES, frozenset())
        self._seen = frozenset()
        for session in sessions.values():
            closing = self._loop.run_in_executor(None, session.close)
            with suppress(TimeoutError, *_errors()):
                async with asyncio.timeout(_CLOSE_S):
                    await asyncio.shield(closing)

    # -- the library's threads

    def _declare(self) -> None:
        import zenoh

        root, site = self._root(), self.site
        for lane in LANES:
            handler = zenoh.handlers.Callback(partial(self._message, lane), indirect=False)
            session = self._sessions[lane]
            self._declared.append(session.declare_subscriber(f"{root}/{lane}/{site}/*", handler))
            live = session.liveliness()
            handler = zenoh.handlers.Callback(partial(self._token, lane), indirect=False)
            watched = live.declare_subscriber(f"{root}/site/*", handler, history=True)
            self._declared += [watched, live.declare_token(f"{root}/site/{site}")]

    def _message(self, lane: Lane, sample: Any) -> None:
        sender = _last(sample)
        if sample.payload is not None and len(sample.payload) <= MAX_MESSAGE_BYTES:
            arrival = Arrival(sender, lane, sample.payload.to_bytes())
            self._hand_over(lambda: self.on_arrival(arrival))

    def _token(self, lane: Lane, sample: Any) -> None:
        import zenoh

        name, is_here = _last(sample), sample.kind == zenoh.SampleKind.PUT
        if len(name.encode()) <= MAX_SITE_BYTES:
            self._hand_over(partial(self._site_seen, lane, name, is_here))

    def _hand_over(self, work: Callable[[], None]) -> None:
        self._came.append(work)
        if not self._is_woken:
            self._is_woken = True
            with suppress(RuntimeError):  # the event loop has ended
                self._loop.call_soon_threadsafe(self._arrived)

    # -- the event loop

    def _arrived(self) -> None:
        self._is_woken = False
        while self._came:
            self._came.popleft()()

    def _site_seen(self, lane: Lane, name: str, is_here: bool) -> None:
        others = self._alive[lane] | {name} if is_here else self._alive[lane] - {name}
        self._alive[lane] = others - {self.site}
        # Lanes connect at different times. A request to a site with one lane would be lost.
        both = self._alive["control"] & self._alive["data"]
        seen = (self._seen & self._alive["control"]) | both
        if seen != self._seen and self._sessions:
            self._seen = seen
            self.on_sites()

    def _publisher(self, site: str, lane: Lane) -> Any:
        import zenoh

        kept = self._publishers.get((site, lane))
        if kept is None:
            is_control = lane == "control"
            kept = self._publishers[site, lane] = self._sessions[lane].declare_publisher(
                f"{self._root()}/{lane}/{site}/{self.site}",
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.REAL_TIME if is_control else zenoh.Priority.DATA,
                # Small messages share a batch while the connection is busy.
                express=False,
                allowed_destination=zenoh.Locality.REMOTE,
            )
        return kept

    def _root(self) -> str:
        return f"urc/fleet/{VERSION}/{self._options.fleet}"


def endpoint_of(endpoint: str, lane: Lane) -> str:
    """Return the endpoint of a lane: the data lane uses the next port.

    Raises:
        BusFailed: the endpoint has no port.
    """
    if lane == "control":
        return endpoint
    place, _, port = endpoint.rpartition(":")
    if not place or not port.isdecimal():
        raise BusFailed(f"{endpoint}: a port is missing, as in tls/192.168.1.20:7447")
    return f"{place}:{int(port) + 1}"


def session_settings(options: BusOptions, lane: Lane) -> Mapping[str, Any]:
    """Return Zenoh's configuration of one lane."""
    retry = {
        "period_init_ms": _RETRY_MS,
        "period_max_ms": _LONGEST_RETRY_MS,
        "period_increase_factor": 2,
    }
    link: dict[str, Any] = {
        "tx": {
            "lease": LEASE_MS,
            "keep_alive": 4,
            "queue": {
                # A lost message ends its line. The largest queues of the library bear a sending
                # thread that gets no processor time; lines bound what waits in them.
                "size": {"real_time": _BATCHES, "data": _BATCHES},
                "congestion_control": {"drop": {"wait_before_drop": _DROP_US}},
            },
        },
        "rx": {"max_message_size": 4 * MAX_MESSAGE_BYTES},
    }
    if options.root is not None:
        link["tls"] = {
            "root_ca_certificate": str(options.root),
            "listen_certificate": str(options.certificate),
            "listen_private_key": str(options.key),
            "connect_certificate": str(options.certificate),
            "connect_private_key": str(options.key),
            "enable_mtls": True,
            # Sites are known by their names, not by their addresses; `urc.fleet.lines` has TLS of
            # its own between the sites, which checks the name.
            "verify_name_on_connect": False,
        }
    return {
        "mode": "router" if options.listen else "client",
        "connect": {
            "endpoints": [endpoint_of(one, lane) for one in options.connect],
            # A client cannot open a session without a router; `ZenohBus` tries again.
            "timeout_ms": _ALL_MS if options.listen else 0,
            "exit_on_failure": not options.listen,
            "retry": retry,
        },
        "listen": {"endpoints": [endpoint_of(one, lane) for one in options.listen]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "shared_memory": {"enabled": False},
            "unicast": {"open_timeout": int(_OPEN_S * 1000)},
            "link": link,
        },
    }


def _opened(settings: Mapping[str, Any]) -> Any:
    import zenoh

    return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))


def _errors() -> tuple[type[Exception], ...]:
    try:
        import zenoh
    except ImportError:
        return (OSError,)
    return (zenoh.ZError, OSError)


def _last(sample: Any) -> str:
    return str(sample.key_expr).rpartition("/")[2]


def _line(fault: Exception) -> str:
    """Return the library's reason without source positions, in one line."""
    return " ".join(str(fault).partition(" at /")[0].split())[:200]


def _ignore(arrival: Arrival) -> None:
    """Ignore a message; the default callback."""


def _rest() -> None:
    """Ignore a change; the default callback."""
