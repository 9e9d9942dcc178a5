"""Transform trees as Foxglove's viewers read them."""

import json
from collections.abc import Mapping
from typing import Any

import jsonschema
import pytest
from foxglove.messages import FrameTransform, FrameTransforms, Quaternion, Vector3

from urc.protocol.values.transform_tree import TransformTree
from urc.runtime.transform_messages import TRANSFORMS_SCHEMA, transforms_message

NS = 1_700_000_000_000_000_000


def transform(child: str, parent: str, x: float = 0.0) -> Mapping[str, Any]:
    """Return a transform as ROS sends it; the rotation is a quarter turn to the left."""
    turn = {"x": 0.0, "y": 0.0, "z": 0.5**0.5, "w": 0.5**0.5}
    return {
        "header": {"frame_id": parent, "stamp": {"sec": 9, "nanosec": 0}},
        "child_frame_id": child,
        "transform": {"translation": {"x": x, "y": 0.0, "z": 0.0}, "rotation": turn},
    }


def told(tree: TransformTree, now_s: float) -> list[dict[str, Any]]:
    """Return the transforms of a tree's message, which fits the schema that is announced."""
    data = transforms_message(tree.value(now_s), NS, "cart/")
    assert data is not None
    message = json.loads(data)
    jsonschema.validate(message, dict(TRANSFORMS_SCHEMA.schema))
    found: list[dict[str, Any]] = message["transforms"]
    return found


def test_each_frame_but_the_root_has_a_transform_with_the_time_of_its_receipt() -> None:
    tree = TransformTree()
    tree.update({"transforms": [transform("odom", "map", 2.0)]}, 10.0)
    tree.update({"transforms": [transform("base_link", "odom", 1.5)]}, 11.5)
    tree.update({"transforms": [transform("laser", "base_link")]}, 1.0, is_static=True)
    found = told(tree, 12.0)
    names = [(one["parent_frame_id"], one["child_frame_id"]) for one in found]
    assert names == [
        ("cart/map", "cart/odom"),
        ("cart/odom", "cart/base_link"),
        ("cart/base_link", "cart/laser"),
    ]
    seconds = [one["timestamp"]["sec"] + one["timestamp"]["nsec"] / 1e9 for one in found]
    assert seconds == pytest.approx([NS / 1e9 - 2, NS / 1e9 - 0.5, NS / 1e9], abs=1e-6)
    assert [one["translation"]["x"] for one in found] == [2.0, 1.5, 0.0]
    assert found[0]["rotation"]["z"] == pytest.approx(0.70711)


def test_the_sdk_of_foxglove_has_the_same_fields() -> None:
    """Its class takes each field by its name."""
    tree = TransformTree()
    tree.update({"transforms": [transform("odom", "map", 2.0)]}, 10.0)
    (one,) = told(tree, 10.0)
    made = FrameTransform(
        parent_frame_id=one.pop("parent_frame_id"),
        child_frame_id=one.pop("child_frame_id"),
        translation=Vector3(**one.pop("translation")),
        rotation=Quaternion(**one.pop("rotation")),
    )
    assert list(one) == ["timestamp"]
    assert FrameTransforms(transforms=[made]).encode()


@pytest.mark.parametrize(
    "value",
    [
        None,
        5,
        {"frames": 7},
        {"frames": ()},
        {"frames": ({"name": "map", "parent": "", "depth": 0},)},
        {"frames": ("map", {"name": "a", "parent": "b"})},
    ],
)
def test_a_value_without_transforms_has_no_message(value: object) -> None:
    """A recording may contain anything."""
    assert transforms_message(value, NS, "") is None
