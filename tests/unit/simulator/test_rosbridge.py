"""The emulated rosbridge: throttled topics."""

import json

import pytest

from urc.simulator.servers.rosbridge import Bridge, BridgeClient


@pytest.mark.parametrize(
    ("interval_s", "expected"), [(0.2, 20), (0.05, 20), (0.5, 8)], ids=["same", "faster", "slower"]
)
def test_a_throttle_passes_messages_at_its_own_interval(interval_s: float, expected: int) -> None:
    """Delays of the machine shift each message by some milliseconds."""
    sent: list[str | bytes] = []
    bridge = Bridge({})
    client = BridgeClient(bridge, sent.append)
    client.hears(json.dumps({"op": "subscribe", "topic": "/camera", "throttle_rate": 200}), 0.0)
    late_s = (0.0, 0.012, 0.003, 0.009, 0.001)
    for number in range(round(4 / interval_s)):
        client.show("/camera", {}, number * interval_s + late_s[number % len(late_s)])
    assert len(sent) == expected
