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
from urc.testing.movers import FakeFrames, FakeSession

SPEED = Argument("speed", min=-1.0, max=1.0, default=0.0, is_required=False)
STEPS = 10_000
SCREENS = (
    Operator("s0", "screen 0", "drive"),
    Operator("s1", "screen 1", "drive"),
    Operator("s2", "screen 2", "maintain"),
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
        self.backend: dict[str, HoldToRun] = {}
        self.written: list[str] = []
        self.reported: list[tuple[str, Reason]] = []
        self.is_up = True
        self.now = 0.0

    def arm(self, command: str, terms: HoldTerms) -> None:
        self._hold_to_run(command, terms).arm()

    def is_armed(self, command: str) -> bool:
        return command in self.backend and self.backend[command].is_armed

    def tick(self, command: str, data: Payload) -> None:
        self.backend[command].tick(data, self.now)

    def renew(self, command: str, stop: Payload) -> None:
        if command in self.backend:
            self.backend[command].renew(self.backend[command].terms._replace(stop=stop))

    def is_stopping(self, command: str) -> bool:
        return command in self.backend and self.backend[command].state != "idle"

    def owes_stop(self, command: str) -> bool:
        return self.is_stopping(command)

    def is_open(self, command: str) -> bool:
        return self.is_up

    def release(self, command: str) -> None:
        if command in self.backend:
            self.backend[command].stop("released", self.now)

    def stop(self, stops: Mapping[str, Payload]) -> None:
        for command, frame in stops.items():
            hold_to_run = self._hold_to_run(command, HoldTerms(frame, period_s=0.05))
            hold_to_run.stop("stopped", self.now)
            if not self.is_up:
                hold_to_run.cut()

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        raise NotImplementedError

    def _hold_to_run(self, command: str, terms: HoldTerms) -> HoldToRun:
        hold_to_run = self.backend.get(command)
        if hold_to_run is None:
            hold_to_run = self.backend[command] = HoldToRun(terms)
        else:
            hold_to_run.renew(terms)
        return hold_to_run

    def switch(self) -> None:
        """Cut the line, or bring it back."""
        self.is_up = not self.is_up
        for hold_to_run in self.backend.values():
            if self.is_up:
                hold_to_run.restored(self.now)
            else:
                hold_to_run.cut()

    def step(self) -> list[str]:
        """Return what is written now."""
        texts: list[str] = []
        for command, hold_to_run in self.backend.items():
            while self.is_up and (data := hold_to_run.due(self.now, is_clear=True)) is not None:
                assert isinstance(data, bytes)
                texts.append(data.decode())
                if (
                    data == hold_to_run.terms.stop
                    and hold_to_run.reason is not None
                    and not hold_to_run.is_told
                ):
                    hold_to_run.is_told = True
                    self.reported.append((command, hold_to_run.reason))
        return texts


class World:
    """The desk, three screens and the line."""

    def __init__(self) -> None:
        self.line = Line()
        self.frames = FakeFrames(DRIVER)
        self.controller = MotionController(DRIVER)
        self.controller.attach(FakeSession(self.frames, self.line))
        self.is_attached = True
        for screen in SCREENS:
            self.controller.join(screen)
        self.echoes = dict.fromkeys((screen.id for screen in SCREENS), 0)
        self.numbers = 0
        self.moving: dict[str, str] = {}
        """Command → whose motion the robot obeys."""
        self.moved = dict.fromkeys((screen.id for screen in SCREENS), 0)

    def do(self, reaction: str, who: int, command: str, wait_s: float) -> None:
        """Let one screen do something; then time passes, and the line is looked at."""
        screen, controller, now = SCREENS[who], self.controller, self.line.now
        match reaction:
            case "tick":
                self.tick(screen, who, command, now)
            case "hold":
                self.hold(screen, who, command)
            case "release":
                controller.release(screen.id, command)
            case "beat":
                self.echoes[screen.id] = controller.heartbeat(screen.id, now)
            case "stop":
                controller.stop(screen.name)
            case "part":
                controller.part(screen.id)
                controller.join(screen)
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
                controller.drive(screen.id, verb, now)
        self.look()
        self.line.now += wait_s
        self.look()
        controller.expire(self.line.now)
        self.look()

    def tick(self, screen: Operator, who: int, command: str, now: float) -> None:
        """Send sampled input, as a page does that believes it has the controls."""
        self.numbers += 1
        epoch = self.controller.lease.state.epoch
        given = ControlInput(epoch, self.numbers, self.echoes[screen.id])
        self.controller.tick(screen.id, command, {"speed": (who + 1) / 10}, given, now)

    def hold(self, screen: Operator, who: int, command: str) -> None:
        """Do as a page does whose hand is on a control: a sample every 50 ms, each answering."""
        for _ in range(4):
            now = self.line.now
            self.echoes[screen.id] = self.controller.heartbeat(screen.id, now)
            self.tick(screen, who, command, now)
            self.look()
            self.line.now += 0.05

    def switch_engine(self) -> None:
        """End the session, or begin another one; what moves is stopped by its movers."""
        self.is_attached = not self.is_attached
        if self.is_attached:
            self.controller.attach(FakeSession(self.frames, self.line))
            return
        self.controller.detach()
        for hold_to_run in self.line.backend.values():
            if hold_to_run.state == "moving":
                hold_to_run.stop("revoked", self.line.now)

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
            state = self.controller.lease.state
            assert state.holder is not None
            assert state.holder.id == who.id, "motion of somebody without the lease"
            assert not state.latched_by, "motion while a stop is latched"
        reported, self.line.reported = self.line.reported, []
        for command, reason in reported:
            self.controller.stopped(command, reason)


def test_ten_thousand_steps_never_have_two_holders_on_the_wire() -> None:
    """Whatever three screens do, and whatever becomes of the line and the session."""
    dice, world = Random(7), World()  # noqa: S311 - the same steps in every run
    for _ in range(STEPS):
        reaction, command = dice.choice(DEEDS), dice.choice(COMMANDS)
        world.do(reaction, dice.randrange(3), command, dice.choice((0.0, 0.02, 0.05, 0.3)))
    assert sum(world.moved.values()) > STEPS / 20, "hardly anything moved: nothing is shown"
    assert all(world.moved.values()), "somebody never moved"


class Machine(RuleBasedStateMachine):
    """The same, by steps that can be made fewer until the fault is plain."""

    def __init__(self) -> None:
        super().__init__()
        self.world = World()

    @rule(
        reaction=st.sampled_from(sorted(set(DEEDS))),
        who=st.integers(0, 2),
        command=st.sampled_from(COMMANDS),
        wait_s=st.sampled_from((0.0, 0.02, 0.05, 0.3)),
    )
    def do(self, reaction: str, who: int, command: str, wait_s: float) -> None:
        self.world.do(reaction, who, command, wait_s)


TestMachine = Machine.TestCase
TestMachine.settings = settings(max_examples=examples(240), stateful_step_count=50, deadline=None)
