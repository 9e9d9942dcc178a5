"""Words of the server that the page compares: they are the same on both sides."""

from pathlib import Path

from urc.runtime.hub import NOTHING_YET

LOST_CARD = Path(__file__).parents[2] / "urc/web/static/live/lost_card.js"


def test_the_page_knows_an_open_connection_whose_robot_is_quiet() -> None:
    """Otherwise the page would wait for a robot that waits to be asked."""
    assert f'"{NOTHING_YET}"' in LOST_CARD.read_text("utf-8")
