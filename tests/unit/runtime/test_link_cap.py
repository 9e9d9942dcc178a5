"""A robot of another site moves more slowly on a slow link, and never by an old tick."""

import pytest

from tests.unit.runtime.desks import DRIVER, Scene
from tests.unit.runtime.test_image_interlock import SEEING
from urc.model.driver import Driver
from urc.motion.freshness import ControlInput
from urc.motion.lease import Operator
from urc.runtime.motion_controller import LET_GO
from urc.runtime.motion_screen import SLOW_LINK

FAR = Operator("far", "far", "drive", way="site")


class FarScene(Scene):
    """A desk with one more driver, at another site."""

    def __init__(self, driver: Driver = DRIVER) -> None:
        super().__init__(driver=driver)
        self.controller.join(FAR)
        self.drive("far", "take")
        self.numbers = 0
        self.arrive(0.0, sees=0.0, speed=0.0)
        self.heard()

    def arrive(self, round_trip_s: float, *, sees: float | None = None, speed: float = 0.8) -> str:
        """Let a tick arrive whose heartbeat is `round_trip_s` old."""
        self.numbers += 1
        self.now += 1.0
        echo = self.controller.heartbeat("far", self.now)
        self.now += round_trip_s
        given = ControlInput(self.controller.lease.state.epoch, self.numbers, echo)
        seen = () if sees is None else (sees,)
        return self.controller.tick("far", "drive", {"speed": speed}, given, self.now, *seen)


def moved(it: Scene) -> tuple[float, float]:
    """Return the speed of the last tick, and the longest time for which it moves the robot."""
    speed, _, for_s = it.heard()[-1].removeprefix("drive speed=").partition(" for ")
    return float(speed), float(for_s.removesuffix(" s"))


@pytest.mark.parametrize(
    ("age_s", "speed", "for_s"), [(0.15, 0.8, 0.35), (0.325, 0.4, 0.175), (0.465, 0.08, 0.035)]
)
def test_the_age_caps_the_speed_and_the_lease(age_s: float, speed: float, for_s: float) -> None:
    """A tick moves the robot until it is 500 ms old, at the latest."""
    it = FarScene()
    assert it.arrive(age_s) == ""
    assert moved(it) == pytest.approx((speed, for_s), abs=0.006)


def test_a_tick_that_is_too_old_moves_nothing() -> None:
    it = FarScene()
    assert it.arrive(0.5) == "Link too slow: your input arrived 500 ms late"
    assert it.heard() == []


def test_a_page_of_this_site_is_not_slowed() -> None:
    """Nothing changes for it, neither the speed nor the calls to the guard."""
    it = Scene()
    it.drive("ann", "take")
    echo = it.controller.heartbeat("ann", it.now)
    it.heard()
    given = ControlInput(it.controller.lease.state.epoch, 1, echo)
    assert it.controller.tick("ann", "drive", {"speed": 0.8}, given, it.now + 0.39) == ""
    assert it.heard() == ["arm drive", "drive speed=0.8"]
    assert it.controller.link("ann", it.now + 0.39) is None


def test_the_end_of_a_shortened_lease_is_explained_by_the_link() -> None:
    it = FarScene()
    it.arrive(0.3)
    it.controller.stopped("drive", "expired")
    assert it.controller.why_short("drive") == SLOW_LINK
    assert it.arrive(0.0) == SLOW_LINK


def test_the_end_of_a_whole_lease_is_not() -> None:
    it = FarScene()
    it.arrive(0.1)
    it.controller.stopped("drive", "expired")
    assert it.controller.why_short("drive") == ""
    assert it.arrive(0.0) == LET_GO


def test_of_an_old_image_and_a_slow_link_the_lower_limit_counts() -> None:
    """`sees` is full until 0.25 s and ends at 0.75 s."""
    it = FarScene(driver=SEEING)
    it.arrive(0.325, sees=0.3)
    assert moved(it) == pytest.approx((0.4, 0.175), abs=0.006)
    it.arrive(0.15, sees=0.5)
    assert moved(it) == pytest.approx((0.4, 0.25), abs=0.006)
    it.arrive(0.325, sees=0.7)
    assert moved(it) == pytest.approx((0.08, 0.05), abs=0.006)


def test_an_override_of_the_image_does_not_override_the_link() -> None:
    it = FarScene(driver=SEEING)
    it.drive("far", "override", for_s=20)
    it.controller.release("far", "drive")
    it.drive("far", "take")
    it.heard()
    it.arrive(0.325)
    assert moved(it) == pytest.approx((0.4, 0.175), abs=0.006)


def test_a_handover_to_a_page_of_this_site_lifts_the_cap() -> None:
    it = FarScene()
    it.arrive(0.3)
    it.drive("far", "leave")
    it.drive("ann", "take")
    it.heard()
    assert it.tick(speed=0.8) == ""
    assert it.heard()[-1] == "drive speed=0.8"
    it.controller.stopped("drive", "expired")
    assert it.controller.why_short("drive") == ""


def test_the_page_learns_the_age_of_its_tick_and_the_permitted_speed() -> None:
    it = FarScene()
    it.arrive(0.325)
    state = it.controller.link("far", it.now)
    assert state is not None
    assert state == pytest.approx((0.325, 0.5))
