"""The desk: dialogues between screens, the lease, the engine and the movers."""

from typing import Any

import pytest

from tests.unit.runtime.desks import DRIVER, Scene, held
from urc.model.driver import Command, Driver
from urc.model.payload import Payload, WriteSpec
from urc.model.sequence import WaitStep
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import HoldTerms
from urc.motion.lease import LeaseState, Operator
from urc.problems import UrcError
from urc.protocol.events import MotionReady, MotionRefused
from urc.runtime.motion_controller import LET_GO, MOST_SCREENS
from urc.testing.movers import FakeSession


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
    assert it.backend.terms["drive"] == HoldTerms(b"drive stop", 0.05, 0.3, is_lossy=False)
    assert it.backend.terms["lift"].is_lossy


def test_who_has_not_the_controls_moves_nothing() -> None:
    """The refusal names the holder, or says what to do."""
    it = Scene()
    assert it.tick("ann") == "Take control first"
    it.drive("ann", "take")
    assert it.tick("bob", speed=1) == "ann has the controls"
    assert it.drive("bob", "take") == "ann has the controls"
    assert it.drive("vic", "take") == "watchers cannot drive"
    assert it.tick("ann", "beep") == "'beep' is not a held command of this robot"
    assert it.heard() == []


@pytest.mark.parametrize("speed", [1.01, -2, "fast", True, None, [0.5], float("nan"), float("inf")])
def test_a_value_out_of_range_moves_nothing_and_ends_the_gesture(speed: Any) -> None:
    """What is armed is let go; good values of the same gesture are not taken any more."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    refused = it.tick(speed=speed)
    assert "speed" in refused
    assert it.heard() == ["arm drive", "drive speed=0.5", "release drive"]
    assert it.tick(speed=0.5) == refused
    assert it.heard() == []


def test_a_gesture_that_was_refused_is_told_why_for_as_long_as_it_goes_on() -> None:
    """The first refusal is seldom told by itself: the robot has just moved."""
    it = Scene()
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""
    it.frames.refusal = "the robot has sent nothing for 2 s"
    assert it.tick(speed=0.5) == "the robot has sent nothing for 2 s"
    it.frames.refusal = ""
    assert it.tick(speed=0.5) == "the robot has sent nothing for 2 s"
    it.controller.stopped("drive", "released")
    assert it.tick(speed=0.5) == "the robot has sent nothing for 2 s"
    it.controller.release("ann", "drive")
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""


def test_after_a_stop_that_nobody_made_it_takes_a_release_and_a_new_lease() -> None:
    """The hand that stayed moves nothing, let go or not, until the controls are taken anew."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.stopped("drive", "expired")
    it.heard()
    assert it.tick(speed=0.5) == LET_GO
    it.controller.release("ann", "drive")
    assert it.tick(speed=0.5) == "Stopped: take control again"
    before = it.controller.lease.state.epoch
    assert it.drive("ann", "take") == ""
    assert it.controller.lease.state.epoch == before + 1
    assert it.tick(speed=0.5) == ""
    assert it.heard() == ["arm drive", "drive speed=0.5"]


def test_a_release_goes_on_in_the_same_lease() -> None:
    """Letting go is no accident; only the holder's word counts."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("bob", "drive")
    it.controller.release("ann", "drive")
    it.controller.stopped("drive", "released")
    assert it.tick(speed=0.2) == ""
    assert it.heard() == ["arm drive", "drive speed=0.5", "release drive", "drive speed=0.2"]


def test_a_release_without_a_number_voids_no_later_tick() -> None:
    """Such as that of a page that lost the robot before it sent a tick."""
    it = Scene()
    it.drive("ann", "take")
    it.controller.release("ann", "drive")
    assert it.tick(speed=0.2) == "", "this is tick 1"


def test_every_change_of_the_holder_goes_through_a_stop() -> None:
    """Handed over, forced, given back, gone: what moved is stopped, the old epoch is void."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    old = it.controller.lease.state.epoch
    assert it.drive("bob", "ask") == ""
    assert it.heard() == ["arm drive", "drive speed=0.5"], "asking stops nothing"
    assert it.drive("ann", "yes") == ""
    assert it.heard() == ["stop drive"]
    assert it.controller.tick(
        "bob", "drive", {}, ControlInput(old, 99, it.controller.heartbeat("bob", 100)), 100
    ) == ("Control changed hands meanwhile")
    it.tick("bob", speed=0.1)
    assert it.drive("ann", "force") == "Taking over needs the role maintain"
    assert it.drive("eve", "force") == ""
    it.tick("eve", speed=0.1)
    it.drive("eve", "leave")
    it.drive("ann", "take")
    it.tick("ann", speed=0.1)
    it.controller.part("ann")
    assert it.heard().count("stop drive") == 3
    assert it.controller.lease.state.holder is None


