"""Measure the ages of the values shown on a page, for `browser_peers`."""

import asyncio
import json
from collections.abc import Sequence

from bench.browser_page import Opened
from bench.peers.robot import MODULUS, START

__all__ = ["LEAST_SHARE", "TooFew", "ages"]

LEAST_SHARE = 0.5
"""Minimum share of the robot's values that the page must show for a valid measurement."""
FIRST_S = 20.0
MODULUS_MS = MODULUS / 10
# The text in a frame's layout counts, because a page that writes outside frames may change it
# before it is read. A resize observer runs after a frame's callbacks and before drawing. Its
# message arrives after drawing; then the age is measured.
WATCH = """
async (seconds) => {
  const isClock = (text) => /^[0-9]{10}$/.test(text);
  const search = () => {
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) {
      const { data, parentElement } = walker.currentNode;
      if (isClock(data.trim())) return parentElement;
    }
    return null;
  };
  const found = [];
  let last = "", place = null, untilMs = Infinity, laidOut = "";
  const read = () => {
    if (!place?.isConnected) place = search();
    return place?.textContent.trim() ?? "";
  };
  const look = (text) => {
    const now = performance.now();
    if (text === last || !isClock(text)) return;
    if (!last) untilMs = now + seconds * 1000;
    else found.push([now, Number(text)]);
    last = text;
  };
  const startMs = performance.now();
  const channel = new MessageChannel();
  channel.port1.onmessage = () => look(laidOut);
  const probe = document.body.appendChild(document.createElement("div"));
  probe.style.cssText = "position: fixed; width: 1px; height: 1px; visibility: hidden";
  const sizes = new ResizeObserver(() => {
    laidOut = read();
    channel.port2.postMessage(0);
  });
  sizes.observe(probe);
  await new Promise((done) => {
    const frame = () => {
      const now = performance.now();
      probe.style.width = probe.style.width === "1px" ? "2px" : "1px";
      if (now > untilMs || (!last && now - startMs > 20000)) done();
      else requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  });
  sizes.disconnect();
  probe.remove();
  channel.port1.close();
  return { found, said: document.body.innerText.slice(0, 200) };
}
"""


class TooFew(Exception):
    """A failed measurement: the page showed too few of the robot's values."""


async def ages(one: Opened, seconds: float, rate_hz: float) -> list[float]:
    """Return the ages of the values shown on a page during `seconds`, in milliseconds.

    Args:
        one: the page.
        seconds: duration of the measurement, starting with the first value.
        rate_hz: number of times per second that the robot sends its clock's time.

    Raises:
        TooFew: the page showed fewer values than `LEAST_SHARE` requires.
    """
    try:
        async with asyncio.timeout(FIRST_S + seconds * 4):
            answer = await one.page.evaluate(WATCH, seconds)
    except TimeoutError as error:
        raise TooFew("the page stopped drawing frames") from error
    found: Sequence[tuple[float, float]] = answer["found"]
    if len(found) < LEAST_SHARE * seconds * rate_hz:
        said = json.dumps(answer["said"])
        raise TooFew(
            f"{len(found)} of {seconds * rate_hz:.0f} values were shown; text on the page: {said}"
        )
    return [_age_ms(one.origin_ms + now_ms, (clock - START) / 10) for now_ms, clock in found]


def _age_ms(now_ms: float, told_ms: float) -> float:
    """Return the age of a value in milliseconds; the timestamps restart at 0 after `MODULUS_MS`."""
    return (now_ms - told_ms + MODULUS_MS / 2) % MODULUS_MS - MODULUS_MS / 2
