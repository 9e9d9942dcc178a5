"""The desk: dialogues between screens, the lease, the engine and the movers."""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

import pytest

from urc.model.codec import Payload, WriteSpec
from urc.model.driver import Argument, Command, Driver, TransportSpec
from urc.model.flow import Hold
from urc.model.values import Reading
from urc.motion.fresh import Input
from urc.motion.hold import Reason, Terms
from urc.motion.lease import Client, LeaseState
from urc.problems import UrcError
from urc.runtime.motion import LET_GO, MOST_SCREENS, MotionDesk
from urc.testing.movers import FakeFrames

SPEED = Argument("speed", min=-1.0, max=1.0, default=0.0, is_required=False)


def held(name: str, line: str = "wire") -> Command:
    """Return a held command with a speed."""
    hold = Hold(0.05, {"speed": 0.0}, 0.3)
    return Command(name, line, WriteSpec("text", {}), {"speed": SPEED}, hold=hold)


DRIVER = Driver(
    {"wire": TransportSpec("wire", "tcp"), "air": TransportSpec("air", "udp")},
    commands={
        "drive": held("drive"),
        "lift": held("lift", "air"),
        "beep": Command("beep", "wire", WriteSpec("text", {})),
    },
)


class Movers:
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []
        self.terms: dict[str, Terms] = {}

    def arm(self, command: str, terms: Terms) -> None:
        self.told.append(f"arm {command}")
        self.terms[command] = terms

    def tick(self, command: str, data: Payload) -> None:
        assert isinstance(data, bytes)
        self.told.append(data.decode())

    def release(self, command: str) -> None:
        self.told.append(f"release {command}")

    def stop(self, stops: Mapping[str, Payload]) -> None:
        self.told.append(f"stop {' '.join(stops)}")

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        raise NotImplementedError


class Scene:
    """A desk with a robot, two drivers, an engineer and a viewer."""

    def __init__(self, kept: LeaseState | None = None, *, is_attached: bool = True) -> None:
        self.desk = MotionDesk(DRIVER, kept=kept)
        self.movers = Movers()
        self.frames = FakeFrames(DRIVER)
        if is_attached:
            self.desk.attach(self.frames, self.movers)
        for name, role in {"ann": "driver", "bob": "driver", "eve": "engineer"}.items():
            self.desk.join(Client(name, name, role))  # type: ignore[arg-type]
        self.desk.join(Client("vic", "vic", "viewer"))
        self.now = 100.0
        self._number = 0

    def tick(self, who: str = "ann", command: str = "drive", **arguments: Reading) -> str:
        """Tick as a page does that has just heard the beat."""
        self._number += 1
        self.now += 0.05
        echo = self.desk.beat(who, self.now)
        given = Input(self.desk.lease.state.epoch, self._number, echo)
        return self.desk.tick(who, command, arguments, given, self.now)

    def drive(self, who: str, verb: str, **more: Any) -> str:
        """Say something about the controls."""
        return self.desk.drive(who, verb, self.now, **more)

    def heard(self) -> list[str]:
        """Return what the movers were told since the last call."""
        told, self.movers.told = self.movers.told, []
        return told


def test_the_first_tick_arms_with_the_stop_and_each_tick_is_a_frame() -> None:
    """The terms are the driver's own; datagrams may be lost, so a stop is repeated there."""
    it = Scene()
    assert it.drive("ann", "take") == ""
    assert it.tick(speed=0.5) == ""
    assert it.tick(speed=0.6) == ""
    assert it.tick(command="lift") == ""
    assert it.heard() == [
        *("arm drive", "drive speed=0.5", "drive speed=0.6"),
        *("arm lift", "lift speed=0.0"),
    ]
    assert it.movers.terms["drive"] == Terms(b"drive stop", 0.05, 0.3, is_lossy=False)
    assert it.movers.terms["lift"].is_lossy


def test_who_has_not_the_controls_moves_nothing() -> None:
    """The refusal names the holder, or says what to do."""
    it = Scene()
    assert it.tick("ann") == "nobody has the controls: take them first"
    it.drive("ann", "take")
    assert it.tick("bob", speed=1) == "ann has the controls"
    assert it.drive("bob", "take") == "ann has the controls"
    assert it.drive("vic", "take") == "viewers cannot drive"
    assert it.tick("ann", "beep") == "'beep' is no held command of this robot"
    assert it.heard() == []


