"""What a server says arrives as the robot's own process would have it."""

import math

import pytest

from urc.client.decode import decode_message, samples_of, signals_of
from urc.model.driver import Driver
from urc.model.profile import Profile
from urc.model.values import AlarmLimits, Reading, Sample, Signal
from urc.web.wire import messages as wire
from urc.web.wire.picture import encode_picture
from urc.wire.picture import PictureMessage, read_picture
from urc.wire.server_messages import HelloMessage, ValuesMessage

SIGNALS = {
    one.name: one
    for one in (
        Signal("volts", "number", title="Battery", unit="V", min=0, max=60, precision=2,
               limits=AlarmLimits(low=11, hihi=50), stale_after_s=3.0),
        Signal("count", "integer", stale_after_s=2.0),
        Signal("mode", "string", states=(("0", "off"), ("1", "on")), stale_after_s=2.0),
        Signal("pose", "array", axes="FLU", stale_after_s=2.0),
        Signal("tree", "object", stale_after_s=2.0),
    )
}  # fmt: skip


def test_signals_keep_their_meaning() -> None:
    """Those of the driver, as far as a client can use them."""
    profile = Profile("p", "P", "p.yaml", driver=Driver(signals=SIGNALS))
    hello = decode_message(wire.encode_hello(profile, "s1", 2.0))
    assert isinstance(hello, HelloMessage)
    assert signals_of(hello) == SIGNALS


VALUES = [
    ("volts", 11.5),
    ("volts", 12),
    ("volts", None),
    ("count", 2**60 + 1),
    ("count", -(2**60) - 1),
    ("count", 7),
    ("mode", "on"),
    ("mode", "12"),
    ("pose", (1.0, 2.0, 3.0)),
    ("tree", {"a": [1, {"b": 2}]}),
]


@pytest.mark.parametrize(("name", "value"), VALUES)
def test_values_keep_their_types(name: str, value: Reading) -> None:
    """Through JSON, which has fewer."""
    sample = Sample(name, value, 9.5, "low" if name == "volts" else "")
    indexes = wire.Indexes({one: place for place, one in enumerate(SIGNALS)})
    message = decode_message(wire.encode_values([sample], indexes, 10.0))
    assert isinstance(message, ValuesMessage)
    (found,) = samples_of(message, tuple(SIGNALS.values()), 100.0)
    assert found == sample._replace(time_s=99.5)
    assert type(found.value) is type(value)


def test_what_json_cannot_say_is_not_available() -> None:
    """No number is better than a wrong one."""
    sample = Sample("volts", math.nan, 10.0)
    message = decode_message(wire.encode_values([sample], wire.Indexes({"volts": 0}), 10.0))
    assert isinstance(message, ValuesMessage)
    (found,) = samples_of(message, tuple(SIGNALS.values()), 10.0)
    assert found.value is None


@pytest.mark.parametrize("text", ["", "{", "[]", '{"t": "weather"}', '{"t": "v"}', "[" * 10_000])
def test_other_messages_are_passed_over(text: str) -> None:
    """A newer server may say more."""
    assert decode_message(text) is None


def test_images_arrive_whole() -> None:
    """Their type is the first thing in them anyway."""
    data = b"\xff\xd8\xff\xe0 picture"
    assert read_picture(encode_picture(3, data, 9, 40, 1000)) == PictureMessage(3, 40, data)
    assert read_picture(b"") is None
    assert read_picture(b"\x02" + bytes(40)) is None
