"""The engine's side of a line in the guard: what belongs to an earlier connection is nobody's."""

import asyncio

import pytest

from urc.guard import messages
from urc.guard.guarded_connection import WINDOW_BYTES
from urc.guard.proxy import GuardedTransport
from urc.model.payload import Count, CountedFrame, Envelope, Numbered, Payload
from urc.testing.clock import settle
from urc.transports.base import ConnectFailed, PeerClosed, Prompt, TransportError

pytestmark = pytest.mark.anyio


class Guard:
    """Answers as it is told."""

    def __init__(self, *, is_there: bool = True) -> None:
        self.said: list[messages.ToGuard] = []
        self.is_there = is_there
        self.answers = True
        self.line = GuardedTransport(
            "wire", "tcp robot:1", self.post, self.ready, lambda line, stand, is_settled: None
        )

    def post(self, said: messages.ToGuard) -> None:
        self.said.append(said)
        if not self.answers:
            return
        if isinstance(said, messages.OpenLine):
            self.tell(messages.LineOpened("wire", said.turn, "tcp robot:2", {}))
        elif isinstance(said, messages.CloseLine):
            self.tell(messages.LineClosed("wire", said.turn))

    def tell(self, said: messages.FromGuard, size: int = 0) -> None:
        self.line.handle(said, size)

    async def ready(self) -> None:
        if not self.is_there:
            await asyncio.Event().wait()

    def credits(self) -> list[int]:
        return [said.amount for said in self.said if isinstance(said, messages.FlowCredit)]


async def test_opening_tells_where_it_leads() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    assert guard.line.address == "tcp robot:2"
    assert isinstance(guard.line, Prompt)


async def test_refusal_is_told_in_the_robots_words() -> None:
    guard = Guard()
    guard.answers = False
    opening = asyncio.ensure_future(guard.line.open(1.0))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    guard.tell(messages.OpenFailed("wire", 1, "nothing listens on robot:1"))
    with pytest.raises(ConnectFailed, match="nothing listens on robot:1"):
        await opening


async def test_guard_that_does_not_start_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urc.guard.proxy.START_S", 0.01)
    await Guard().line.ready()
    with pytest.raises(ConnectFailed, match=r"^the guard has not started; see the server's log$"):
        await Guard(is_there=False).line.ready()