def test_a_request_without_an_answer_is_granted_in_time() -> None:
    """Ten seconds when nothing else is said."""
    it = Scene()
    it.drive("ann", "take")
    it.drive("bob", "ask", for_s=5)
    it.tick("ann", speed=0.5)
    assert it.controller.deadline is not None
    it.controller.expire(it.controller.deadline)
    assert it.controller.lease.state.holder == Operator("bob", "bob", "drive")
    assert it.heard()[-1] == "stop drive"


def test_stop_needs_no_lease_stops_all_and_latches() -> None:
    """Every held command, moving or not; a reset moves nothing and gives nobody the controls."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.controller.stop("vic")
    assert it.heard() == ["stop drive lift"]
    assert it.tick(speed=0.5) == "Stopped by vic. Reset to drive again."
    assert it.drive("ann", "take") == "Stopped by vic. Reset to drive again."
    assert it.drive("vic", "reset") == "watchers can stop the robot, but cannot reset it"
    assert it.drive("bob", "reset") == ""
    assert it.controller.lease.state.holder is None
    assert it.heard() == []


def test_a_reset_that_does_not_know_the_newest_stop_is_refused() -> None:
    it = Scene()
    it.controller.stop("ann")
    known = it.controller.lease.state.stops
    it.controller.stop("vic")
    assert it.drive("bob", "reset", stops=known) == "STOP was pressed again: reset it again"
    assert it.drive("bob", "reset", stops=known + 1) == ""


def test_a_stop_is_confirmed_when_every_line_has_taken_it() -> None:
    """And whoever looks is told of that moment."""
    it = Scene()
    seen: list[bool] = []
    it.controller.on_change = lambda state: seen.append(it.controller.is_confirmed)
    it.controller.stop("ann")
    it.controller.stopped("drive", "stopped")
    assert not it.controller.is_confirmed
    it.controller.stopped("lift", "stopped")
    assert it.controller.is_confirmed
    assert seen == [False, True]


def test_a_stop_without_a_robot_goes_out_when_there_is_one() -> None:
    """It was latched before anybody was connected: that is the first thing the robot hears."""
    it = Scene(is_attached=False)
    it.controller.stop("ann")
    it.drive("ann", "reset")
    assert it.heard() == []
    it.controller.attach(FakeSession(it.frames, it.backend))
    assert it.heard() == ["stop drive lift"]


def test_a_latch_that_was_kept_holds_and_is_no_news_to_the_robot() -> None:
    """After a restart: higher epoch, nobody drives, nothing is written."""
    it = Scene(LeaseState(epoch=41, latched_by="ann"))
    state = it.controller.lease.state
    assert (state.epoch, state.holder, state.latched_by) == (42, None, "ann")
    assert it.drive("bob", "take") == "Stopped by ann. Reset to drive again."
    assert it.heard() == []


def test_a_stop_that_the_robot_did_not_hear_of_before_a_restart_is_its_first_news() -> None:
    """Nobody was told that it had: it is confirmed when the line has taken it."""
    it = Scene(LeaseState(epoch=41, latched_by="ann"), is_attached=False, is_owed=True)
    assert not it.controller.is_confirmed
    it.controller.attach(FakeSession(it.frames, it.backend))
    assert it.heard() == ["stop drive lift"]
    for command in ("drive", "lift"):
        it.controller.stopped(command, "stopped")
    assert it.controller.is_confirmed


def test_a_session_that_ends_leaves_nothing_armed() -> None:
    """The next one moves only after a new gesture in a new lease."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.detach()
    assert it.tick(speed=0.5) == LET_GO
    it.controller.release("ann", "drive")
    it.controller.attach(FakeSession(it.frames, it.backend))
    it.heard()
    assert it.tick(speed=0.5) == "Stopped: take control again"
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""
    assert it.heard() == ["arm drive", "drive speed=0.5"]


def test_the_two_controls_of_one_screen_count_for_themselves() -> None:
    """A tick of one that was held up is not overtaken by the other's."""
    it = Scene()
    it.drive("ann", "take")
    epoch, echo = it.controller.lease.state.epoch, it.controller.heartbeat("ann", it.now)
    assert it.controller.tick("ann", "lift", {}, ControlInput(epoch, 6, echo), it.now) == ""
    assert it.controller.tick("ann", "drive", {}, ControlInput(epoch, 5, echo), it.now) == ""
    assert it.controller.tick("ann", "drive", {}, ControlInput(epoch, 5, echo), it.now) == (
        "the input is not newer than the previous input"
    )


