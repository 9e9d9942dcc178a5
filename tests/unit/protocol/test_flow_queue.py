"""What may be sent, and when: priorities, newest-wins, rates, counters."""

import pytest

from tests.dialogue import Dialogue
from urc.protocol.requests.rate import Counters, GcraLimiter

MOVES = """
commands:
  move: { send: "MOVE {{ speed }}", args: { speed: {} }, coalesce: latest, rate_limit: 10/s }
  stop: { send: STOP, priority: realtime }
  first: { send: FIRST, priority: high, reply: { equals: OK } }
  plain: { send: PLAIN, reply: { equals: OK } }
  last: { send: LAST, priority: low, reply: { equals: OK } }
"""


def test_of_those_that_wait_the_one_of_higher_priority_goes_first() -> None:
    """Those of one priority go in the order they came."""
    talk = Dialogue(MOVES).connect()
    for command in ("plain", "last", "plain", "first"):
        talk.run(command)
    order = talk.sent
    for _ in range(3):
        talk.says("OK")
        order += talk.sent
    assert order == ["PLAIN", "FIRST", "PLAIN", "LAST"]


def test_what_is_real_time_waits_for_nothing() -> None:
    """Neither for an answer in flight, nor for the gap, nor for the queue."""
    talk = Dialogue("wire: min_gap: 1s\n" + MOVES).connect()
    talk.run("plain")
    talk.run("last")
    number = talk.run("stop")
    assert talk.sent == ["PLAIN", "STOP"]
    assert talk.outcomes[number] == "done"


def test_a_real_time_answer_is_told_from_the_one_that_is_waited_for() -> None:
    """As Grbl's `?` does while a line is at work: each has an order of its own."""
    talk = Dialogue(
        """
signals: { state: { type: string } }
commands:
  go: { send: G1, reply: { equals: ok } }
  status: { send: "?", priority: realtime, reply: { regex: '^<(?P<state>\\w+)>$' } }
"""
    ).connect()
    go, status = talk.run("go"), talk.run("status")
    talk.says("<Run>")
    assert (talk.outcomes, talk.values) == ({status: "done"}, {"state": "Run"})
    talk.says("ok")
    assert talk.outcomes[go] == "done"


def test_a_real_time_answer_is_no_line_of_a_longer_one() -> None:
    """A reply of several lines takes any frame, but not one that another request waits for."""
    talk = Dialogue(
        """
signals: { state: { type: string }, a: { type: integer }, b: { type: integer } }
commands:
  dump: { send: $$, reply: { regex: '^a=(?P<a>\\d)\\nb=(?P<b>\\d)', lines: { until: '^ok$' } } }
  status: { send: "?", priority: realtime, reply: { regex: '^<(?P<state>\\w+)>$' } }
"""
    ).connect()
    dump, status = talk.run("dump"), talk.run("status")
    talk.says("a=1", "<Run>", "b=2", "ok")
    assert talk.outcomes == {status: "done", dump: "done"}
    assert talk.values == {"state": "Run", "a": 1, "b": 2}


def test_a_late_answer_holds_up_nobody_who_waits_for_none() -> None:
    """What has no answer cannot be given the wrong one."""
    talk = Dialogue(
        """
commands:
  ask: { send: ASK, reply: { equals: OK } }
  tell: { send: TELL }
"""
    ).connect()
    talk.run("ask")
    talk.run("tell")
    talk.run("ask")
    assert talk.sent == ["ASK"]
    assert talk.at(0.5).sent == ["TELL"]
    assert talk.at(1.0).sent == ["ASK"]


def test_a_newer_setpoint_takes_the_place_of_one_that_waits() -> None:
    """Depth one for each command; the one that is replaced is told so."""
    talk = Dialogue(MOVES).connect()
    talk.run("plain")
    numbers = [talk.run("move", speed=speed) for speed in (1, 2, 3)]
    talk.says("OK")
    assert talk.sent == ["PLAIN", "MOVE 3"]
    assert [talk.outcomes[one] for one in numbers] == ["superseded", "superseded", "done"]


def test_a_rate_lets_two_go_at_once_and_keeps_its_average() -> None:
    """One period of tolerance: a shortest gap would waste what comes a moment too early."""
    talk = Dialogue(MOVES).connect()
    times = []
    for tick in range(100):
        talk.at(tick / 100)
        talk.run("move", speed=tick)
        times += [tick] * len(talk.sent)
    assert times[:3] == [0, 1, 10]
    assert len(times) == 11


def test_what_its_rate_holds_back_holds_up_nobody_else() -> None:
    """The next one in the queue goes."""
    talk = Dialogue(MOVES).connect()
    for speed in (1, 2, 3):
        talk.run("move", speed=speed)
    assert talk.sent == ["MOVE 1", "MOVE 2"]
    talk.run("plain")
    assert talk.sent == ["PLAIN"]
    talk.says("OK")
    assert talk.at(0.1).sent == ["MOVE 3"]


def test_a_full_queue_gives_way_to_what_is_more_urgent() -> None:
    """The last one of lower priority is pushed out, and told so."""
    talk = Dialogue("wire: queue: { depth: 2 }\n" + MOVES).connect()
    numbers = [talk.run(command) for command in ("plain", "last", "last", "first", "last")]
    assert [talk.outcomes.get(one) for one in numbers] == [
        None, None, "queue-full", None, "queue-full",
    ]  # fmt: skip


