"""How often a held command is sent."""

from typing import Any

import pytest

from tests.unit.runtime.desks import held
from urc.model.driver import Driver, TransportSpec
from urc.motion.stall import STALLED_S
from urc.runtime.held_commands import control_of, period_of


@pytest.mark.parametrize(
    ("line", "command", "period_s"),
    [
        ({}, {}, 0.05),
        ({"min_gap_s": 0.2}, {}, 0.2),
        ({"min_gap_s": 0.02}, {}, 0.05),
        ({"min_gap_s": 0.2}, {"priority": "realtime"}, 0.05),
        ({}, {"rate_per_s": 5.0}, 0.2),
        ({"min_gap_s": 0.2}, {"rate_per_s": 2.5, "priority": "realtime"}, 0.4),
    ],
)
def test_motion_goes_no_faster_than_its_line_and_its_rate_let_it(
    line: dict[str, Any], command: dict[str, Any], period_s: float
) -> None:
    """For robots that cannot read fast; what is realtime waits for no gap."""
    driver = Driver({"wire": TransportSpec("wire", "tcp")._replace(**line)})
    assert control_of(driver, held("drive")._replace(**command)).period_s == period_s


def test_command_that_is_not_held_has_a_shortest_time_too() -> None:
    driver = Driver({"wire": TransportSpec("wire", "tcp")})
    assert period_of(driver, held("beep")._replace(hold=None)) == STALLED_S


def test_limited_argument_without_a_value_begins_at_its_default() -> None:
    driver = Driver({"wire": TransportSpec("wire", "tcp")})
    drive = held("drive")
    assert drive.hold is not None
    drive = drive._replace(hold=drive.hold._replace(slew={"speed": 1.0}))
    assert control_of(driver, drive).defaults == {"speed": 0.0}
