"""What a binary frame costs: 24 bytes, 8 fields, CRC, against tidy code written by hand.

Both take a frame from its bytes to a mapping of named, scaled values, and back. The declaration is
the one a profile would have; the code by hand is what its author would have written instead, with
one precompiled `struct.Struct` and the CRC of the standard library, which is C.
"""

import platform
import time
from binascii import crc_hqx
from collections.abc import Callable, Mapping, Sequence
from struct import Struct

from bench.harness import Goal, Result, compare
from urc.model.framing import ChecksumSpec, CrcSpec, FrameLayout, Window
from urc.protocol.forms import Frame
from urc.protocol.frame import Seal
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
CHECKSUM = ChecksumSpec(CrcSpec(16, 0x1021), 16, Window(0, -2), -2)
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


def encode_by_hand(values: Mapping[str, float]) -> bytes:
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
    """Measure reading with and without the engine's `Frame`, and writing."""
    seal = Seal(FrameLayout(tail=2, size=24, checksum=CHECKSUM))
    open_frame, read, write = seal.open, reader(DECLARED).read, writer(DECLARED).write
    data = seal.close(encode_by_hand(VALUES))  # type: ignore[arg-type]  # numbers where it matters
    one = Frame(b"", "utf-8")

    def decode(frame: bytes) -> Mapping[str, object] | None:
        one.payload = open_frame(frame)
        return read(one)

    def decode_anew(frame: bytes) -> Mapping[str, object] | None:
        return read(Frame(open_frame(frame), "utf-8"))

    assert decode(data) == decode_anew(data) == decode_by_hand(data) == VALUES
    assert write(VALUES) == encode_by_hand(VALUES) == data[:-2]  # type: ignore[arg-type]
    rounds, versions = (41 if full else 15), {"python": platform.python_version()}
    cases: list[tuple[Goal, Callable[[], float], Callable[[], float]]] = [
        (
            # 1.053 is 0.95 times the speed.
            Goal("engine_binary: decode 24 B, 8 fields, CRC / by hand", 1.053),
            _seconds(decode_by_hand, data),
            _seconds(decode, data),
        ),
        (
            # The object that carries a frame past all messages of a line is the engine's.
            Goal("engine_binary: the same with a new Frame each / by hand", 1.3),
            _seconds(decode_by_hand, data),
            _seconds(decode_anew, data),
        ),
        (
            Goal("engine_binary: encode 8 arguments / by hand", 1.053),
            _seconds(encode_by_hand, VALUES),
            _seconds(write, VALUES),
        ),
    ]
    return [
        compare(goal, baseline, subject, rounds=rounds, versions=versions)
        for goal, baseline, subject in cases
    ]


def _seconds(function: Callable[..., object], argument: object) -> Callable[[], float]:
    """Return what measures 20 000 calls, in seconds of this process."""

    def measure() -> float:
        began = time.process_time()
        for _ in range(20_000):
            function(argument)
        return time.process_time() - began

    return measure