def test_counters_number_the_frames_that_are_sent() -> None:
    """From the lowest to the highest and round; each connection begins anew."""
    talk = Dialogue(
        """
commands:
  ask: { send: "{{ seq('id', 1, 3) }} {{ seq('id', 1, 3) }}", reply: { equals: OK } }
  put: { send: "{{ seq('other', 0, 9) }} {{ x }}", args: { x: {} }, coalesce: latest }
"""
    ).connect()
    order = []
    for _ in range(4):
        talk.run("ask")
        talk.run("put", x=1)
        talk.run("put", x=2)
        talk.says("OK")
        order += talk.sent
    assert order == ["1 1", "0 2", "2 2", "1 2", "3 3", "2 2", "1 1", "3 2"]
    talk.take(talk.engine.closed("wire", "", 1.0))
    talk.connect()
    talk.run("ask")
    assert talk.sent == ["1 1"]


@pytest.mark.parametrize(
    ("times", "gone"),
    [((0, 0, 0), 2), ((0, 0.9, 1.8, 2.7), 4), ((0, 0, 1, 1), 3), ((0, 0, 5, 5, 5), 4)],
)
def test_bucket_has_one_period_of_tolerance(times: tuple[float, ...], gone: int) -> None:
    """Of one a second, by the times at which somebody tries."""
    bucket, count = GcraLimiter(1.0), 0
    for now in times:
        if bucket.free_at <= now:
            bucket.count(now)
            count += 1
    assert count == gone


def test_a_draw_that_is_not_counted_does_not_advance() -> None:
    """A frame that cannot be made, or is only tried, takes no number."""
    counters = Counters()
    assert counters.draw()("id", 0, 9) == 0
    draw = counters.draw()
    assert (draw("id", 0, 9), draw("id", 0, 9)) == (0, 0)
    counters.count(draw)
    assert counters.draw()("id", 0, 9) == 1


STREAMED = """
wire: queue: { in_flight: 16, bytes: 20 }
commands:
  line:
    send: "{{ code }}"
    args: { code: { type: string } }
    reply: { equals: ok, errors: ['^error'] }
    idempotent: true
    retries: 1
  number: { send: "N{{ seq('n', 8, 99) }}", reply: { equals: ok } }
  hold: { send: "!!!!!!!!!!!!!!!!!!!!!", priority: realtime }
"""


def test_no_more_bytes_are_sent_than_the_robot_has_room_for() -> None:
    """All that waits for its answer counts, line ends included; what is real-time does not."""
    talk = Dialogue(STREAMED).connect()
    for code in ("G1 X100", "G1 X200", "M3", "M5", "G0"):
        talk.run("line", code=code)
    assert talk.sent == ["G1 X100", "G1 X200", "M3"]  # 8 + 8 + 3 = 19
    talk.run("hold")
    assert talk.sent == ["!" * 21]
    talk.says("ok")
    assert talk.sent == ["M5", "G0"]
    talk.says("error:1", "ok", "ok", "ok")
    assert [talk.outcomes[one] for one in (1, 2, 3, 4, 5)] == [
        "done",
        "refused",
        "done",
        "done",
        "done",
    ]


def test_a_short_line_does_not_pass_a_long_one() -> None:
    """The order of a program is its meaning."""
    talk = Dialogue(STREAMED).connect()
    for code in ("G1 X100 Y100 Z", "G1 X200", "M3"):
        talk.run("line", code=code)
    assert talk.sent == ["G1 X100 Y100 Z"]
    assert talk.at(0.4).sent == []
    talk.says("ok")
    assert talk.sent == ["G1 X200", "M3"]


def test_a_frame_that_is_longer_than_the_room_is_refused() -> None:
    """It would never fit, whatever else waits."""
    talk = Dialogue(STREAMED).connect()
    talk.run("line", code="G1 X100 Y100 Z100 F1")
    assert talk.outcomes == {1: "bad-argument"}
    assert talk.messages == ["the request has 21 bytes; the robot accepts at most 20 (queue.bytes)"]
    talk.run("line", code="G1 X100 Y100 Z100 F")
    assert talk.sent == ["G1 X100 Y100 Z100 F"]


def test_counters_are_drawn_for_what_goes_only() -> None:
    """The length of a frame that waits is known before its number is used up."""
    talk = Dialogue(STREAMED).connect()
    for _ in range(8):
        talk.run("number")
    assert talk.sent == ["N8", "N9", "N10", "N11", "N12"]  # 3 + 3 + 4 + 4 + 4
    talk.says("ok")
    assert talk.sent == ["N13"]


def test_what_got_no_answer_takes_its_room_until_it_is_given_up() -> None:
    """It may still lie in front of the robot's reader."""
    talk = Dialogue(STREAMED.replace("    idempotent: true\n    retries: 1\n", "")).connect()
    talk.run("line", code="G1 X100 Y100 Z")
    talk.at(0.5).run("number")
    assert talk.outcomes == {1: "timed-out"}
    talk.at(0.9)
    assert talk.sent == ["G1 X100 Y100 Z"]
    assert talk.at(1.0).sent == ["N8"]
