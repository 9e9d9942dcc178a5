"""The desk goes the way of a tick, and nothing has changed."""

from tests.unit.runtime.desks import DRIVER, Scene, held
from urc.motion.fresh import Input
from urc.runtime.motion import LET_GO


def rehearse(it: Scene, number: int, who: str = "ann", command: str = "drive") -> list[str]:
    """Rehearse the tick with this number; return what the movers were told."""
    given = Input(it.desk.lease.state.epoch, number, it.desk.beat(who, it.now))
    it.desk.tick(who, command, {"speed": 0.5}, given, it.now, counts=False)
    return it.heard()


def test_the_next_tick_is_rehearsed_as_often_as_one_likes() -> None:
    """It is taken afterwards as if nothing had been."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    audited: list[object] = []
    it.desk.on_moved = lambda *words: audited.append(words)
    assert rehearse(it, 2) + rehearse(it, 2) == ["rehearse drive speed=0.5"] * 2
    assert audited == []
    assert it.tick(speed=0.6) == ""
    assert it.heard() == ["drive speed=0.6"]


def test_what_would_not_be_taken_is_not_rehearsed() -> None:
    """Neither an old number, nor somebody else, nor a control that does not move."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    assert rehearse(it, 1) == []
    assert rehearse(it, 2, who="bob") == []
    assert rehearse(it, 2, command="lift") == []
    assert rehearse(it, 2, command="beep") == []
    assert it.tick(command="lift") == "", "it begins with a real one"


def test_nothing_is_rehearsed_once_it_was_let_go() -> None:
    """Nor when it stopped by itself, or nobody is connected."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.desk.release("ann", "drive")
    it.heard()
    assert rehearse(it, 2) == []
    it.tick(speed=0.5)
    it.desk.stopped("drive", "expired")
    it.heard()
    assert rehearse(it, 3) == []
    assert it.tick(speed=0.5) == LET_GO
    it.desk.detach()
    assert rehearse(it, 4) == []


def test_a_frame_that_is_refused_is_not_rehearsed() -> None:
    """The tick itself will say why; the gesture goes on."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.frames.refusal = "the robot is silent"
    assert rehearse(it, 2) == []
    it.frames.refusal = ""
    assert it.tick(speed=0.6) == ""


def test_a_rehearsal_says_what_the_tick_would() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    given = Input(it.desk.lease.state.epoch, 2, it.desk.beat("ann", it.now))
    assert it.desk.tick("ann", "drive", {"speed": 0.5}, given, it.now, counts=False) == ""


def test_a_frame_that_waits_for_an_answer_is_not_rehearsed() -> None:
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    it.frames.motion_frame = lambda *_: b""  # type: ignore[method-assign,misc,assignment]
    assert rehearse(it, 2) == []


def test_a_rehearsal_does_not_slow_the_motion_down() -> None:
    """Its value is none that the robot was given: speed goes on growing from where it is."""
    slow = held("drive")
    assert slow.hold is not None
    slow = slow._replace(hold=slow.hold._replace(slew={"speed": 2.0}))
    it = Scene(driver=DRIVER._replace(commands={"drive": slow}))
    it.drive("ann", "take")
    it.tick(speed=1.0)
    it.now += 0.05
    given = Input(it.desk.lease.state.epoch, 2, it.desk.beat("ann", it.now))
    it.desk.tick("ann", "drive", {"speed": 0.0}, given, it.now, counts=False)
    it.heard()
    moved: list[float] = []
    it.desk.on_moved = lambda *what: moved.append(what[3]["speed"])  # type: ignore[arg-type]
    it.tick(speed=1.0)
    assert [round(speed, 3) for speed in moved] == [0.3]
