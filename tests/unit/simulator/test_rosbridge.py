"""The emulated rosbridge: throttled topics."""

import json

import pytest

from urc.model.payload import Envelope
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


def test_a_cancelled_goal_ends_once_with_the_status_cancelled() -> None:
    """The robot's own result comes later, as it does not know of the bridge's."""
    sent: list[str | bytes] = []
    client = BridgeClient(Bridge({}), sent.append)
    goal = {"op": "send_action_goal", "id": "g1", "action": "/dock", "action_type": "T", "args": {}}
    assert client.hears(json.dumps(goal), 0.0) is not None
    cancel = {"op": "cancel_action_goal", "id": "g1", "action": "/dock"}
    heard = client.hears(json.dumps(cancel), 1.0)
    assert heard == Envelope("cancel", {"action": "/dock", "id": "g1"})
    client.says(Envelope("response", {"id": "g1", "ok": True}, {}), 2.0)
    (result,) = (json.loads(one) for one in sent)
    assert (result["op"], result["id"], result["status"]) == ("action_result", "g1", 5)
    assert result["result"] is False
    client.hears(json.dumps(cancel), 3.0)
    assert len(sent) == 1
