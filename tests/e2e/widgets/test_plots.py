"""Lines of a plot, by the pixels of its picture."""

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.drawn import PIXELS_OF
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

IS_DRAWN = f"""
([place, isWanted]) => {{
  const swatch = document.querySelectorAll(".plot-swatch")[place];
  const colour = getComputedStyle(swatch).borderTopColor.match(/\\d+/g).join();
  const isThere = [...document.querySelectorAll(".plot-strip")].some((canvas) => {{
    const {{ data }} = ({PIXELS_OF})(canvas);
    for (let at = 0; at < data.length; at += 4) {{
      if (data[at + 3] === 255 && data.slice(at, at + 3).join() === colour) return true;
    }}
    return false;
  }});
  return isThere === isWanted;
}}
"""
"""Whether the picture has, or has not, a line in the colour of an entry of the legend."""


async def test_a_line_that_is_hidden_leaves_the_picture_and_comes_back_whole(
    new_page: PageMaker,
) -> None:
    """Also one between the others, which leaves the scale as it is."""
    names = ("low", "middle", "high")
    signals = {name: Signal(name, unit="A", stale_after_s=60) for name in names}
    bound = WidgetUse("plot", "plot", options={"window": "10s"}, lists={"series": names})
    robot = FakeRobot(dashboard_profile(signals=signals, uses=[bound]))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for step in range(6):
            for level, name in enumerate(names):
                robot.set_reading(name, level * 5 + step % 2, age_s=(6 - step) / 5)
            value = f"{10 + step % 2} A"
            await page.locator("li:last-child .plot-value", has_text=value).wait_for()
        await page.wait_for_function(IS_DRAWN, arg=[1, True])
        await page.click(".plot-entry >> nth=1")
        await page.wait_for_function(IS_DRAWN, arg=[1, False])
        assert await page.evaluate(IS_DRAWN, [0, True])
        await page.click(".plot-entry >> nth=1")
        await page.wait_for_function(IS_DRAWN, arg=[1, True])
