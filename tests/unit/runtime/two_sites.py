"""A model of two sites in virtual time: two operators, one robot, and a network at its worst.

The robot's site is real: the motion controller with its lease, latch, freshness and link age, and
the hold-to-run state machine of the guard. Pages and the network are models. Messages between the
sites are delayed, lost, repeated and reordered. A partition keeps them, and healing delivers them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, Literal, NamedTuple

from tests.unit.runtime.test_desk_properties import Line
from urc.model.driver import Argument, Command, Driver, TransportSpec
from urc.model.exchange import Hold
from urc.model.payload import Payload, WriteSpec
from urc.motion.freshness import ControlInput, DuplicateElimination
from urc.motion.lease import LeaseState, Operator
from urc.runtime.motion_controller import MotionController
from urc.testing.movers import FakeFrames, FakeSession

__all__ = ["FATES", "Weather", "World"]

STEP_S = 0.01
TICK_S = 0.05
LEASE_S = 0.25
NOTICED_S = 1.5
"""Time from a partition until the robot's site ends the connection of the other site."""
WANTED = 1.0
FATES = ("ok", "lost", "twice", "late")
Fate = Literal["ok", "lost", "twice", "late"]
_LATE_S = 0.4
ROUNDING = 1e-6

_SPEED = Argument("speed", min=-1.0, max=1.0, default=0.0, is_required=False)
_TICK = Argument("tick", type="integer", default=-1)
"""Number of the tick, whose value at rest is unknown, so that no cap changes it."""
_DRIVE = Command(
    "drive",
    "wire",
    WriteSpec("text", {}),
    {"speed": _SPEED, "tick": _TICK},
    hold=Hold(0.05, {"speed": 0.0}, LEASE_S),
)
DRIVER = Driver({"wire": TransportSpec("wire", "tcp")}, commands={"drive": _DRIVE})


class Guard(Line):
    """The real hold-to-run state machine, with the end that each tick may have."""

    def tick(self, command: str, data: Payload, for_s: float = inf) -> None:
        self.backend[command].tick(data, self.now, self.now + for_s)


class Weather(NamedTuple):
    """What the network between the sites does to each message."""

    up_s: float = 0.01
    """Delay from the page to the robot's site, in seconds."""
    down_s: float = 0.01
    fates: tuple[Fate, ...] = ("ok",)
    """What becomes of one message after the other, in a circle."""


class Sampled(NamedTuple):
    """One tick, as the page sampled it."""

    page: str
    gesture: int
    at_s: float


class Arrived(NamedTuple):
    """One accepted tick at the robot's site."""

    tick: int
    at_s: float
    age_s: float
    """Age by the rule of `docs/motion.md`."""


@dataclass
class Page:
    """A page, as `urc/web/static/control` behaves."""

    place: str
    id: str = ""
    """Identifier of the connection; "" while it is lost."""
    lease: LeaseState | None = None
    beat: int = 0
    number: int = 0
    gesture: int = 0
    """Number of the gesture; 0 while no hand is on the stick."""
    phase: Literal["idle", "asking", "held", "spent"] = "idle"
    epoch: int = 0
    closed_epoch: int = -1
    ticked_s: float = -inf
    recorded: dict[str, list[Any]] = field(default_factory=dict)
    """Messages that this page has sent, by kind, which the network may play back."""

    @property
    def is_mine(self) -> bool:
        """Whether this page knows that it has the controls."""
        return bool(
            self.id and self.lease and self.lease.holder and self.lease.holder.id == self.id
        )

    def lost(self) -> None:
        """Lose the connection."""
        self.id, self.lease, self.beat = "", None, 0
        self.spend()

    def spend(self) -> None:
        """End the gesture; a hand that stays on the stick moves nothing."""
        if self.gesture:
            self.phase = "spent"

    def hear(self, kind: str, body: Any) -> None:
        """Process a message from the robot's site."""
        if kind == "lease":
            self.lease = body
            if not self.is_mine:
                self.beat = 0
            if self.phase == "asking" and self.is_mine and body.epoch > self.closed_epoch:
                self.phase, self.epoch = "held", body.epoch
            elif self.phase == "held" and (not self.is_mine or body.epoch != self.epoch):
                self.phase = "spent"
        elif kind == "beat":
            self.beat = max(self.beat, body) if self.is_mine else 0
        elif kind == "stopped":
            self.closed_epoch = self.lease.epoch if self.lease else self.closed_epoch
            self.spend()


