"""How often a held command is sent."""

from typing import Any

import pytest

from tests.unit.runtime.desks import held
from urc.model.driver import Driver, TransportSpec
from urc.runtime.held import control_of


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
