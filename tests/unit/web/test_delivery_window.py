"""The window of a page's line, on lines that are simulated: busy, and hardly anything waits."""

from collections import deque
from collections.abc import Callable
from random import Random

import pytest

from urc.web.feed.delivery_window import LEAST_PART, LEAST_WINDOW, QUEUE_S, DeliveryWindow


class Line:
    """A line with a rate and a delay, and a page that confirms."""

    def __init__(self, rate: float, trip_s: float, jitter_s: float = 0.0) -> None:
        self.rate, self.trip_s, self.jitter_s = rate, trip_s, jitter_s
        """Bytes a second, and the shortest time until a confirmation."""
        self.now_s = 0.0
        self.window = DeliveryWindow(0.0)
        self.sent_bytes = 0
        self.stands_s, self.every_s = 0.0, 1.0
        """For how long the page confirms nothing, and how often."""
        self.waits: list[float] = []
        """Time that each part has waited for the line, in seconds."""
        self._free_s = 0.0
        self._coming: deque[tuple[float, int]] = deque()
        self._random = Random(3)  # noqa: S311 - a network, no secret

    def busy_until(self, end_s: float, has_data: Callable[[float], bool] = lambda _: True) -> None:
        """Send as much as the window permits, until a time."""
        while self.now_s < end_s:
            while has_data(self.now_s) and self.window.allows(self.window.part_bytes):
                self._send(self.window.part_bytes)
            at_s = self.now_s + 0.001
            if self._coming and self._coming[0][0] <= at_s:
                at_s, total = self._coming.popleft()
                self.now_s = max(self.now_s, at_s)
                assert self.window.confirmed(total, self.now_s)
            else:
                self.now_s = at_s

    def _send(self, size: int) -> None:
        is_asked = self.window.sends(size, self.now_s)
        self.waits.append(max(0.0, self._free_s - self.now_s))
        self._free_s = max(self.now_s, self._free_s) + size / self.rate
        self.sent_bytes += size
        if is_asked:
            last_s = self._coming[-1][0] if self._coming else 0.0
            came_s = self._free_s + self.trip_s + self._random.uniform(0.0, self.jitter_s)
            came_s += max(0.0, self.stands_s - came_s % self.every_s)
            self._coming.append((max(last_s, came_s), self.sent_bytes))


@pytest.mark.parametrize("trip_s", [0.01, 0.04, 0.15])
@pytest.mark.parametrize("rate", [62_500, 125_000, 1_250_000])
def test_a_busy_line_is_used_and_hardly_anything_waits(rate: float, trip_s: float) -> None:
    """From 0.5 to 10 Mbit/s."""
    line = Line(rate, trip_s)
    line.busy_until(10.0)
    before, line.waits = line.sent_bytes, []
    line.busy_until(20.0)
    assert (line.sent_bytes - before) / (10 * rate) > 0.75
    part_s, permitted_s = line.window.part_bytes / rate, max(QUEUE_S, trip_s / 4)
    assert sorted(line.waits)[len(line.waits) * 99 // 100] <= permitted_s + 2 * part_s
    assert line.window.rate == pytest.approx(rate, rel=0.25)


def test_a_line_that_becomes_slow_is_noticed_within_a_few_confirmations() -> None:
    line = Line(1_250_000, 0.02)
    line.busy_until(5.0)
    line.rate, line.waits = 62_500, []
    line.busy_until(8.0)
    line.waits = []
    line.busy_until(12.0)
    assert max(line.waits) < 0.1


def test_a_line_that_becomes_fast_is_used_again() -> None:
    line = Line(62_500, 0.02)
    line.busy_until(5.0)
    line.rate = 1_250_000
    line.busy_until(15.0)
    before = line.sent_bytes
    line.busy_until(20.0)
    assert (line.sent_bytes - before) / 5 > 600_000


def test_single_late_confirmations_do_not_shrink_the_window() -> None:
    """As on wireless lines."""
    line = Line(1_250_000, 0.02, jitter_s=0.02)
    line.busy_until(20.0)
    assert line.sent_bytes / 20 > 500_000


def test_a_page_that_is_busy_again_and_again_keeps_its_window() -> None:
    """A tablet with other work confirms late. Its line is fast, and a keyframe fits into it."""
    line = Line(12_500_000, 0.001)
    line.stands_s, line.every_s = 0.06, 0.15
    line.busy_until(20.0, lambda now_s: line.sent_bytes < 750_000 * now_s)
    assert line.window.size > 40_000


def test_data_without_a_confirmation_never_block_the_line() -> None:
    """The window may shrink below what no confirmation covers."""
    window = DeliveryWindow(0.0)
    window.size = 100_000.0
    asked = 0
    while not asked:
        asked = window.sends(LEAST_PART, 0.0) * window.sent_bytes
    window.sends(LEAST_PART, 0.0)
    window.sends(LEAST_PART, 0.0)
    assert window.confirmed(asked, 0.01)
    window.size = float(LEAST_WINDOW)
    assert window.allows(LEAST_PART)
    assert window.sends(LEAST_PART, 0.02), "the page must confirm it"


@pytest.mark.parametrize("total", [0, 1, LEAST_PART, 10**9])
def test_a_confirmation_of_other_bytes_is_refused(total: int) -> None:
    window = DeliveryWindow(0.0)
    while not window.sends(2 * LEAST_PART, 0.0):
        pass
    assert not window.confirmed(total, 0.1)
    assert window.confirmed(window.sent_bytes, 0.1)
    assert not window.confirmed(window.sent_bytes, 0.1)
