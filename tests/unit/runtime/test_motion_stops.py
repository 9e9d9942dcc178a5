"""Which stop frames the desk hands on, where they carry numbers."""

from collections.abc import Mapping

from tests.unit.runtime.desks import DRIVER, Movers, Scene, held
from urc.model.payload import Payload
from urc.model.values import Reading
from urc.problems import UrcError
from urc.protocol.events import MotionReady, MotionRefused
from urc.testing.movers import FakeSession


def test_stop_of_the_second_control_of_a_robot_is_made_anew_as_well() -> None:
    """The first one is of another line, or does not move."""
    for line in ("air", "wire"):
        commands = {"drive": held("drive"), "lift": held("lift", line)}
        it = Scene(driver=DRIVER._replace(commands=commands))
        it.frames.number = 10
        it.drive("ann", "take")
        assert it.tick(command="lift") == ""
        it.heard()
        assert it.frames.send(line) == 12
        assert it.heard() == ["stop is 13 lift stop"]


def test_stop_that_may_still_be_repeated_is_made_anew() -> None:
    """Its control is not armed any more, and that of the other one never was."""
    it = Scene()
    it.backend.is_stopping = lambda command: command == "drive"  # type: ignore[method-assign]
    it.frames.number = 10
    it.frames.send()
    assert it.heard() == ["stop is 12 drive stop"]


def test_newest_stop_goes_out_when_none_can_be_made_any_more() -> None:
    it = Scene()
    it.frames.number = 10
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.tick(speed=0.6)
    it.frames.send()
    assert it.heard()[-1] == "stop is 14 drive stop"
    stops: dict[str, Payload] = {}

    def keep(frames: Mapping[str, Payload]) -> None:
        stops.update(frames)

    def broken(command: str) -> Payload:
        raise UrcError("no such setting")

    it.backend.stop = keep  # type: ignore[method-assign]
    it.frames.stop_frame = broken  # type: ignore[method-assign]
    it.controller.stop("ann")
    assert stops == {"drive": b"14 drive stop"}


def test_frame_of_a_robot_without_movers_renews_no_stop() -> None:
    it = Scene(is_attached=False)
    it.controller.attach(FakeSession(it.frames, None))
    assert it.frames.send() == 1
    assert it.heard() == []


def test_stop_is_made_once_for_a_tick_after_all_its_numbers() -> None:
    it = Scene()
    it.frames.number = 10
    whole = it.frames.motion_frame

    def double(command: str, arguments: Mapping[str, Reading], now: float) -> Payload:
        it.frames.number += 1
        return whole(command, arguments, now)

    it.frames.motion_frame = double  # type: ignore[method-assign]
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.tick(speed=0.6)
    assert it.heard() == ["stop is 15 drive stop", "14 drive speed=0.6"]


def test_stopped_control_rests() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    assert not it.controller.rests("drive")
    it.controller.stop("vic")
    assert it.controller.rests("drive")


def test_refusal_ends_the_motion_also_without_a_listener() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.controller.handle(MotionRefused("wire", "drive", "too steep"))
    assert it.heard() == ["release drive"]


def test_stop_that_is_lost_with_the_line_is_no_longer_confirmed() -> None:
    """It was written, and the reset of the line discarded it."""
    it = Scene()
    kept: list[tuple[object, bool]] = []
    it.controller.stop("ann")
    it.controller.stopped("drive", "stopped")
    it.controller.stopped("lift", "stopped")
    it.controller.on_change = lambda state: kept.append((state, it.controller.is_confirmed))
    latched = it.controller.lease.state
    assert it.controller.is_confirmed
    it.controller.stopped("drive", "lost")
    assert not it.controller.is_confirmed
    assert it.controller.is_stop_due
    it.controller.stopped("drive", "revoked")
    assert it.controller.is_confirmed
    assert kept == [(latched, False), (latched, True)]


