"""The limit on failed attempts."""

from urc.access.throttle import FORGET_S, FREE, LONGEST_S, MOST, Throttle


def test_after_some_failures_each_one_doubles_the_wait() -> None:
    throttle = Throttle()
    waits = []
    now = 0.0
    for _ in range(FREE + 8):
        throttle.failed(now, "10.0.0.7")
        waits.append(throttle.wait_s(now, "10.0.0.7"))
        now += waits[-1]
    assert waits == [0.0] * (FREE - 1) + [1.0, 2.0, 4.0, 8.0, 16.0] + [LONGEST_S] * 4
    assert throttle.wait_s(now, "10.0.0.8") == 0, "others are not slowed"
    assert throttle.wait_s(now + FORGET_S, "10.0.0.7") == 0


def test_the_longest_wait_of_address_and_name_counts() -> None:
    throttle = Throttle()
    for number in range(FREE + 1):
        throttle.failed(0.0, f"10.0.0.{number}", "ann")
    assert throttle.wait_s(0.0, "10.0.0.99", "ann") == 2.0, "many addresses, one name"
    throttle.succeeded("ann")
    assert throttle.wait_s(0.0, "10.0.0.99", "ann") == 0
    assert throttle.wait_s(0.0) == 0


def test_failures_of_countless_addresses_take_bounded_memory() -> None:
    throttle = Throttle()
    for number in range(3 * MOST):
        throttle.failed(0.0, str(number))
    assert len(throttle._buckets) == MOST