def test_recorded_ticks_are_refused_by_the_next_connection() -> None:
    """The server's numbers begin anywhere: nobody echoes one that was not told to it."""
    it = Scene()
    it.drive("ann", "take")
    echo = it.controller.heartbeat("ann", it.now)
    it.controller.part("ann")
    it.controller.join(Operator("ann", "ann", "drive"))
    it.drive("ann", "take")
    it.controller.heartbeat("ann", it.now)
    given = ControlInput(it.controller.lease.state.epoch, 1, echo)
    assert (
        it.controller.tick("ann", "drive", {}, given, it.now)
        == "the input does not echo a heartbeat of this server"
    )


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
    it.controller.stop("ann")
    assert it.heard() == ["stop lift"]


def test_a_stop_that_cannot_be_made_any_more_goes_out_as_it_was_armed() -> None:
    """Better the one that was good when the motion began than none."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)

    def broken(command: str) -> Payload:
        raise UrcError("no such setting")

    it.frames.stop_frame = broken  # type: ignore[method-assign]
    it.heard()
    it.controller.stop("ann")
    assert it.heard() == ["stop drive"]


def test_a_stop_with_a_number_is_made_anew_whenever_one_is_used_up() -> None:
    """By the tick itself, and by whatever else is sent: its number is the newest at any time."""
    it = Scene()
    it.frames.number = 10
    it.drive("ann", "take")
    it.tick(speed=0.5)
    assert it.heard() == ["arm drive", "11 drive speed=0.5"]
    assert it.backend.terms["drive"].stop == b"12 drive stop"
    it.tick(speed=0.6)
    assert it.heard() == ["stop is 13 drive stop", "12 drive speed=0.6"]
    assert it.frames.send() == 13
    assert it.heard() == ["stop is 14 drive stop"]
    it.frames.send("air")
    assert it.heard() == [], "that was another line"
    it.controller.release("ann", "drive")
    assert it.heard() == ["release drive", "stop is 15 drive stop"]
    it.controller.stopped("drive", "expired")
    it.frames.send()
    assert it.heard() == [], "nothing is armed: a stop is made when somebody wants it"


def greeted(name: str) -> Driver:
    """Return the driver with start-up steps on a line."""
    spec = DRIVER.transports[name]._replace(on_connect=(WaitStep(0.1),))
    return DRIVER._replace(transports={**DRIVER.transports, name: spec})


def test_a_stop_before_the_login_is_repeated_after_it() -> None:
    """The robot may have taken it for a part of the login. It is not confirmed until then."""
    it = Scene(driver=greeted("wire"))
    it.controller.stop("ann")
    it.frames.is_greeted = False
    it.heard()
    it.controller.stopped("drive", "revoked")
    it.controller.stopped("lift", "revoked")
    assert it.heard() == []
    assert not it.controller.is_confirmed
    it.frames.is_greeted = True
    it.controller.handle(MotionReady("air"))
    assert it.heard() == []
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == ["stop drive"]
    it.controller.stopped("drive", "stopped")
    assert it.controller.is_confirmed
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == [], "once is enough"


def test_a_stop_on_a_half_duplex_line_is_repeated_when_the_line_is_ready() -> None:
    """The robot may still have been sending: the two collide, and the stop is lost."""
    lines = {**DRIVER.transports, "wire": DRIVER.transports["wire"]._replace(is_half_duplex=True)}
    it = Scene(driver=DRIVER._replace(transports=lines))
    it.controller.stop("ann")
    it.frames.is_greeted = False
    it.heard()
    it.controller.stopped("drive", "revoked")
    assert not it.controller.is_confirmed
    it.frames.is_greeted = True
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == ["stop drive"]


def test_a_line_that_the_guard_lost_is_not_ready_whatever_the_engine_knows() -> None:
    """The guard's stop is told before the engine has heard that its line is gone."""
    it = Scene(driver=greeted("wire"))
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.backend.is_up = False
    it.controller.stopped("drive", "revoked")
    it.backend.is_up = True
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == ["stop drive"]


def test_a_repeated_stop_of_a_released_stick_ends_its_gesture() -> None:
    """The guard disarms the stick, so a tick that is still on its way must not count."""
    it = Scene(driver=greeted("wire"))
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.frames.is_greeted = False
    it.controller.stopped("drive", "released")
    it.frames.is_greeted = True
    it.heard()
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == ["stop drive"]
    it.tick(speed=0.5)
    assert it.heard() == []


def test_a_stop_on_a_line_that_is_ready_is_not_repeated() -> None:
    it = Scene(driver=greeted("wire"))
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.stopped("drive", "expired")
    it.heard()
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == []


