"""The schemas of Foxglove's messages are those that Foxglove publishes."""

import json
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from scripts.node import node_executable
from tests.contract.profiles import profile_of
from urc.runtime import foxglove_schemas
from urc.runtime.recording.shapes import channels
from urc.web.foxglove.services import robot_services
from urc.web.foxglove.topics import robot_topics

HERE = Path(__file__).parent
ROBOTS = HERE.parents[1] / "robots"
NODE_TIMEOUT_S = 60
TYPES = {"boolean", "string", "number", "integer", "object"}


@pytest.mark.needs("node")
@pytest.mark.needs("ws-protocol")
def test_the_schemas_are_those_of_foxglove() -> None:
    node = node_executable()
    assert node is not None
    done = subprocess.run(
        [node, str(HERE / "foxglove_schemas.mjs")],
        capture_output=True,
        text=True,
        timeout=NODE_TIMEOUT_S,
        check=True,
    )
    theirs = json.loads(done.stdout)
    ours = [getattr(foxglove_schemas, name) for name in foxglove_schemas.__all__]
    assert ours
    for schema in ours:
        assert schema == theirs[schema["title"]]


def unreadable(schema: Mapping[str, Any], place: str) -> Iterator[str]:
    """Yield the properties whose type a viewer cannot read from the schema."""
    for name, found in schema.get("properties", {}).items():
        where = f"{place}.{name}"
        if "oneOf" in found:
            if any(not isinstance(one.get("const"), int) for one in found["oneOf"]):
                yield f"{where}: an alternative is no number"
            continue
        one = found.get("items", {}) if found.get("type") == "array" else found
        if one.get("type") not in TYPES:
            yield f"{where}: {one.get('type')!r}"
        elif one["type"] == "object":
            yield from unreadable(one, where)


@pytest.mark.parametrize("robot", sorted(ROBOTS.glob("*.yaml")), ids=lambda file: file.stem)
def test_viewers_can_read_every_topic_of_a_recording(robot: Path) -> None:
    """Lichtblick refuses a topic if one of its properties has no type, or none of its items."""
    found = channels(profile_of(robot).driver)
    assert found
    for channel in found:
        assert channel.schema["type"] == "object"
        assert list(unreadable(channel.schema, channel.topic)) == []


@pytest.mark.parametrize("robot", sorted(ROBOTS.glob("*.yaml")), ids=lambda file: file.stem)
def test_viewers_can_read_every_topic_and_service_of_a_robot(robot: Path) -> None:
    profile = profile_of(robot)
    topics = robot_topics(profile.name, profile)
    assert len({one.topic for one in topics}) == len(topics)
    services = robot_services(profile.name, profile.driver)
    schemas = [(one.topic, one.schema) for one in topics]
    for one in services:
        schemas += [(one.name, one.request), (one.name, one.response)]
    for name, schema in schemas:
        assert list(unreadable(json.loads(schema), name)) == []
    held = {one.name for one in profile.driver.commands.values() if one.hold is not None}
    assert not held & {one.command for one in services}
