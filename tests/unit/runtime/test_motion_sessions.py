"""The desk and the sessions of its robot: what it hands on, and what a session lacks."""

from collections.abc import Mapping

from tests.unit.runtime.desks import DRIVER, Scene
from urc.model.payload import Count, CountedFrame, Numbered, Payload
from urc.model.sequence import WaitStep
from urc.model.values import Reading
from urc.motion.lease import Operator
from urc.protocol.events import MotionReady
from urc.testing.movers import FakeSession


def test_a_request_lasts_as_long_as_it_says_and_may_be_declined() -> None:
    it = Scene()
    it.drive("ann", "take")
    assert it.drive("bob", "ask", for_s=5) == ""
    assert it.controller.lease.state.asked_until == it.now + 5
    assert it.drive("ann", "no") == ""
    state = it.controller.lease.state
    assert (state.holder, state.asked_by) == (Operator("ann", "ann", "drive"), None)


def test_a_new_session_owes_no_stop_to_what_rests() -> None:
    it = Scene()
    it.controller.detach()
    it.controller.attach(FakeSession(it.frames, it.backend))
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == []


def test_a_session_without_movers_moves_nothing_and_goes_on() -> None:
    """Numbers that are used up in it, and reports that come late, change nothing."""
    wire = DRIVER.transports["wire"]._replace(on_connect=(WaitStep(0.1),))
    it = Scene(
        is_attached=False,
        driver=DRIVER._replace(transports={**DRIVER.transports, "wire": wire}),
    )
    it.frames.number = 10
    it.controller.attach(FakeSession(it.frames, None))
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == "the robot is not connected"
    it.frames.send()
    it.controller.stopped("drive", "stopped")
    assert it.heard() == []


def test_a_frame_is_made_for_the_time_of_its_tick() -> None:
    """By that it is judged whether what the command requires was heard lately."""
    it = Scene()
    whole, times = it.frames.motion_frame, list[float]()

    def noting(command: str, arguments: Mapping[str, Reading], now: float) -> Payload:
        times.append(now)
        return whole(command, arguments, now)

    it.frames.motion_frame = noting  # type: ignore[method-assign]
    it.drive("ann", "take")
    it.tick(speed=0.5)
    assert times == [it.now]


def test_the_audit_has_a_frame_as_it_was_made_also_where_it_carries_a_number() -> None:
    it = Scene()
    ticked: list[object] = []
    audited: list[object] = []
    frame = CountedFrame(Numbered(b"7 left", Count({}, {"n": 7})), lambda: None)
    it.frames.motion_frame = lambda *_: frame  # type: ignore[method-assign,misc,assignment]
    it.backend.tick = lambda *what: ticked.append(what)  # type: ignore[method-assign,misc,assignment]
    it.controller.on_moved = lambda *what: audited.append(what[4])
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""
    assert ticked == [("drive", frame)]
    assert audited == [b"7 left"]


def test_stops_that_are_enough_for_now_are_not_made_anew() -> None:
    it = Scene()
    it.frames.number = 10
    it.frames.has_stops = lambda command: True  # type: ignore[method-assign]
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.tick(speed=0.6)
    it.frames.send()
    assert it.heard() == ["arm drive", "11 drive speed=0.5", "12 drive speed=0.6"]


def test_who_loses_the_right_to_drive_loses_the_lease_and_the_motion() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.controller.change(Operator("ann", "ann", "watch"))
    assert it.controller.lease.state.holder is None
    assert it.heard() != []
    assert it.tick(speed=0.5) != ""


def test_rights_that_still_allow_driving_end_no_motion() -> None:
    """Neither do the lost rights of another page, nor those of an unknown one."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    for client in (
        Operator("ann", "ann", "maintain"),
        Operator("bob", "bob", "watch"),
        Operator("zoe", "zoe", "watch"),
    ):
        it.controller.change(client)
    holder = it.controller.lease.state.holder
    assert holder is not None
    assert holder.id == "ann"
    assert it.heard() == []
    assert it.tick(speed=0.5) == ""
