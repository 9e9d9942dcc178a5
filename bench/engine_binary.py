"""Processor time for a binary frame (24 bytes, 8 fields, CRC), compared with hand-written code.

URC and the hand-written code convert a frame from bytes to a mapping of named, scaled values, and
back. URC uses a declaration like that of an ordinary profile. The hand-written code is what a
careful author would write without URC. This code uses one precompiled `struct.Struct` and the
standard library's CRC, which is written in C.
"""

import platform
import time
from binascii import crc_hqx
from collections.abc import Callable, Mapping, Sequence
from struct import Struct
from typing import Any

from bench.harness import Goal, Result, compare
from urc.config.node import Node, Problems
from urc.config.parse.driver import parse_driver
from urc.model.driver import Driver
from urc.model.framing import ByteRange, ChecksumSpec, CrcSpec, FrameLayout
from urc.model.values import Sample
from urc.protocol.engine import Engine
from urc.protocol.events import Samples
from urc.protocol.framing.frame import FrameCodec
from urc.protocol.values.payload import Frame
from urc.runtime.registries import built_in_catalog
from urc.source import parse_document
from urc.testing.struct import reader, writer

DECLARED = """
struct:
  - u8 4
  - { id: temp_fet, type: i16be, scale: 0.1 }
  - { id: temp_motor, type: i16be, scale: 0.1 }
  - { id: current, type: i32be, scale: 0.01 }
  - { id: duty, type: i16be, scale: 0.001 }
  - i32be erpm
  - { id: v_in, type: i16be, scale: 0.1 }
  - { id: energy, type: u32be, scale: 0.0001 }
  - { id: fault, type: u8, enum: { "0": none, "1": over_voltage, "2": under_voltage } }
"""
DRIVER = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: fixed, size: 24, checksum: { algorithm: crc16-xmodem } }
signals:
  temp_fet: {}
  temp_motor: {}
  current: {}
  duty: {}
  erpm: { type: integer }
  v_in: {}
  energy: {}
  fault: { type: string }
messages:
  values:""" + DECLARED.replace("\n", "\n    ")
CHECKSUM = ChecksumSpec(CrcSpec(16, 0x1021), 16, ByteRange(0, -2), -2)
VALUES: Mapping[str, object] = {
    "temp_fet": 25.1,
    "temp_motor": -3.2,
    "current": 1.05,
    "duty": 0.5,
    "erpm": 1000,
    "v_in": 24.1,
    "energy": 1.5,
    "fault": "over_voltage",
}
FRAMES = 10
"""Number of frames in one chunk, as received from a fast connection."""
LAYOUT = Struct(">BhhihihIB")
FAULTS = {0: "none", 1: "over_voltage", 2: "under_voltage"}
FAULT_NUMBERS = {name: number for number, name in FAULTS.items()}


def decode_by_hand(frame: bytes) -> Mapping[str, object] | None:
    if len(frame) != 24:
        return None
    body = frame[:-2]
    if crc_hqx(body, 0) != int.from_bytes(frame[-2:], "big"):
        return None
    packet, temp_fet, temp_motor, current, duty, erpm, v_in, energy, fault = LAYOUT.unpack(body)
    if packet != 4:
        return None
    return {
        "temp_fet": temp_fet / 10,
        "temp_motor": temp_motor / 10,
        "current": current / 100,
        "duty": duty / 1000,
        "erpm": erpm,
        "v_in": v_in / 10,
        "energy": energy / 10000,
        "fault": FAULTS.get(fault, fault),
    }


def driver_of(text: str) -> Driver:
    document = parse_document(text, "bench.yaml")
    problems = Problems()
    driver = parse_driver(Node(document, (), document.data), problems, built_in_catalog())
    assert not problems.problems, problems.problems
    return driver


class ByHand:
    """A hand-written decoder that finds the frames in a byte stream and returns their samples."""

    def __init__(self) -> None:
        self._left = b""

    def receive(self, data: bytes, now: float) -> list[Sample]:
        """Return the samples of all complete frames."""
        data = self._left + data if self._left else data
        samples: list[Sample] = []
        start = 0
        while len(data) - start >= 24:
            found = decode_by_hand(data[start : start + 24])
            start += 24
            if found is not None:
                samples += [Sample(name, value, now) for name, value in found.items()]  # type: ignore[arg-type]
        self._left = data[start:]
        return samples


def encode_by_hand(values: Mapping[str, Any]) -> bytes:
    return LAYOUT.pack(
        4,
        round(values["temp_fet"] * 10),
        round(values["temp_motor"] * 10),
        round(values["current"] * 100),
        round(values["duty"] * 1000),
        values["erpm"],
        round(values["v_in"] * 10),
        round(values["energy"] * 10000),
        FAULT_NUMBERS[values["fault"]],
    )


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure decoding, decoding through the whole engine, and encoding."""
    codec = FrameCodec(FrameLayout(tail=2, size=24, checksum=CHECKSUM))
    open_frame, read, write = codec.open, reader(DECLARED).read, writer(DECLARED).write
    data = codec.close(encode_by_hand(VALUES))
    one = Frame(b"", "utf-8")

    def decode(frame: bytes) -> Mapping[str, object] | None:
        one.payload = open_frame(frame)
        return read(one)

    engine, hand = Engine(driver_of(DRIVER), {}, is_compiled=True), ByHand()
    engine.tick(0.0)
    engine.start("wire", 0.0)
    several = data * FRAMES
    received = engine.receive("wire", data, 1.0)
    assert received == [Samples("wire", tuple(hand.receive(data, 1.0)))]
    received = engine.receive("wire", several, 1.0)
    told = [sample for event in received if isinstance(event, Samples) for sample in event.samples]
    assert told == hand.receive(several, 1.0)
    assert decode(data) == decode_by_hand(data) == VALUES
    assert write(VALUES) == encode_by_hand(VALUES) == data[:-2]
    rounds, versions = (41 if full else 15), {"python": platform.python_version()}
    cases: list[tuple[Goal, Callable[[], float], Callable[[], float]]] = [
        (
            Goal("engine_binary: decode 24 B, 8 fields, CRC / by hand", 1.4),
            _seconds(decode_by_hand, data),
            _seconds(decode, data),
        ),
        (
            # From bytes to samples, with framing on both sides.
            Goal("engine_binary: bytes to samples, a frame at a time / by hand", 1.4),
            _seconds(lambda data: hand.receive(data, 1.0), data),
            _seconds(lambda data: engine.receive("wire", data, 1.0), data),
        ),
        (
            Goal("engine_binary: bytes to samples, 10 frames at a time / by hand", 1.4),
            _seconds(lambda data: hand.receive(data, 1.0), several, 2_000),
            _seconds(lambda data: engine.receive("wire", data, 1.0), several, 2_000),
        ),
        (
            Goal("engine_binary: encode 8 arguments / by hand", 1.4),
            _seconds(encode_by_hand, VALUES),
            _seconds(write, VALUES),
        ),
    ]
    return [
        compare(goal, baseline, subject, rounds=rounds, versions=versions)
        for goal, baseline, subject in cases
    ]


def _seconds(
    function: Callable[..., object], argument: object, times: int = 20_000
) -> Callable[[], float]:
    """Return a function that measures the CPU time of `times` calls, in seconds."""

    def measure() -> float:
        began = time.process_time()
        for _ in range(times):
            function(argument)
        return time.process_time() - began

    return measure