class World:
    """Two pages, the network between the sites, and the robot's site."""

    def __init__(self) -> None:
        self.guard = Guard()
        self.kept = LeaseState()
        self.pages = {"near": Page("near"), "far": Page("far")}
        self.weather = Weather()
        self.is_cut = False
        self.cut_s = -inf
        self.waiting: list[tuple[float, int, str, bool, str, Any]] = []
        """Messages on their way: time of arrival, order, connection, direction, kind, body."""
        self.order = 0
        self.fate = 0
        self.connections = 0
        self.doubled: dict[str, DuplicateElimination] = {}
        """Filter of each connection for messages that arrive twice or too late."""
        self.gestures = 0
        self.sampled: dict[int, Sampled] = {}
        self.accepted: Arrived | None = None
        """Tick that renewed the lease last."""
        self.arrivals: dict[int, Arrived] = {}
        """First arrival of each tick that was accepted."""
        self.beats: dict[tuple[str, int], float] = {}
        """Time of each heartbeat, by connection and number."""
        self.shortest: dict[str, float] = {}
        """Smallest round trip of each connection."""
        self.moving = 0
        """Gesture that the robot obeys; 0 while it stands."""
        self.ended: set[int] = set()
        """Gestures after whose motion the robot was stopped."""
        self.latched = ""
        """Who pressed the STOP that nobody has reset, by an account of our own."""
        self.moved = {"near": 0, "far": 0}
        self.start()

    # -- the robot's site

    @property
    def now(self) -> float:
        """Virtual time."""
        return self.guard.now

    def start(self) -> None:
        """Start the server of the robot's site, with the latch from before."""
        self.controller = MotionController(DRIVER, kept=self.kept, is_owed=True)
        self.controller.on_change = self.changed
        self.controller.attach(FakeSession(FakeFrames(DRIVER), self.guard))
        self.beat_s = self.now
        for page in self.pages.values():
            self.connect(page)

    def restart(self) -> None:
        """Kill the server of the robot's site; its guard stops the robot, and a new one starts."""
        self.kept = self.controller.lease.state
        for page in self.pages.values():
            page.lost()
        for control in self.guard.backend.values():
            if control.state == "moving":
                control.stop("revoked", self.now)
        self.start()

    def connect(self, page: Page) -> None:
        """Open a page's connection, unless the network is cut."""
        if page.place == "far" and self.is_cut:
            return
        self.connections += 1
        page.id = f"{page.place} {self.connections}"
        way = "site" if page.place == "far" else ""
        self.controller.join(Operator(page.id, page.place, "drive", way=way))
        self.doubled[page.id] = DuplicateElimination()
        self.tell(page.id, "lease", self.controller.lease.state)

    def changed(self, state: LeaseState) -> None:
        """Tell the lease to all pages."""
        for page in self.pages.values():
            self.tell(page.id, "lease", state)

    def arrived(self, id: str, kind: str, body: Any) -> None:
        """Process a message of a page, as the server does."""
        if id not in self.controller._screens:
            return  # its connection has ended
        match kind:
            case "tick":
                number, epoch, tick, echo = body
                if not self.doubled[id].accept("drive", number):
                    return
                is_under_lease = not self.controller.lease.refusal(id, epoch)
                age_s = self.age_s(id, echo) if is_under_lease else inf
                given = ControlInput(epoch, number, echo)
                values = {"speed": WANTED, "tick": tick}
                if not self.controller.tick(id, "drive", values, given, self.now):
                    self.accepted = self.arrivals[tick] = Arrived(tick, self.now, age_s)
            case "release":
                if self.doubled[id].accept("drive", body):
                    self.controller.release(id, "drive", body)
            case "stop":
                self.latched = self.latched or id
                self.controller.stop(id)
            case "reset":
                may = body == self.controller.lease.state.stops
                self.controller.drive(id, "reset", self.now, stops=body)
                self.latched = "" if may else self.latched
            case verb:
                before = self.controller.lease.state.holder
                self.controller.drive(id, verb, self.now)
                after = self.controller.lease.state.holder
                is_taken = before is not None and after is not None and before.id != after.id
                assert not is_taken or (verb == "yes" and before.id == id), "taken without consent"

    def age_s(self, id: str, echo: int) -> float:
        """Return the age of a tick that arrives now, by an account of our own."""
        sent_s = self.beats.get((id, echo))
        if sent_s is None or not id.startswith("far"):
            return 0.0
        trip_s = self.now - sent_s
        shortest_s = self.shortest[id] = min(trip_s, self.shortest.get(id, inf))
        return trip_s - min(shortest_s / 2, 0.15)

    # -- the network

    def tell(self, id: str, kind: str, body: Any) -> None:
        """Send a message to a page."""
        self.send(id, False, kind, body)

    def send(self, id: str, is_up: bool, kind: str, body: Any) -> None:
        """Send a message; the way between the sites has weather."""
        if not id:
            return
        fate: Fate = "ok"
        delay_s = 0.0
        if id.startswith("far"):
            delay_s = self.weather.up_s if is_up else self.weather.down_s
            fate = self.weather.fates[self.fate % len(self.weather.fates)]
            self.fate += 1
        if fate == "lost":
            return
        arrivals = [self.now + delay_s + (_LATE_S if fate == "late" else 0.0)]
        if fate == "twice":
            arrivals.append(arrivals[0] + _LATE_S)
        for at_s in arrivals:
            self.order += 1
            self.waiting.append((at_s, self.order, id, is_up, kind, body))

    def deliver(self) -> None:
        """Deliver what has arrived; a cut network keeps it."""
        self.waiting.sort(key=lambda one: one[:2])
        kept = []
        waiting, self.waiting = self.waiting, []
        for one in waiting:
            at_s, _, id, is_up, kind, body = one
            if at_s > self.now or (self.is_cut and id.startswith("far")):
                kept.append(one)
            elif is_up:
                self.arrived(id, kind, body)
            else:
                for page in self.pages.values():
                    if page.id == id:
                        page.hear(kind, body)
        self.waiting += kept

    def cut(self) -> None:
        """Cut the network."""
        if not self.is_cut:
            self.is_cut, self.cut_s = True, self.now

    def heal(self) -> None:
        """Heal the network; a page whose connection has ended connects again."""
        self.is_cut = False
        for page in self.pages.values():
            if page.id not in self.controller._screens:
                page.lost()
                self.connect(page)

    # -- pages

    def say(self, who: str, kind: str, body: Any = None) -> None:
        """Let a page send a message."""
        page = self.pages[who]
        if page.id:
            page.recorded.setdefault(kind, []).append(body)
            self.send(page.id, True, kind, body)

    def grasp(self, who: str) -> None:
        """Put a hand on the stick: a new gesture, which asks for the controls."""
        page = self.pages[who]
        if page.gesture or not page.id:
            return
        self.gestures += 1
        page.gesture, page.phase = self.gestures, "asking"
        if page.is_mine and page.lease is not None and page.lease.epoch > page.closed_epoch:
            page.phase, page.epoch = "held", page.lease.epoch
        else:
            self.say(who, "take")

    def let_go(self, who: str) -> None:
        """Take the hand off the stick."""
        page = self.pages[who]
        if page.gesture:
            page.number += 1
            page.gesture, page.phase = 0, "idle"
            self.say(who, "release", page.number)

    def reset(self, who: str) -> None:
        """Reset STOP, as far as the page knows it."""
        lease = self.pages[who].lease
        if lease is not None and lease.latched_by:
            self.say(who, "reset", lease.stops)

    def replay(self, who: str, kind: str, place: int) -> None:
        """Let the network repeat an old message in the newest connection."""
        page = self.pages[who]
        recorded = page.recorded.get(kind, ())
        if page.id and recorded:
            self.send(page.id, True, kind, recorded[place % len(recorded)])

    def sample(self, page: Page) -> None:
        """Send a tick of a held control."""
        if page.phase != "held" or not page.beat or self.now - page.ticked_s < TICK_S - STEP_S / 2:
            return
        page.ticked_s = self.now
        page.number += 1
        tick = len(self.sampled)
        self.sampled[tick] = Sampled(page.place, page.gesture, self.now)
        self.say(page.place, "tick", (page.number, page.epoch, tick, page.beat))

    # -- time

    def wait(self, seconds: float) -> None:
        """Let time pass in small steps, and check the robot in each."""
        for _ in range(round(seconds / STEP_S)):
            self.guard.now += STEP_S
            self.step()

    def step(self) -> None:
        """Let everybody act at the current time."""
        if self.is_cut and self.now - self.cut_s > NOTICED_S:
            for id in tuple(self.controller._screens):
                if id.startswith("far"):
                    self.controller.part(id)
        for page in self.pages.values():
            self.sample(page)
        self.deliver()
        self.controller.expire(self.now)
        holder = self.controller.lease.state.holder
        if holder is not None and self.now - self.beat_s >= TICK_S:
            self.beat_s = self.now
            beat = self.controller.heartbeat(holder.id, self.now)
            self.beats[holder.id, beat] = self.now
            self.tell(holder.id, "beat", beat)
        self.look(self.guard.step())
        reported, self.guard.reported = self.guard.reported, []
        for command, reason in reported:
            self.controller.stopped(command, reason)
            if reason not in ("released", "stopped"):
                for page in self.pages.values():
                    self.tell(page.id, "stopped", None)

    # -- what must hold

    def look(self, texts: Sequence[str]) -> None:
        """Check what was written to the robot, and whether it may still move."""
        state = self.controller.lease.state
        assert bool(state.latched_by) == bool(self.latched), "the latch is lost, or comes by itself"
        for text in texts:
            if text == "drive stop":
                if self.moving:
                    self.ended.add(self.moving)
                self.moving = 0
                continue
            values = _values(text)
            one = self.sampled[int(values["tick"])]
            assert one.gesture not in self.ended, "motion goes on by itself after a stop"
            assert self.moving in (0, one.gesture), "two drivers without a stop in between"
            assert state.holder is not None, "motion without a lease"
            assert state.holder.name == one.page, "motion of a page without the lease"
            assert not state.latched_by, "motion while STOP is latched"
            share = (0.5 - self.arrivals[int(values["tick"])].age_s) / 0.35
            assert share > 0, "motion by a tick that is too old"
            assert values["speed"] <= WANTED * min(1.0, share) + ROUNDING, "faster than permitted"
            self.moving = one.gesture
            self.moved[one.page] += 1
        if self.moving:
            self.look_at_ages()

    def look_at_ages(self) -> None:
        """Check that the robot moves by a tick that is neither too old nor too long ago."""
        assert self.accepted is not None
        tick, came_s, age_s = self.accepted
        since_s = self.now - came_s - STEP_S - ROUNDING
        assert since_s <= LEASE_S, "motion after the lease"
        one = self.sampled[tick]
        true_s = self.now - one.at_s - STEP_S - ROUNDING
        if one.page == "far":
            assert age_s + since_s <= 0.5, "motion after the age of its tick"
            assert true_s <= 0.65, "motion by a tick that was sampled too long ago"
        else:
            assert true_s <= 0.4 + LEASE_S, "motion by a tick that was sampled too long ago"


def _values(text: str) -> Mapping[str, float]:
    """Return the arguments in a frame."""
    return {
        name: float(value) for name, _, value in (one.partition("=") for one in text.split()[1:])
    }
