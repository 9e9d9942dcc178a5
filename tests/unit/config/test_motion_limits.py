"""A robot may allow less motion than its driver does; the server holds to it."""

from pathlib import Path

import pytest

from tests.unit.config.folder import WIRE, Folder, head
from urc.model.exchange import Sight
from urc.protocol.engine import Engine
from urc.protocol.requests.encode import BadArgument

DRIVER = (
    head("driver", "cart")
    + WIRE
    + """\
commands:
  drive:
    send: "V {{ v }}"
    args: { v: { type: number, min: -1, max: 1 } }
    hold: { repeat: 50ms, release: { v: 0 }, watchdog: none, slew: { v: 2 }, on_stall: wait }
"""
)
ROBOT = (
    head("robot", "small-cart")
    + """\
driver:
  use: cart.yaml
  overrides:
    commands: { drive: { args: { v: { min: -0.2, max: 0.2 } }, hold: { slew: { v: 0.5 } } } }
"""
)


def test_a_robot_holds_to_a_smaller_range_and_a_slower_growth(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.write(cart=DRIVER, small_cart=ROBOT)
    profile = folder.check("small_cart").profile
    assert profile is not None, [one.message for one in folder.found("small_cart")]
    hold = profile.driver.commands["drive"].hold
    assert hold is not None
    assert (dict(hold.slew), hold.on_stall) == ({"v": 0.5}, "wait")
    engine = Engine(profile.driver, {})
    engine.start("wire", 0.0)
    assert engine.motions.motion_frame("drive", {"v": -0.2}, 0.0) == b"V -0.2\n"
    for value in (0.21, -1, 1):
        with pytest.raises(BadArgument, match="v:"):
            engine.motions.motion_frame("drive", {"v": value}, 0.0)


SEEING = """\
signals: { front: { type: image } }
messages: { front: { regex: '^IMAGE (?P<front>.+)$' } }
"""


def test_a_robot_names_the_image_that_its_operator_must_see(tmp_path: Path) -> None:
    """A driver for many robots does not know their cameras."""
    folder = Folder(tmp_path)
    more = "hold: { sees: front, slow_after: 300ms, stop_after: 700ms }"
    robot = ROBOT.replace("hold: { slew: { v: 0.5 } }", more)
    folder.write(cart=DRIVER + SEEING, small_cart=robot)
    profile = folder.check("small_cart").profile
    assert profile is not None, [one.message for one in folder.found("small_cart")]
    hold = profile.driver.commands["drive"].hold
    assert hold is not None
    assert hold.sight == Sight("front", 0.7, 0.3)


def test_a_document_without_sees_has_no_image_to_drive_by(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.write(cart=DRIVER, small_cart=ROBOT)
    profile = folder.check("small_cart").profile
    assert profile is not None
    hold = profile.driver.commands["drive"].hold
    assert hold is not None
    assert hold.sight is None
