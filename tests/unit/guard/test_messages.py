"""Whatever the two processes say to each other arrives as it was said."""

import pytest

from urc.guard import messages
from urc.model.payload import Count, Envelope, Numbered
from urc.model.values import NOTHING
from urc.motion.hold_to_run import HoldTerms
from urc.transports.base import GoalRecord

PUBLISH = Envelope("publish", {"topic": "/cmd_vel"}, {"linear": {"x": 0.5}})
IMAGE = Envelope("message", {"topic": "/camera"}, b"\xff\xd8")
FIRST = Count({}, {"n": 5})
SIXTH = Count({"n": 5}, {"n": 6})
STOPS = (Numbered(b"5 stop", FIRST), Numbered(PUBLISH, SIXTH))

GOALS = GoalRecord((("a1", "/dock", True), ("b2", "/dock", False)), ("/dock", "/undock"))

TO_GUARD: list[messages.ToGuard] = [
    messages.MakeTransport(
        "wire", "a.b:c", {"port": 1, "tls": {"ca": "x"}}, [("/t", {"qos": 1})], "", 0.25, True
    ),
    messages.MakeTransport("ros", "a.b:c", {}, [], "", 0.25, True, None, GOALS),
    messages.OpenLine("wire", 3, 2.5),
    messages.SendBytes("wire", 3, 7, b"\x00\xff"),
    messages.SendBytes("wire", 3, 8, PUBLISH),
    messages.SendBytes("wire", 3, 9, b"5 hello", FIRST, 2),
    messages.CloseLine("wire", 3),
    messages.FlowCredit("wire", 3, 65536),
    messages.ArmControl("wire", "drive", HoldTerms(b"stop", 0.05, 0.3, True)),
    messages.ArmControl("wire", "drive", HoldTerms(PUBLISH, 0.05)),
    messages.RenewLease("drive", 9, b"go", 12.5),
    messages.RenewLease("drive", 9, PUBLISH, 12.5),
    messages.RenewLease("drive", 9, b"5 go", 12.5, SIXTH),
    messages.ReleaseControl("drive"),
    messages.ReplaceStop("drive", b"5 stop", STOPS),
    messages.StopMotion([("wire", "drive", HoldTerms(b"stop", 0.05))]),
    messages.StopMotion([("wire", "drive", HoldTerms(b"5 stop", 0.05, stops=STOPS))]),
    messages.RecoverStop("wire", "drive", HoldTerms(b"stop", 0.05)),
]
FROM_GUARD: list[messages.FromGuard] = [
    messages.LineOpened("wire", 3, "tcp 10.0.0.1:1", {"n": 5}),
    messages.OpenFailed("wire", 3, "nothing listens"),
    messages.BytesReceived("wire", 3, b"hello"),
    messages.BytesReceived("wire", 3, IMAGE),
    messages.SendDone("wire", 3, 8),
    messages.SendRefused("wire", 3, 8, "too many bytes", False),
    messages.LineLost("wire", 3, "the robot closed the connection"),
    messages.LineClosed("wire", 3),
    messages.StopWritten("drive", "expired", 9),
    messages.Heartbeat(0.001),
    messages.CountersAdvanced("wire", 3, 8, {"n": 6}, [("drive", 9)]),
    messages.SendStale("wire", 3, 8, {"n": 6}),
    messages.GoalsChanged("ros", GOALS),
]


@pytest.mark.parametrize("said", TO_GUARD, ids=lambda said: type(said).__name__)
def test_orders_arrive(said: messages.ToGuard) -> None:
    assert messages.decoder_of_guard().decode(messages.encoder().encode(said)) == said


@pytest.mark.parametrize("said", FROM_GUARD, ids=lambda said: type(said).__name__)
def test_reports_arrive(said: messages.FromGuard) -> None:
    assert messages.decoder_of_server().decode(messages.encoder().encode(said)) == said


def test_payloads_keep_their_kind() -> None:
    """Bytes stay bytes, and an envelope an envelope with its body's kinds."""
    for payload in (b"x", PUBLISH, IMAGE, Envelope("cancel", NOTHING)):
        said = messages.BytesReceived("wire", 1, payload)
        again = messages.decoder_of_server().decode(messages.encoder().encode(said))
        assert isinstance(again, messages.BytesReceived)
        assert type(again.data) is type(payload)
        assert again.data == (payload if isinstance(payload, bytes) else Envelope(*payload))


@pytest.mark.parametrize("body", [object(), 1 << 80, {1, 2j}])
def test_what_no_message_can_carry_is_refused(body: object) -> None:
    from urc.guard.pipe import UNFIT

    with pytest.raises(UNFIT):
        messages.encoder().encode(messages.SendBytes("wire", 1, 1, Envelope("publish", {}, body)))


def test_body_that_cannot_be_passed_on_is_named() -> None:
    with pytest.raises(NotImplementedError, match=r"^object cannot be passed on$"):
        messages.encoder().encode(
            messages.BytesReceived("wire", 1, Envelope("publish", {}, object()))
        )