async def test_opening_ends_in_its_time_without_a_guard(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urc.guard.proxy._OPEN_GRACE_S", 0.01)
    guard = Guard(is_there=False)
    with pytest.raises(ConnectFailed, match=r"no answer from tcp robot:1 within 0\.01 s"):
        await guard.line.open(0.01)


async def test_old_connections_say_nothing() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    await guard.line.close()
    await guard.line.open(1.0)
    guard.tell(messages.BytesReceived("wire", 1, b"old"), 3)
    guard.tell(messages.LineLost("wire", 1, "old"))
    guard.tell(messages.BytesReceived("wire", 2, b"new"), 3)
    assert await guard.line.receive() == b"new"


async def test_only_new_data_counts_as_an_arrival() -> None:
    """An envelope of the transport itself, or one that was held back, is not new."""
    guard = Guard()
    await guard.line.open(1.0)
    guard.tell(messages.BytesReceived("wire", 1, b"a"), 3)
    guard.tell(messages.BytesReceived("wire", 1, b"b", is_new=False), 3)
    assert guard.line.arrivals() == 1
    guard.tell(messages.BytesReceived("wire", 1, b"c"), 3)
    guard.tell(messages.BytesReceived("wire", 9, b"of no connection"), 3)
    assert guard.line.arrivals() == 2


async def test_what_came_before_the_end_is_still_given() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    guard.tell(messages.BytesReceived("wire", 1, b"last words"), 10)
    guard.tell(messages.LineLost("wire", 1, "the robot closed the connection"))
    assert await guard.line.receive() == b"last words"
    with pytest.raises(PeerClosed, match="the robot closed the connection"):
        await guard.line.receive()
    with pytest.raises(PeerClosed, match="the robot closed the connection"):
        await guard.line.send(b"x")


async def test_guard_is_told_what_was_taken() -> None:
    """In large pieces: a line that is not read must not be read any further in there either."""
    guard = Guard()
    await guard.line.open(1.0)
    size = WINDOW_BYTES // 8
    guard.tell(messages.BytesReceived("wire", 1, b"a"), size)
    guard.tell(messages.BytesReceived("wire", 1, b"b"), size)
    assert guard.credits() == []
    await guard.line.receive()
    assert guard.credits() == []
    await guard.line.receive()
    assert guard.credits() == [2 * size]


async def test_what_the_sink_takes_is_told_too() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    seen: list[bytes] = []

    def sink(data: bytes) -> bool:
        seen.append(data)
        return True

    guard.line.divert(sink)
    guard.tell(messages.BytesReceived("wire", 1, b"a"), WINDOW_BYTES)
    assert seen == [b"a"]
    assert guard.credits() == [WINDOW_BYTES]


async def test_sending_waits_until_it_was_handed_over() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    sending = asyncio.ensure_future(guard.line.send(b"x"))
    await asyncio.sleep(0)
    assert not sending.done()
    guard.tell(messages.SendDone("wire", 1, 1))
    await sending


async def test_what_cannot_be_sent_is_told_to_the_sender() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    sending = asyncio.ensure_future(guard.line.send(b"x"))
    await asyncio.sleep(0)
    guard.tell(messages.SendRefused("wire", 1, 1, "too many bytes for one datagram", False))
    with pytest.raises(TransportError, match="too many bytes"):
        await sending


async def test_offers_have_an_end() -> None:
    """What nobody waits for is bounded."""
    guard = Guard()
    await guard.line.open(1.0)
    taken = sum(guard.line.offer(b"x" * 1024) for _ in range(1000))
    assert 0 < taken < 100
    assert guard.line.is_clogged
    guard.tell(messages.SendDone("wire", 1, taken))
    assert guard.line.offer(b"x")
    guard.tell(messages.SendDone("wire", 1, taken + 1))
    await guard.line.close()


async def test_unfit_message_is_refused_here() -> None:
    guard = Guard()
    await guard.line.open(1.0)

    def post(said: object) -> None:
        raise OverflowError("integer out of range")

    guard.line._post = post
    with pytest.raises(TransportError, match="cannot be passed on"):
        await guard.line.send(Envelope("publish", {}, 1 << 80))


async def test_death_of_the_guard_ends_everything() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    receiving = asyncio.ensure_future(guard.line.receive())
    sending = asyncio.ensure_future(guard.line.send(b"x"))
    await asyncio.sleep(0)
    guard.line.lost("the guard ended")
    for waiting in (receiving, sending):
        with pytest.raises(PeerClosed, match="the guard ended"):
            await waiting
    guard.answers = False
    await guard.line.close()  # of nothing: it waits for nobody


async def test_line_is_closed_before_and_after() -> None:
    """Also in what it says of itself; nothing is kept for the next connection."""
    guard = Guard()
    for is_used in (False, True):
        if is_used:
            await guard.line.open(1.0)
            assert guard.line.is_open
            guard.tell(messages.BytesReceived("wire", 1, b"unread"), 3)
            await guard.line.close()
        assert not guard.line.is_open
        assert not guard.line.offer(b"x")
        for use in (guard.line.send(b"x"), guard.line.receive()):
            with pytest.raises(PeerClosed, match="the connection is closed"):
                await use
    assert guard.said == [messages.OpenLine("wire", 1, 1.0), messages.CloseLine("wire", 1)]


async def test_refused_opening_is_called_off_once() -> None:
    """The guard may open it all the same, later."""
    guard = Guard()
    guard.answers = False
    opening = asyncio.ensure_future(guard.line.open(1.0))
    await settle()
    guard.tell(messages.LineOpened("wire", 7, "tcp robot:9", {}))
    guard.tell(messages.OpenFailed("wire", 7, "of another turn"))
    await settle()
    assert not opening.done()
    guard.tell(messages.OpenFailed("wire", 1, "nothing listens"))
    with pytest.raises(ConnectFailed, match="nothing listens"):
        await opening
    await guard.line.close()
    assert guard.said == [messages.OpenLine("wire", 1, 1.0), messages.CloseLine("wire", 1)]


async def test_guard_that_dies_while_a_line_is_opened_says_so() -> None:
    guard = Guard()
    guard.answers = False
    opening = asyncio.ensure_future(guard.line.open(1.0))
    await settle()
    guard.line.lost("the guard ended")
    with pytest.raises(ConnectFailed, match="the guard ended"):
        await opening


@pytest.mark.parametrize("is_closed", [False, True])
async def test_sender_is_told_whether_the_line_is_closed(is_closed: bool) -> None:
    guard = Guard()
    await guard.line.open(1.0)
    sending = asyncio.ensure_future(guard.line.send(b"x"))
    await settle()
    guard.tell(messages.SendRefused("wire", 1, 1, "no", is_closed))
    with pytest.raises(TransportError, match="no") as refused:
        await sending
    assert isinstance(refused.value, PeerClosed) is is_closed


async def test_what_nobody_waited_for_ends_the_line_when_it_is_refused() -> None:
    """All before it went out; whoever reads learns why there is no more."""
    guard = Guard()
    await guard.line.open(1.0)
    assert guard.line.offer(b"a")
    sending = asyncio.ensure_future(guard.line.send(b"b"))
    await settle()
    assert guard.line.offer(b"c")
    guard.tell(messages.SendRefused("wire", 1, 3, "no route", True))
    await sending
    with pytest.raises(PeerClosed, match="no route"):
        await guard.line.receive()


async def test_senders_who_gave_up_do_not_hide_those_after_them() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    assert guard.line.offer(b"offered")
    sends = [asyncio.ensure_future(guard.line.send(bytes([one]))) for one in range(3)]
    await settle()
    sends[0].cancel()
    await settle()
    guard.tell(messages.SendDone("wire", 1, 4))
    await settle()
    assert [one.done() for one in sends] == [True, True, True]
    numbers = [(one.number, one.data) for one in guard.said if isinstance(one, messages.SendBytes)]
    assert numbers == [(1, b"offered"), (2, b"\0"), (3, b"\1"), (4, b"\2")]


async def test_bounds_of_what_is_offered_are_exact() -> None:
    """Before, after a refusal by the encoder, and after everything was lost."""
    guard = Guard()
    post = guard.line._post

    def refuse(said: object) -> None:
        raise OverflowError("integer out of range")

    for turn in (1, 2):
        await guard.line.open(1.0)
        guard.line._post = refuse
        with pytest.raises(TransportError):
            await guard.line.send(b"x" * 100)
        guard.line._post = post
        assert guard.line.offer(b"x" * 4096)
        assert not guard.line.is_clogged
        assert guard.line.offer(b"x")
        assert guard.line.is_clogged
        assert guard.line.offer(b"x" * (65536 - 4097))
        assert not guard.line.offer(b"x")
        guard.tell(messages.SendDone("wire", turn, 2))
        assert guard.line.offer(b"x" * 4096)
        assert not guard.line.offer(b"x")


async def test_what_was_taken_is_told_to_the_byte() -> None:
    guard = Guard()
    await guard.line.open(1.0)
    for _ in range(4):
        guard.tell(messages.BytesReceived("wire", 1, b"a"), WINDOW_BYTES // 4)
        await guard.line.receive()
    told = [one for one in guard.said if isinstance(one, messages.FlowCredit)]
    assert told == [messages.FlowCredit("wire", 1, WINDOW_BYTES // 4)] * 4


async def test_frames_whose_numbers_were_used_up_are_sent_in_a_round_of_their_own() -> None:
    """Each time; a new connection begins with the first round."""
    guard = Guard()
    stands: list[tuple[str, dict[str, int], bool]] = []
    guard.line._stands = lambda *told: stands.append(told)  # type: ignore[arg-type]
    await guard.line.open(1.0)
    for number in (1, 2):
        assert guard.line.offer(b"a")
        guard.tell(messages.SendStale("wire", 1, number, {"n": number}))
    rounds = [(one.number, one.round) for one in guard.said if isinstance(one, messages.SendBytes)]
    assert rounds == [(1, 0), (1, 1), (2, 1), (2, 2)]
    counts = [({}, True), ({"n": 1}, True), ({"n": 1}, False), ({"n": 2}, True), ({"n": 2}, False)]
    assert stands == [("wire", *one) for one in counts]
    await guard.line.open(1.0)
    guard.said.clear()
    assert guard.line.offer(b"b")
    assert guard.said == [messages.SendBytes("wire", 2, 1, b"b")]


async def test_stops_are_renewed_between_the_frames_of_a_round_and_their_sending() -> None:
    """So the guard has stops with the numbers after these frames before it has the frames."""
    guard, seen = Guard(), list[str]()
    await guard.line.open(1.0)

    def again() -> Numbered:
        seen.append("render")
        return Numbered(b"2 go", Count({"n": 1}, {"n": 2}))

    for _ in range(2):
        first = Numbered(b"1 go", Count({}, {"n": 1}))
        assert guard.line.offer_counted(CountedFrame(first, again), lambda data: None)
    guard.line._stands = lambda line, stand, is_settled: seen.append(f"settled {is_settled}")
    guard.line._post = lambda said: seen.append("send")
    guard.tell(messages.SendStale("wire", 1, 1, {"n": 1}))
    assert seen == ["settled True", "render", "render", "settled False", "send", "send"]


async def test_frames_that_are_refused_while_they_are_sent_again_are_sent_once_more() -> None:
    """A guard in this process answers within the call; the newer round has them all."""
    guard, rounds = Guard(), list[tuple[int, int]]()
    await guard.line.open(1.0)
    assert guard.line.offer(b"a")
    assert guard.line.offer(b"b")

    def post(said: messages.ToGuard) -> None:
        assert isinstance(said, messages.SendBytes)
        rounds.append((said.number, said.round))
        if said.round == 1:
            guard.tell(messages.SendStale("wire", 1, 1, {"n": 2}))

    guard.line._post = post
    guard.tell(messages.SendStale("wire", 1, 1, {"n": 1}))
    assert rounds == [(1, 1), (1, 2), (2, 2)]


async def test_numbers_count_when_their_frame_has_left() -> None:
    """Not when it was refused; and with the bytes that left."""
    guard = Guard()
    await guard.line.open(1.0)
    gone: list[Payload] = []
    for number in (1, 2):
        count = Count({"n": number - 1}, {"n": number})
        counted = CountedFrame(Numbered(b"%d go" % number, count), lambda: None)
        assert guard.line.offer_counted(counted, gone.append)
    guard.tell(messages.SendDone("wire", 1, 1))
    assert gone == [b"1 go"]
    guard.tell(messages.SendRefused("wire", 1, 2, "no room", False))
    assert gone == [b"1 go"]


async def test_frame_without_a_next_number_is_given_up() -> None:
    """Its sender goes on with the frame after it, and only that one counts."""
    guard = Guard()
    await guard.line.open(1.0)
    gone: list[Payload] = []
    first = Numbered(b"1 go", Count({"n": 0}, {"n": 1}))
    again = Numbered(b"3 on", Count({"n": 2}, {"n": 3}))
    sending = asyncio.ensure_future(
        guard.line.send_counted(CountedFrame(first, lambda: None), gone.append)
    )
    await settle()
    assert guard.line.offer_counted(CountedFrame(first, lambda: again), gone.append)
    guard.tell(messages.SendStale("wire", 1, 1, {"n": 2}))
    guard.tell(messages.SendDone("wire", 1, 2))
    await sending
    assert gone == [b"3 on"]


def counted(number: int) -> CountedFrame:
    """Return a frame that is made in vain again."""
    count = Count({"n": number - 1}, {"n": number})
    return CountedFrame(Numbered(b"%d go" % number, count), lambda: None)


async def test_frame_with_a_counter_is_taken_while_there_is_room() -> None:
    """Its length changes with its number, so it may pass the bound by itself."""
    guard = Guard()
    gone: list[Payload] = []
    assert not guard.line.offer_counted(counted(1), gone.append)
    await guard.line.open(1.0)
    assert guard.line.offer(b"x" * 65536)
    assert guard.line.offer_counted(counted(1), gone.append)
    assert not guard.line.offer_counted(counted(2), gone.append)


async def test_sender_of_a_frame_with_a_counter_is_told_what_has_left() -> None:
    guard = Guard()
    gone: list[Payload] = []
    with pytest.raises(PeerClosed, match="the connection is closed"):
        await guard.line.send_counted(counted(1), gone.append)
    await guard.line.open(1.0)
    sending = asyncio.ensure_future(guard.line.send_counted(counted(1), gone.append))
    await settle()
    guard.tell(messages.SendDone("wire", 1, 1))
    await sending
    assert gone == [b"1 go"]


async def test_counters_are_settled_when_all_their_frames_have_left() -> None:
    """Frames without one do not matter."""
    guard = Guard()
    await guard.line.open(1.0)
    stands: list[tuple[str, dict[str, int], bool]] = []
    guard.line._stands = lambda *told: stands.append(told)  # type: ignore[arg-type]
    assert guard.line.offer(b"poll")
    guard.tell(messages.CountersAdvanced("wire", 1, 0, {"n": 1}, []))
    for number in (2, 3):
        assert guard.line.offer_counted(counted(number), lambda data: None)
    guard.tell(messages.CountersAdvanced("wire", 1, 2, {"n": 2}, []))
    guard.tell(messages.CountersAdvanced("wire", 1, 3, {"n": 3}, []))
    assert stands == [("wire", {"n": 1}, True), ("wire", {"n": 2}, False), ("wire", {"n": 3}, True)]


async def test_line_is_closed_once() -> None:
    """A sender that still waits is told so."""
    guard = Guard()
    await guard.line.open(1.0)
    sending = asyncio.ensure_future(guard.line.send(b"x"))
    await settle()
    guard.said.clear()
    await guard.line.close()
    await guard.line.close()
    assert guard.said == [messages.CloseLine("wire", 1)]
    with pytest.raises(PeerClosed, match="the connection is closed"):
        await sending


async def test_second_word_about_an_opening_changes_nothing() -> None:
    guard = Guard()
    guard.answers = False
    opening = asyncio.ensure_future(guard.line.open(1.0))
    await settle()
    for _ in range(2):
        guard.tell(messages.LineOpened("wire", 1, "tcp robot:2", {}))
    await opening
    assert guard.line.is_open