@pytest.mark.parametrize("speed", [1.01, -2, "fast", True, None, [0.5], float("nan"), float("inf")])
def test_a_value_out_of_range_moves_nothing_and_ends_the_gesture(speed: Any) -> None:
    """What is armed is let go; good values of the same gesture are not taken any more."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    assert "speed" in it.tick(speed=speed)
    assert it.heard() == ["arm drive", "drive speed=0.5", "release drive"]
    assert it.tick(speed=0.5) == LET_GO
    assert it.heard() == []


def test_after_a_stop_that_nobody_made_it_takes_a_release_and_a_new_lease() -> None:
    """The hand that stayed moves nothing, let go or not, until the controls are taken anew."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.desk.stopped("drive", "expired")
    it.heard()
    assert it.tick(speed=0.5) == LET_GO
    it.desk.release("ann", "drive")
    assert it.tick(speed=0.5) == "it was stopped: take the controls anew"
    before = it.desk.lease.state.epoch
    assert it.drive("ann", "take") == ""
    assert it.desk.lease.state.epoch == before + 1
    assert it.tick(speed=0.5) == ""
    assert it.heard() == ["arm drive", "drive speed=0.5"]


def test_a_release_goes_on_in_the_same_lease() -> None:
    """Letting go is no accident; only the holder's word counts."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.desk.release("bob", "drive")
    it.desk.release("ann", "drive")
    it.desk.stopped("drive", "released")
    assert it.tick(speed=0.2) == ""
    assert it.heard() == ["arm drive", "drive speed=0.5", "release drive", "drive speed=0.2"]


def test_every_change_of_the_holder_goes_through_a_stop() -> None:
    """Handed over, forced, given back, gone: what moved is stopped, the old epoch is void."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    old = it.desk.lease.state.epoch
    assert it.drive("bob", "ask") == ""
    assert it.heard() == ["arm drive", "drive speed=0.5"], "asking stops nothing"
    assert it.drive("ann", "yes") == ""
    assert it.heard() == ["stop drive"]
    assert it.desk.tick("bob", "drive", {}, Input(old, 99, it.desk.beat("bob", 100)), 100) == (
        "the controls were taken anew meanwhile"
    )
    it.tick("bob", speed=0.1)
    assert it.drive("ann", "force") == "taking the controls by force needs an engineer"
    assert it.drive("eve", "force") == ""
    it.tick("eve", speed=0.1)
    it.drive("eve", "leave")
    it.drive("ann", "take")
    it.tick("ann", speed=0.1)
    it.desk.part("ann")
    assert it.heard().count("stop drive") == 3
    assert it.desk.lease.state.holder is None


def test_a_request_without_an_answer_is_granted_in_time() -> None:
    """Ten seconds when nothing else is said."""
    it = Scene()
    it.drive("ann", "take")
    it.drive("bob", "ask", for_s=5)
    it.tick("ann", speed=0.5)
    assert it.desk.deadline is not None
    it.desk.expire(it.desk.deadline)
    assert it.desk.lease.state.holder == Client("bob", "bob", "driver")
    assert it.heard()[-1] == "stop drive"


def test_stop_needs_no_lease_stops_all_and_latches() -> None:
    """Every held command, moving or not; a reset moves nothing and gives nobody the controls."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.desk.stop("vic")
    assert it.heard() == ["stop drive lift"]
    assert it.tick(speed=0.5) == "stopped by vic: reset it first"
    assert it.drive("ann", "take") == "stopped by vic: reset it first"
    assert it.drive("vic", "reset") == "viewers can stop the robot, and cannot reset it"
    assert it.drive("bob", "reset") == ""
    assert it.desk.lease.state.holder is None
    assert it.heard() == []


def test_a_stop_is_confirmed_when_every_line_has_taken_it() -> None:
    """And whoever looks is told of that moment."""
    it = Scene()
    seen: list[bool] = []
    it.desk.on_change = lambda state: seen.append(it.desk.is_confirmed)
    it.desk.stop("ann")
    it.desk.stopped("drive", "stopped")
    assert not it.desk.is_confirmed
    it.desk.stopped("lift", "stopped")
    assert it.desk.is_confirmed
    assert seen == [False, True]


def test_a_stop_without_a_robot_goes_out_when_there_is_one() -> None:
    """It was latched before anybody was connected: that is the first thing the robot hears."""
    it = Scene(is_attached=False)
    it.desk.stop("ann")
    it.drive("ann", "reset")
    assert it.heard() == []
    it.desk.attach(it.frames, it.movers)
    assert it.heard() == ["stop drive lift"]


def test_a_latch_that_was_kept_holds_and_is_no_news_to_the_robot() -> None:
    """After a restart: higher epoch, nobody drives, nothing is written."""
    it = Scene(LeaseState(epoch=41, latched_by="ann"))
    state = it.desk.lease.state
    assert (state.epoch, state.holder, state.latched_by) == (42, None, "ann")
    assert it.drive("bob", "take") == "stopped by ann: reset it first"
    assert it.heard() == []


def test_a_session_that_ends_leaves_nothing_armed() -> None:
    """The next one moves only after a new gesture in a new lease."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.desk.detach()
    assert it.tick(speed=0.5) == LET_GO
    it.desk.release("ann", "drive")
    it.desk.attach(it.frames, it.movers)
    it.heard()
    assert it.tick(speed=0.5) == "it was stopped: take the controls anew"
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""
    assert it.heard() == ["arm drive", "drive speed=0.5"]


