"""What is new in each frame: the time of day, and bytes that are never sent twice."""

import base64
import hashlib
from collections.abc import Iterator
from itertools import count

import pytest

from tests.dialogue import Dialogue, driver_of
from urc.protocol.engine import Engine
from urc.protocol.values.time_and_nonce import TimeAndNonce

DRIVER = """
wire: queue: { in_flight: 4 }
commands:
  stamp: { send: "AT {{ now | iso }}" }
  unix: { send: "AT {{ now | int }}" }
  twice: { send: "{{ nonce(2) | b64encode }} {{ nonce(2) | b64encode }}" }
  get:
    send: "{{ seq('n', 0, 9) }} {{ nonce() | b64encode }}"
    reply: { regex: '^V', resend: '^AGAIN$' }
    idempotent: true
    retries: 2
  told: { send: "AT {{ now }}", args: { now: { type: string } } }
  drive:
    send: "{{ nonce(3) | b64encode }} V {{ v }}"
    args: { v: {} }
    hold: { repeat: 50ms, release: { v: 0 }, watchdog: 500ms }
  raw: { send: { hex: "01 {{ nonce(2) }}" } }
polls: [{ every: 1s, phase: 1h, send: "POLL {{ nonce(1) | b64encode }}" }]
messages: { ask: { regex: '^ASK$', acknowledge: "IT IS {{ now | iso }}" } }
sequences: { say: [{ send: "{{ nonce(1) | b64encode }}" }, { send: "{{ nonce(1) | b64encode }}" }] }
"""


class Source:
    """Counts what it gives, so that each frame is known by it."""

    def __init__(self) -> None:
        self.unix_s = 1_000_000_000.25
        self._numbers: Iterator[int] = count(100)

    def fresh(self) -> TimeAndNonce:
        return TimeAndNonce(lambda: self.unix_s, lambda size: bytes([next(self._numbers)] * size))


def talk_of(source: Source) -> Dialogue:
    talk = Dialogue("commands: { x: { send: X } }")
    talk.engine = Engine(driver_of(DRIVER), {}, fresh=source.fresh())
    return talk.connect()


def of(number: int, size: int) -> str:
    return base64.b64encode(bytes([number] * size)).decode()


def test_the_time_is_that_of_sending() -> None:
    """Not that of asking: a timestamp that waited in the queue is old."""
    source = Source()
    talk = talk_of(source)
    talk.run("stamp")
    assert talk.sent == ["AT 2001-09-09T01:46:40.250Z"]
    source.unix_s += 60
    talk.run("unix")
    talk.says("ASK")
    assert talk.sent == ["AT 1000000060", "IT IS 2001-09-09T01:47:40.250Z"]


def test_a_nonce_is_the_same_in_one_frame_and_in_no_other() -> None:
    """Of commands, the steps of sequences, and bytes."""
    talk = talk_of(Source())
    talk.run("twice")
    talk.run("twice")
    first, second = (frame.split() for frame in talk.sent)
    assert first[0] == first[1] != second[0] == second[1]
    talk.run("say")
    one, other = talk.sent
    assert one != other
    talk.run("raw")
    (raw,) = talk.sent
    assert (raw[0], raw[1]) == ("\x01", raw[2])


def test_what_is_sent_again_has_a_new_nonce_and_its_old_number() -> None:
    """Whether nothing came back, or the robot asks for it."""
    talk = talk_of(Source())
    talk.run("get")
    talk.at(0.6)
    frames = talk.sent
    talk.says("AGAIN")
    frames += talk.sent
    talk.says("V")
    talk.at(2.0).run("get")
    frames += talk.sent
    numbers, nonces = zip(*(frame.split() for frame in frames), strict=True)
    assert numbers == ("0", "0", "0", "1")
    assert len(set(nonces)) == 4


def test_frames_of_motion_and_their_stop_are_new() -> None:
    """The stop is made anew beside them, so that it has never been sent."""
    motions = talk_of(Source()).engine.motions
    assert not motions.is_lasting("drive")
    frames = [motions.motion_frame("drive", {"v": 1}, 0.0), motions.stop_frame("drive")]
    assert frames == [f"{of(100, 3)} V 1\n".encode(), f"{of(101, 3)} V 0\n".encode()]


def test_an_argument_may_be_called_as_the_time_is() -> None:
    """What is given goes before what is known."""
    talk = talk_of(Source())
    talk.run("told", now="noon")
    assert talk.sent == ["AT noon"]


def test_documents_are_tried_with_a_time_and_bytes_that_are_always_the_same() -> None:
    """So that a test can say what is sent."""
    talk = Dialogue(DRIVER).connect()
    talk.run("stamp")
    talk.run("twice")
    assert talk.sent == ["AT 2000-01-01T00:00:00.000Z", "AAE= AAE="]


@pytest.mark.parametrize(
    ("send", "why"),
    [
        ('"{{ nonce() }}"', "nonce\\(\\) returns bytes"),
        ('"{{ nonce(0) | b64encode }}"', "a nonce has 1 to 64 bytes, not 0"),
        ('"{{ nonce(65) | b64encode }}"', "a nonce has 1 to 64 bytes, not 65"),
        ("\"{{ nonce('a') | b64encode }}\"", "write nonce\\(\\), or nonce\\(8\\)"),
    ],
)
def test_a_nonce_that_cannot_be_written_is_found(send: str, why: str) -> None:
    """When the document is loaded."""
    with pytest.raises(AssertionError, match=why):
        driver_of(f"commands: {{ go: {{ send: {send} }} }}")


def test_a_nonce_stands_only_in_what_is_sent() -> None:
    """A condition over it would mean nothing."""
    with pytest.raises(AssertionError, match="only 'send' can use a nonce"):
        driver_of("commands: { go: { send: GO, requires: [{ expr: nonce() == 1, else: No }] } }")


SOAP = """
transports:
  web: { type: pigeon, connection: persistent, framing: { type: datagram } }
settings: { user: { type: string, default: ada }, password: { type: string, default: "s3" } }
commands:
  move:
    send: "{{ settings.user }};
      {{ (nonce() + (now | iso) + settings.password) | sha1 | hexbytes | b64encode }};
      {{ nonce() | b64encode }};{{ now | iso }}"
"""


def test_a_digest_of_web_service_security_can_be_written() -> None:
    """Base64 of SHA-1 over the nonce, the time and the password, as OASIS has it."""
    talk = Dialogue(SOAP, {"user": "ada", "password": "s3"}).connect("web")
    talk.run("move")
    user, digest, nonce, created = (one.strip() for one in talk.sent[0].split(";"))
    raw = base64.b64decode(nonce)
    assert (user, len(raw)) == ("ada", 16)
    known = hashlib.sha1(raw + created.encode() + b"s3", usedforsecurity=False).digest()
    assert base64.b64decode(digest) == known
