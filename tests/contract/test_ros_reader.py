"""Messages in CDR are read as Foxglove's own reader reads them, which drives its dashboards."""

import base64
import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from bench.rig.ros_messages import ROS2, TYPES, RandomMessages
from scripts.node import node_executable
from urc.protocol.ros.definition import layout_of
from urc.protocol.ros.msg_text import parse_msg
from urc.protocol.ros.read_source import build_read, read_safely
from urc.protocol.ros.wanted import ALL

HERE = Path(__file__).parent
EACH_TYPE = 3
NODE_TIMEOUT_S = 120


@pytest.mark.needs("node")
@pytest.mark.needs("rosmsg")
def test_messages_are_read_as_foxglove_reads_them() -> None:
    source, asked, ours = RandomMessages(ROS2, seed=21), [], []
    for name in TYPES:
        definition = ROS2.generate_msgdef(name, ros_version=2)[0]
        read = build_read(layout_of(name, parse_msg(name, definition)), ALL)
        for _ in range(EACH_TYPE):
            data = bytes(ROS2.serialize_cdr(source.message(name), name))
            ours.append(read_safely(read, data))
            text = base64.b64encode(data).decode()
            asked.append(json.dumps({"definition": definition, "data": text}))
    node = node_executable()
    assert node is not None
    done = subprocess.run(
        [node, str(HERE / "ros_reader.mjs")],
        input="\n".join(asked),
        capture_output=True,
        text=True,
        timeout=NODE_TIMEOUT_S,
        check=True,
    )
    theirs = [_plain(json.loads(line)) for line in done.stdout.splitlines()]
    assert theirs == ours


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        if value.keys() == {"bytes"}:
            return base64.b64decode(value["bytes"])
        return (
            int(value["big"])
            if value.keys() == {"big"}
            else {k: _plain(v) for k, v in value.items()}
        )
    return [_plain(one) for one in value] if isinstance(value, list) else value
