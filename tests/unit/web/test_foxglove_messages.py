"""The messages of the Foxglove server, byte for byte, and what a hostile client may send."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from urc.transports.ros.foxglove_frames import FrameReader, MessageData, ServiceReply, call_frame
from urc.wire import foxglove as wire

# The samples of bytes follow foxglove/ws-protocol, docs/spec.md.


def test_a_message_has_the_bytes_of_the_specification() -> None:
    time_ns = 0x0102030405060708
    data = wire.encode_message_head(1, time_ns) + b"{}"
    assert data == bytes.fromhex("01 01000000 0807060504030201 7b7d")
    assert FrameReader().read(data) == MessageData(1, time_ns, b"{}")


def test_a_response_has_the_bytes_of_the_specification() -> None:
    data = wire.encode_response(7, 9, b"[1]")
    assert data == bytes.fromhex("03 07000000 09000000 04000000") + b"json[1]"
    assert FrameReader().read(data) == ServiceReply(9, "json", b"[1]")


def test_a_call_of_our_own_client_is_understood() -> None:
    assert wire.decode(call_frame(7, 9, "json", b'{"a":1}')) == wire.ServiceCall(
        7, 9, "json", b'{"a":1}'
    )


def test_subscriptions_are_understood() -> None:
    said = wire.decode('{"op":"subscribe","subscriptions":[{"id":0,"channelId":3}]}')
    assert isinstance(said, wire.Subscribe)
    assert [(one.id, one.channel) for one in said.subscriptions] == [(0, 3)]
    ended = wire.decode('{"op":"unsubscribe","subscriptionIds":[0,7]}')
    assert isinstance(ended, wire.Unsubscribe)
    assert ended.ids == (0, 7)


BAD: list[tuple[str | bytes, str]] = [
    ("", "expected 'subscribe' or 'unsubscribe'"),
    ("[]", "expected 'subscribe' or 'unsubscribe'"),
    ("[" * 5000, "expected 'subscribe' or 'unsubscribe'"),
    ('{"op":"fly"}', "expected 'subscribe' or 'unsubscribe'"),
    ('{"op":"advertise","channels":[]}', "this server does not offer 'advertise'"),
    ('{"op":"getParameters","parameterNames":[]}', "this server does not offer 'getParameters'"),
    ('{"op":"subscribe","subscriptions":[{"id":-1,"channelId":3}]}', "Expected `int` >= 0"),
    ('{"op":"subscribe","subscriptions":[{"id":4294967296,"channelId":3}]}', "Expected `int`"),
    ('{"op":"subscribe","subscriptions":7}', "Expected `array`"),
    (b"", "expected a binary message of kind 2, found no bytes"),
    (b"\xff123", "expected a binary message of kind 2, found kind 255"),
    (b"\x01\0\0\0\0{}", "expected a binary message of kind 2, found kind 1"),
    (b"\x02\0\0", "a service call has at least 13 bytes, found 3"),
    (b"\x02" + b"\0" * 8 + b"\xff\xff\xff\xff", "cannot have 4294967295 bytes"),
    (b"\x02" + b"\0" * 8 + b"\x05\0\0\0json", "cannot have 5 bytes"),
]


@pytest.mark.parametrize(("message", "reason"), BAD)
def test_an_invalid_message_is_refused_with_one_short_line(
    message: str | bytes, reason: str
) -> None:
    with pytest.raises(wire.BadClientMessage) as caught:
        wire.decode(message)
    text = str(caught.value)
    assert reason in text, text
    assert len(text) <= 500
    assert "\n" not in text


@given(st.one_of(st.binary(max_size=40), st.text(max_size=40)))
def test_garbage_raises_nothing_else(message: str | bytes) -> None:
    try:
        found = wire.decode(message)
    except wire.BadClientMessage:
        return
    assert isinstance(found, wire.Subscribe | wire.Unsubscribe | wire.ServiceCall)


@pytest.mark.parametrize(
    ("offered", "chosen"),
    [
        (["foxglove.sdk.v1"], "foxglove.sdk.v1"),
        (["foxglove.websocket.v1"], "foxglove.websocket.v1"),
        (["foxglove.websocket.v1", "foxglove.sdk.v1"], "foxglove.websocket.v1"),
        (["other", "foxglove.sdk.v1"], "foxglove.sdk.v1"),
        (["foxglove.websocket.v2"], None),
        ([], None),
    ],
)
def test_the_first_known_subprotocol_is_chosen(offered: list[str], chosen: str | None) -> None:
    assert wire.chosen_subprotocol(offered) == chosen


def test_announcements_have_the_fields_of_the_specification() -> None:
    info = json.loads(wire.encode_server_info("URC", "1.0", "s"))
    assert info == {
        "op": "serverInfo",
        "name": "URC",
        "capabilities": ["services"],
        "supportedEncodings": ["json"],
        "metadata": {"urc": "1.0"},
        "sessionId": "s",
    }
    channel = wire.OfferedChannel(3, "/cart/battery", "urc.Signal.battery", "{}")
    assert json.loads(wire.encode_advertise([channel])) == {
        "op": "advertise",
        "channels": [
            {
                "id": 3,
                "topic": "/cart/battery",
                "encoding": "json",
                "schemaName": "urc.Signal.battery",
                "schemaEncoding": "jsonschema",
                "schema": "{}",
            }
        ],
    }
    told: dict[str, Any] = json.loads(wire.encode_status("warning", "x" * 900, "a"))
    assert (told["level"], len(told["message"]), told["id"]) == (1, 500, "a")