def test_stop_of_a_released_control_that_is_lost_is_due_but_no_stop_of_an_operator() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.controller.stopped("drive", "released")
    assert it.controller.rests("drive")
    it.controller.stopped("drive", "lost")
    assert it.controller.is_confirmed, "no STOP was pressed"
    assert not it.controller.rests("drive")
    it.controller.stopped("drive", "revoked")
    assert it.controller.rests("drive")


def test_control_whose_lost_stop_is_written_by_another_release_rests() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.controller.stopped("drive", "released")
    it.controller.stopped("drive", "lost")
    it.controller.stopped("drive", "released")
    assert it.controller.rests("drive")


def test_stop_that_a_session_could_not_deliver_is_the_first_of_the_next_session() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.backend.owing = {"drive"}
    assert it.controller.is_stop_due
    it.heard()
    it.controller.detach()
    assert it.controller.is_stop_due
    next_backend = Movers()
    it.controller.attach(FakeSession(it.frames, next_backend))
    assert next_backend.told == ["stop drive"]
    assert not it.controller.is_stop_due, "the backend has it now"


def test_stop_that_needs_a_value_of_the_login_is_sent_after_the_login() -> None:
    """It could not be rendered when STOP was pressed, and no report about it will come."""
    it = Scene()
    stop_frame = it.frames.stop_frame

    def broken(command: str) -> Payload:
        raise UrcError("the login has not sent the session number yet")

    it.frames.stop_frame = broken  # type: ignore[method-assign]
    it.controller.stop("ann")
    it.heard()
    it.frames.stop_frame = stop_frame  # type: ignore[method-assign]
    it.controller.handle(MotionReady("wire"))
    assert it.heard() == ["stop drive"]


def test_control_that_its_line_has_disarmed_is_armed_again_by_the_next_gesture() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.controller.stopped("drive", "released")
    it.heard()
    it.backend.disarmed = {"drive"}
    assert it.tick(speed=0.5) == ""
    assert it.heard()[0] == "arm drive"


def test_held_control_that_its_line_has_disarmed_is_not_armed_again() -> None:
    """Its stop may not be reported yet, and nothing goes on by itself."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.backend.disarmed = {"drive"}
    it.tick(speed=0.5)
    assert "arm drive" not in it.heard()
    it.controller.release("ann", "drive")
    it.heard()
    it.tick(speed=0.5)
    assert "arm drive" not in it.heard(), "the stop of the release is not reported yet"


def test_stop_that_the_ending_session_delivers_itself_is_not_sent_again() -> None:
    it = Scene()
    it.backend.owing = {"drive"}
    it.controller.detach()
    it.backend.owing = set()
    assert not it.controller.is_stop_due
    next_backend = Movers()
    it.controller.attach(FakeSession(it.frames, next_backend))
    assert next_backend.told == []


def test_stop_that_is_due_stays_so_with_another_version_of_the_driver() -> None:
    it, other = Scene(), Scene(is_attached=False)
    it.backend.owing = {"drive"}
    it.controller.detach()
    other.controller.inherit(it.controller.due)
    assert other.controller.is_stop_due


def test_stop_that_was_sent_before_the_login_is_due_in_the_next_session() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller._controls["drive"].needs_ready_line = True
    it.frames.is_greeted = False
    it.controller.stopped("drive", "revoked")
    assert it.controller.is_stop_due
    it.controller.detach()
    assert it.controller.due == ["drive"]


def test_stop_that_a_session_could_not_render_is_due_in_the_one_after_it() -> None:
    it = Scene()
    it.backend.owing = {"drive"}
    it.controller.detach()

    def broken(command: str) -> Payload:
        raise UrcError("the login has not sent the session number yet")

    it.frames.stop_frame = broken  # type: ignore[method-assign]
    for _ in range(2):
        it.controller.attach(FakeSession(it.frames, Movers()))
        it.controller.detach()
        assert it.controller.due == ["drive"]


def test_stop_that_an_ending_session_loses_is_due() -> None:
    """Its line was reset after the last report."""
    it = Scene()
    it.controller.detach()
    assert it.controller.due == []
    it.backend.owing = {"drive"}
    assert it.controller.due == ["drive"]
