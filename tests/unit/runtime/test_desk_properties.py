"""Three screens do whatever they like at one desk: the robot never obeys two of them at once.

The desk, the lease and the movers are the real ones; only the line is a list. Whoever moves sends a
value of its own, so that what is written tells whose motion it is.
"""

from collections.abc import Mapping, Sequence
from random import Random

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from tests.effort import examples
from urc.model.driver import Argument, Command, Driver, TransportSpec
from urc.model.exchange import Hold
from urc.model.payload import Payload, WriteSpec
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import HoldTerms, HoldToRun, Reason
from urc.motion.lease import Operator
from urc.runtime.motion_controller import MotionController
from urc.testing.movers import FakeFrames

SPEED = Argument("speed", min=-1.0, max=1.0, default=0.0, is_required=False)
STEPS = 10_000
SCREENS = (
    Operator("s0", "screen 0", "driver"),
    Operator("s1", "screen 1", "driver"),
    Operator("s2", "screen 2", "engineer"),
)
COMMANDS = ("drive", "lift")
VERBS = ("take", "ask", "yes", "no", "force", "leave", "reset")
RARE = ("stop", "part", "wait", "line", "engine")
DEEDS = (*RARE, *VERBS, *["take", "reset", "mend", "beat", "tick", "release", "hold", "hold"] * 4)
"""What happens; ``hold`` is a hand at rest on a control, ``tick`` one sample of anybody's."""


def held(name: str, line: str) -> Command:
    """Return a held command with a speed."""
    hold = Hold(0.05, {"speed": 0.0}, 0.25)
    return Command(name, line, WriteSpec("text", {}), {"speed": SPEED}, hold=hold)


DRIVER = Driver(
    {"wire": TransportSpec("wire", "tcp"), "air": TransportSpec("air", "udp")},
    commands={"drive": held("drive", "wire"), "lift": held("lift", "air")},
)


class Line:
    """Real movers, and what they write."""

    def __init__(self) -> None:
        self.movers: dict[str, HoldToRun] = {}
        self.written: list[str] = []
        self.reported: list[tuple[str, Reason]] = []
        self.is_up = True
        self.now = 0.0

    def arm(self, command: str, terms: HoldTerms) -> None:
        self._mover(command, terms).arm()

    def tick(self, command: str, data: Payload) -> None:
        self.movers[command].tick(data, self.now)

    def renew(self, command: str, stop: Payload) -> None:
        if command in self.movers:
            self.movers[command].renew(self.movers[command].terms._replace(stop=stop))

    def is_stopping(self, command: str) -> bool:
        return command in self.movers and self.movers[command].state != "idle"

    def is_open(self, command: str) -> bool:
        return self.is_up

    def release(self, command: str) -> None:
        if command in self.movers:
            self.movers[command].stop("released", self.now)

    def stop(self, stops: Mapping[str, Payload]) -> None:
        for command, frame in stops.items():
            mover = self._mover(command, HoldTerms(frame, period_s=0.05))
            mover.stop("stopped", self.now)
            if not self.is_up:
                mover.cut()

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        raise NotImplementedError

    def _mover(self, command: str, terms: HoldTerms) -> HoldToRun:
        mover = self.movers.get(command)
        if mover is None:
            mover = self.movers[command] = HoldToRun(terms)
        else:
            mover.renew(terms)
        return mover

    def switch(self) -> None:
        """Cut the line, or bring it back."""
        self.is_up = not self.is_up
        for mover in self.movers.values():
            if self.is_up:
                mover.restored(self.now)
            else:
                mover.cut()

    def step(self) -> list[str]:
        """Return what is written now."""
        texts: list[str] = []
        for command, mover in self.movers.items():
            while self.is_up and (data := mover.due(self.now, is_clear=True)) is not None:
                assert isinstance(data, bytes)
                texts.append(data.decode())
                if data == mover.terms.stop and mover.reason is not None and not mover.is_told:
                    mover.is_told = True
                    self.reported.append((command, mover.reason))
        return texts