def test_speed_grows_as_fast_as_the_driver_lets_it_and_falls_at_once() -> None:
    """On the server, whatever a page sends. After each stop it begins at rest."""
    slow = held("drive")
    assert slow.hold is not None
    slow = slow._replace(hold=slow.hold._replace(slew={"speed": 2.0}))
    it = Scene(driver=DRIVER._replace(commands={**DRIVER.commands, "drive": slow}))
    moved: list[Any] = []
    it.controller.on_moved = lambda who, epoch, command, arguments, data, now: moved.append(
        arguments
    )
    it.drive("ann", "take")
    for _ in range(3):
        it.tick(speed=1.0)
    assert [round(one["speed"], 3) for one in moved] == [0.1, 0.2, 0.3], "the audit has the same"
    it.now += 0.15
    it.tick(speed=1.0)
    assert moved[-1]["speed"] == pytest.approx(0.7), "as long as the pause was"
    it.tick(speed=0.05)
    assert it.heard()[-1] == "drive speed=0.05"
    it.tick(speed=1.0)
    it.controller.release("ann", "drive")
    it.heard()
    it.tick(speed=1.0)
    assert it.heard() == ["drive speed=0.1"]
    it.tick(speed=float("nan"))
    assert it.heard() == ["release drive"], "what is no number is still refused"


def test_too_many_screens_are_turned_away() -> None:
    """Each costs memory; the bound is the server's own."""
    it = Scene()
    for number in range(MOST_SCREENS - 4):
        it.controller.join(Operator(str(number)))
    with pytest.raises(UrcError, match="256 pages"):
        it.controller.join(Operator("one-too-many"))


def test_an_unknown_verb_is_told() -> None:
    """Whoever calls the desk from Python sees it."""
    assert Scene().drive("ann", "grab") == "unknown lease request 'grab'"


def test_a_robot_of_which_only_something_moves_by_itself_can_be_stopped_without_movers() -> None:
    """The stop is latched; nobody writes anything for it."""
    fold = Command("fold", "wire", WriteSpec("text", {}), moves=True)
    it = Scene(is_attached=False, driver=DRIVER._replace(commands={"fold": fold}))
    it.controller.attach(FakeSession(it.frames, None))
    assert it.controller.can_move
    it.controller.stop("ann")
    assert it.controller.lease.interlock(Operator("bob")) == "Stopped by ann. Reset to drive again."
    assert not it.controller.has_own_stop
    assert it.drive("bob", "reset") == ""
    assert it.controller.lease.interlock(Operator("bob")) == ""
    assert it.drive("ann", "take") == ""
    assert it.controller.lease.interlock(Operator("bob")) == "ann has the controls"
    assert it.controller.lease.interlock(Operator("ann")) == ""
    assert it.controller.lease.interlock(Operator("vic", role="watch")) == "this page only watches"


def test_a_robot_that_refuses_ends_the_motion_in_its_own_words() -> None:
    """It hears the stop; going on takes a release, a new lease and a new gesture."""
    it = Scene()
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""
    told: list[tuple[str, str]] = []
    it.controller.on_refused = lambda command, why: told.append((command, why))
    it.heard()
    it.controller.handle(MotionRefused("wire", "drive", "the guard is open"))
    assert it.heard() == ["release drive"]
    assert told == [("drive", "the guard is open")]
    assert it.tick(speed=0.5) == "the guard is open"
    it.controller.release("ann", "drive")
    assert "take control again" in it.tick(speed=0.5)
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""


def test_a_refusal_of_what_does_not_move_changes_nothing() -> None:
    """The answer to the last frame comes after the hand has let go."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.heard()
    it.controller.handle(MotionRefused("wire", "drive", "too late"))
    it.controller.handle(MotionRefused("wire", "lift", "it never moved"))
    it.controller.handle(MotionRefused("wire", "beep", "it is not held"))
    assert it.heard() == []
    assert it.tick(speed=0.5) == ""


def test_motion_that_waits_for_an_answer_holds_its_lease() -> None:
    """Nothing is written, nothing is noted as moved, and nothing ends."""
    it = Scene()
    it.drive("ann", "take")
    told: list[object] = []
    it.controller.on_moved = lambda *what: told.append(what)
    assert it.tick(speed=0.5) == ""
    frame, it.frames.motion_frame = it.frames.motion_frame, lambda *_: b""  # type: ignore[method-assign,misc,assignment]
    it.heard()
    assert it.tick(speed=0.6) == ""
    assert it.heard() == [""]
    it.frames.motion_frame = frame  # type: ignore[method-assign]
    assert it.tick(speed=0.7) == ""
    assert len(told) == 2
