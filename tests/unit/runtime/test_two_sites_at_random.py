"""Two sites, two operators, one robot: whatever the network does, the robot's site is in charge.

In every state: never two drivers without a stop in between, motion only within the lease of the
last tick and only at the speed that its age permits, STOP latched until a reset that knows it, and
no gesture that goes on after a stop, a partition or a restart. `World` makes these checks.
"""

from random import Random
from typing import Any, get_args

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from tests.effort import examples
from tests.unit.runtime.two_sites import FATES, Fate, Weather, World

STEPS = 600
WHO = ("near", "far")
DEEDS = ("grasp", "grasp", "let_go", "take", "ask", "yes", "no", "leave", "stop", "reset", "reset")
REPLAYED = ("tick", "release", "reset")
NETWORK = ("cut", "heal", "heal", "restart")
DELAYS = (0.0, 0.02, 0.1, 0.2, 0.35, 0.6)


class Machine(RuleBasedStateMachine):
    """Steps of operators and of the network, which can be made fewer until a fault is plain."""

    def __init__(self) -> None:
        super().__init__()
        self.world = World()

    @rule(who=st.sampled_from(WHO), deed=st.sampled_from(DEEDS))
    def operator(self, who: str, deed: str) -> None:
        do(self.world, who, deed)

    @rule(deed=st.sampled_from(NETWORK))
    def network(self, deed: str) -> None:
        getattr(self.world, deed)()

    @rule(
        up_s=st.sampled_from(DELAYS),
        down_s=st.sampled_from(DELAYS),
        fates=st.lists(st.sampled_from(FATES), min_size=1, max_size=5),
    )
    def weather(self, up_s: float, down_s: float, fates: list[Fate]) -> None:
        self.world.weather = Weather(up_s, down_s, tuple(fates))

    @rule(who=st.sampled_from(WHO), kind=st.sampled_from(REPLAYED), place=st.integers(0, 1000))
    def replay(self, who: str, kind: str, place: int) -> None:
        self.world.replay(who, kind, place)

    @rule(seconds=st.sampled_from((0.01, 0.1, 0.3, 1.0, 3.0)))
    def wait(self, seconds: float) -> None:
        self.world.wait(seconds)


TestMachine = Machine.TestCase
TestMachine.settings = settings(max_examples=examples(60), stateful_step_count=40, deadline=None)


def do(world: World, who: str, deed: str) -> None:
    """Let an operator do something."""
    own: Any = getattr(world, deed, None)
    if own is not None:
        own(who)
    else:
        world.say(who, deed)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_long_drive_in_bad_weather_keeps_all_promises(seed: int) -> None:
    """Both operators drive often, so that the checks are not made of a robot that stands."""
    dice, world = Random(seed), World()  # noqa: S311 - the same steps in every run
    for _ in range(STEPS):
        match dice.randrange(10):
            case 0:
                getattr(world, dice.choice(NETWORK))()
            case 1:
                fates = tuple(dice.choices(get_args(Fate), (12, 1, 1, 1), k=dice.randrange(1, 9)))
                up_s, down_s = dice.choices(DELAYS, (6, 6, 4, 3, 2, 1), k=2)
                world.weather = Weather(up_s, down_s, fates)
            case 2:
                world.replay(dice.choice(WHO), dice.choice(REPLAYED), dice.randrange(1000))
            case 3 | 4 | 5:
                do(world, dice.choice(WHO), dice.choice(DEEDS))
            case _:
                drive(world, dice)
        world.wait(dice.choice((0.01, 0.1, 0.4)))
    assert min(world.moved.values()) > 40, f"somebody hardly moved: {world.moved}"


def drive(world: World, dice: Random) -> None:
    """Let one operator begin anew: STOP is reset, the other leaves, and a stick is held."""
    who, other = dice.sample(WHO, 2)
    for one in WHO:
        world.let_go(one)
        world.reset(one)
    world.say(other, "leave")
    world.wait(0.3)
    world.grasp(who)
    world.wait(0.5)