class World:
    """The desk, three screens and the line."""

    def __init__(self) -> None:
        self.line = Line()
        self.frames = FakeFrames(DRIVER)
        self.desk = MotionController(DRIVER)
        self.desk.attach(self.frames, self.line)
        self.is_attached = True
        for screen in SCREENS:
            self.desk.join(screen)
        self.echoes = dict.fromkeys((screen.id for screen in SCREENS), 0)
        self.numbers = 0
        self.moving: dict[str, str] = {}
        """Command → whose motion the robot obeys."""
        self.moved = dict.fromkeys((screen.id for screen in SCREENS), 0)

    def do(self, deed: str, who: int, command: str, wait_s: float) -> None:
        """Let one screen do something; then time passes, and the line is looked at."""
        screen, desk, now = SCREENS[who], self.desk, self.line.now
        match deed:
            case "tick":
                self.tick(screen, who, command, now)
            case "hold":
                self.hold(screen, who, command)
            case "release":
                desk.release(screen.id, command)
            case "beat":
                self.echoes[screen.id] = desk.beat(screen.id, now)
            case "stop":
                desk.stop(screen.name)
            case "part":
                desk.part(screen.id)
                desk.join(screen)
            case "line":
                self.line.switch()
            case "engine":
                self.switch_engine()
            case "mend":
                if not self.line.is_up:
                    self.line.switch()
                if not self.is_attached:
                    self.switch_engine()
            case "wait":
                self.line.now += 10 * wait_s
            case verb:
                desk.drive(screen.id, verb, now)
        self.look()
        self.line.now += wait_s
        self.look()
        desk.expire(self.line.now)
        self.look()

    def tick(self, screen: Operator, who: int, command: str, now: float) -> None:
        """Send sampled input, as a page does that believes it has the controls."""
        self.numbers += 1
        epoch = self.desk.lease.state.epoch
        given = ControlInput(epoch, self.numbers, self.echoes[screen.id])
        self.desk.tick(screen.id, command, {"speed": (who + 1) / 10}, given, now)

    def hold(self, screen: Operator, who: int, command: str) -> None:
        """Do as a page does whose hand is on a control: a sample every 50 ms, each answering."""
        for _ in range(4):
            now = self.line.now
            self.echoes[screen.id] = self.desk.beat(screen.id, now)
            self.tick(screen, who, command, now)
            self.look()
            self.line.now += 0.05

    def switch_engine(self) -> None:
        """End the session, or begin another one; what moves is stopped by its movers."""
        self.is_attached = not self.is_attached
        if self.is_attached:
            self.desk.attach(self.frames, self.line)
            return
        self.desk.detach()
        for mover in self.line.movers.values():
            if mover.state == "moving":
                mover.stop("revoked", self.line.now)

    def look(self) -> None:
        """See what is written, and whose it is."""
        for text in self.line.step():
            command, what = text.split()
            if what == "stop":
                self.moving.pop(command, None)
                continue
            who = SCREENS[round(float(what.split("=")[1]) * 10) - 1]
            self.moving[command] = who.id
            self.moved[who.id] += 1
            assert len(set(self.moving.values())) == 1, f"two drive: {self.moving}"
            state = self.desk.lease.state
            assert state.holder is not None
            assert state.holder.id == who.id, "motion of somebody without the lease"
            assert not state.latched_by, "motion while a stop is latched"
        reported, self.line.reported = self.line.reported, []
        for command, reason in reported:
            self.desk.stopped(command, reason)


def test_ten_thousand_steps_never_have_two_holders_on_the_wire() -> None:
    """Whatever three screens do, and whatever becomes of the line and the session."""
    dice, world = Random(7), World()  # noqa: S311 - the same steps in every run
    for _ in range(STEPS):
        deed, command = dice.choice(DEEDS), dice.choice(COMMANDS)
        world.do(deed, dice.randrange(3), command, dice.choice((0.0, 0.02, 0.05, 0.3)))
    assert sum(world.moved.values()) > STEPS / 20, "hardly anything moved: nothing is shown"
    assert all(world.moved.values()), "somebody never moved"


class Machine(RuleBasedStateMachine):
    """The same, by steps that can be made fewer until the fault is plain."""

    def __init__(self) -> None:
        super().__init__()
        self.world = World()

    @rule(
        deed=st.sampled_from(sorted(set(DEEDS))),
        who=st.integers(0, 2),
        command=st.sampled_from(COMMANDS),
        wait_s=st.sampled_from((0.0, 0.02, 0.05, 0.3)),
    )
    def do(self, deed: str, who: int, command: str, wait_s: float) -> None:
        self.world.do(deed, who, command, wait_s)


TestMachine = Machine.TestCase
TestMachine.settings = settings(max_examples=examples(240), stateful_step_count=50, deadline=None)