def test_the_two_controls_of_one_screen_count_for_themselves() -> None:
    """A tick of one that was held up is not overtaken by the other's."""
    it = Scene()
    it.drive("ann", "take")
    epoch, echo = it.desk.lease.state.epoch, it.desk.beat("ann", it.now)
    assert it.desk.tick("ann", "lift", {}, Input(epoch, 6, echo), it.now) == ""
    assert it.desk.tick("ann", "drive", {}, Input(epoch, 5, echo), it.now) == ""
    assert it.desk.tick("ann", "drive", {}, Input(epoch, 5, echo), it.now) == (
        "it is not newer than the last one"
    )


def test_recorded_ticks_are_refused_by_the_next_connection() -> None:
    """The server's numbers begin anywhere: nobody echoes one that was not told to it."""
    it = Scene()
    it.drive("ann", "take")
    echo = it.desk.beat("ann", it.now)
    it.desk.part("ann")
    it.desk.join(Client("ann", "ann", "driver"))
    it.drive("ann", "take")
    it.desk.beat("ann", it.now)
    given = Input(it.desk.lease.state.epoch, 1, echo)
    assert it.desk.tick("ann", "drive", {}, given, it.now) == "it answers no tick of this server"


def test_a_stop_frame_that_cannot_be_made_keeps_back_no_other() -> None:
    """It is told by `urc validate`; stopping goes on."""
    it = Scene()
    whole = it.frames.stop_frame

    def broken(command: str) -> Payload:
        if command == "drive":
            raise UrcError("no such setting")
        return whole(command)

    it.frames.stop_frame = broken  # type: ignore[method-assign]
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == "no such setting"
    it.desk.stop("ann")
    assert it.heard() == ["stop lift"]


def test_too_many_screens_are_turned_away() -> None:
    """Each costs memory; the bound is the server's own."""
    it = Scene()
    for number in range(MOST_SCREENS - 4):
        it.desk.join(Client(str(number)))
    with pytest.raises(UrcError, match="256 screens"):
        it.desk.join(Client("one-too-many"))


def test_an_unknown_verb_is_told() -> None:
    """Whoever calls the desk from Python sees it."""
    assert Scene().drive("ann", "grab") == "the controls know no 'grab'"


def test_over_ten_thousand_random_steps_no_two_screens_move_the_robot() -> None:
    """Between the motion of one screen and that of another there is always a stop."""
    dice = Random(5)  # noqa: S311 - it is no secret
    it = Scene()
    mine = {"ann": 0.1, "bob": 0.2, "eve": 0.3}
    moving = ""
    for _ in range(10_000):
        who = dice.choice(tuple(mine))
        step = dice.randrange(12)
        if step < 6:
            it.tick(who, speed=mine[who])
        elif step < 9:
            it.drive(who, dice.choice(("take", "ask", "yes", "no", "force", "leave", "reset")))
        elif step == 9:
            it.desk.release(who, "drive")
            it.desk.stopped("drive", "released")
        elif step == 10:
            it.desk.stopped("drive", dice.choice(("expired", "revoked")))
            moving = ""
        else:
            it.now += dice.choice((0.1, 1.0, 70.0))
            it.desk.expire(it.now)
            if dice.random() < 0.1:
                it.desk.stop(who)
        for told in it.heard():
            if told.startswith(("stop", "release")):
                moving = ""
            elif told.startswith("drive"):
                driver = next(name for name, speed in mine.items() if told.endswith(str(speed)))
                assert moving in ("", driver)
                moving = driver
