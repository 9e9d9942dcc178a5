"""Whatever the two processes say to each other arrives as it was said."""

import pytest

from urc.guard import wire
from urc.model.codec import Count, Envelope, Numbered
from urc.model.values import NOTHING
from urc.motion.hold import Terms

PUBLISH = Envelope("publish", {"topic": "/cmd_vel"}, {"linear": {"x": 0.5}})
IMAGE = Envelope("message", {"topic": "/camera"}, b"\xff\xd8")
FIRST = Count({}, {"n": 5})
SIXTH = Count({"n": 5}, {"n": 6})
STOPS = (Numbered(b"5 stop", FIRST), Numbered(PUBLISH, SIXTH))

TO_GUARD: list[wire.ToGuard] = [
    wire.Make(
        "wire", "a.b:c", {"port": 1, "tls": {"ca": "x"}}, [("/t", {"qos": 1})], "", 0.25, True
    ),
    wire.Open("wire", 3, 2.5),
    wire.Send("wire", 3, 7, b"\x00\xff"),
    wire.Send("wire", 3, 8, PUBLISH),
    wire.Send("wire", 3, 9, b"5 hello", FIRST, 2),
    wire.Close("wire", 3),
    wire.Credit("wire", 3, 65536),
    wire.Arm("wire", "drive", Terms(b"stop", 0.05, 0.3, True)),
    wire.Arm("wire", "drive", Terms(PUBLISH, 0.05)),
    wire.Tick("drive", 9, b"go", 12.5),
    wire.Tick("drive", 9, PUBLISH, 12.5),
    wire.Tick("drive", 9, b"5 go", 12.5, SIXTH),
    wire.Release("drive"),
    wire.Renew("drive", b"5 stop", STOPS),
    wire.Stop([("wire", "drive", Terms(b"stop", 0.05))]),
    wire.Stop([("wire", "drive", Terms(b"5 stop", 0.05, stops=STOPS))]),
    wire.Owe("wire", "drive", Terms(b"stop", 0.05)),
]
FROM_GUARD: list[wire.FromGuard] = [
    wire.Opened("wire", 3, "tcp 10.0.0.1:1", {"n": 5}),
    wire.OpenFailed("wire", 3, "nothing listens"),
    wire.Received("wire", 3, b"hello"),
    wire.Received("wire", 3, IMAGE),
    wire.Sent("wire", 3, 8),
    wire.Refused("wire", 3, 8, "too many bytes", False),
    wire.Lost("wire", 3, "the robot closed the connection"),
    wire.Closed("wire", 3),
    wire.Stopped("drive", "expired", 9),
    wire.Beat(0.001),
    wire.Counted("wire", 3, 8, {"n": 6}, [("drive", 9)]),
    wire.Stale("wire", 3, 8, {"n": 6}),
]


@pytest.mark.parametrize("said", TO_GUARD, ids=lambda said: type(said).__name__)
def test_orders_arrive(said: wire.ToGuard) -> None:
    assert wire.decoder_of_guard().decode(wire.encoder().encode(said)) == said


@pytest.mark.parametrize("said", FROM_GUARD, ids=lambda said: type(said).__name__)
def test_reports_arrive(said: wire.FromGuard) -> None:
    assert wire.decoder_of_server().decode(wire.encoder().encode(said)) == said


def test_payloads_keep_their_kind() -> None:
    """Bytes stay bytes, and an envelope an envelope with its body's kinds."""
    for payload in (b"x", PUBLISH, IMAGE, Envelope("cancel", NOTHING)):
        said = wire.Received("wire", 1, payload)
        again = wire.decoder_of_server().decode(wire.encoder().encode(said))
        assert isinstance(again, wire.Received)
        assert type(again.data) is type(payload)
        assert again.data == (payload if isinstance(payload, bytes) else Envelope(*payload))


@pytest.mark.parametrize("body", [object(), 1 << 80, {1, 2j}])
def test_what_no_message_can_carry_is_refused(body: object) -> None:
    from urc.guard.pipe import UNFIT

    with pytest.raises(UNFIT):
        wire.encoder().encode(wire.Send("wire", 1, 1, Envelope("publish", {}, body)))


def test_body_that_cannot_be_passed_on_is_named() -> None:
    with pytest.raises(NotImplementedError, match=r"^object cannot be passed on$"):
        wire.encoder().encode(wire.Received("wire", 1, Envelope("publish", {}, object())))
