"""Transform trees: chains as in tf2's own tests, ages, bounds, and messages that lie."""

import math
import random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.protocol.test_transforms import matrix, transforms
from urc.protocol.values.convert import BadValue
from urc.protocol.values.transform_tree import (
    CLOCK_JUMP_S,
    MAX_DEPTH,
    MAX_FRAMES,
    MAX_TRANSFORMS,
    SET_BACK,
    NotConnected,
    TransformTree,
    tree_message,
)
from urc.protocol.values.transforms import Transform


def stamped(
    parent: str,
    child: str,
    move: tuple[float, float, float] = (0, 0, 0),
    turn: tuple[float, float, float, float] = (0, 0, 0, 1),
    sec: int | None = 1,
) -> dict[str, Any]:
    """Return a geometry_msgs/TransformStamped."""
    header: dict[str, Any] = {"frame_id": parent}
    if sec is not None:
        header["stamp"] = {"sec": sec, "nanosec": 0}
    return {
        "header": header,
        "child_frame_id": child,
        "transform": {
            "translation": dict(zip("xyz", move, strict=True)),
            "rotation": dict(zip("xyzw", turn, strict=True)),
        },
    }


def tree(*transforms: dict[str, Any], now: float = 10.0, is_static: bool = False) -> TransformTree:
    made = TransformTree()
    assert made.update({"transforms": list(transforms)}, now, is_static=is_static) == []
    return made


def place(made: TransformTree, target: str, source: str) -> tuple[float, float]:
    found, _ = made.lookup(target, source)
    return round(found.x, 9), round(found.y, 9)


Y_TREE = [
    stamped("a", "b", (1, 0, 0)),
    stamped("b", "c", (1, 0, 0)),
    stamped("b", "d", (0, 1, 0)),
    stamped("d", "e", (0, 1, 0)),
]
"""The formation "y" of test_tf2/test/buffer_core_test.cpp."""


@pytest.mark.parametrize(
    ("target", "source", "wanted"),
    [
        ("a", "b", (1, 0)), ("b", "a", (-1, 0)), ("a", "c", (2, 0)), ("c", "a", (-2, 0)),
        ("a", "d", (1, 1)), ("a", "e", (1, 2)), ("e", "a", (-1, -2)), ("c", "e", (-1, 2)),
        ("e", "c", (1, -2)), ("d", "c", (1, -1)), ("b", "e", (0, 2)), ("c", "c", (0, 0)),
    ],
)  # fmt: skip
def test_branches_meet_at_their_common_ancestor(
    target: str, source: str, wanted: tuple[float, float]
) -> None:
    """The lookup of tf2 for its formation "y": the place of `source` in `target`."""
    assert place(tree(*Y_TREE), target, source) == wanted


def test_steps_of_45_degrees_go_round_the_unit_circle() -> None:
    """The formation "ring_45" of tf2: each step is a chord of the circle around (-1, 0)."""
    names = "abcdefghi"
    step = (math.sqrt(2) / 2 - 1, math.sqrt(2) / 2, 0.0)
    turn = (0.0, 0.0, math.sin(math.pi / 8), math.cos(math.pi / 8))
    made = tree(*(stamped(names[at], names[at + 1], step, turn) for at in range(8)))
    for first in range(9):
        for second in range(9):
            found, _ = made.lookup(names[first], names[second])
            angle = (second - first) * math.pi / 4
            assert (found.x, found.y) == pytest.approx(
                (math.cos(angle) - 1, math.sin(angle)), abs=1e-9
            )
            half = math.atan2(found.qz, found.qw)
            assert math.sin(2 * half - angle) == pytest.approx(0, abs=1e-9)


def test_a_pose_goes_from_base_by_odom_to_map() -> None:
    """REP 105: map → odom → base_link, with a static scanner."""
    quarter = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    made = tree(
        stamped("map", "odom", (10, 20, 0), quarter), stamped("odom", "base_link", (2, 1, 0))
    )
    made.update({"transforms": [stamped("base_link", "laser", (0.5, 0, 0.2))]}, 1, is_static=True)
    assert place(made, "map", "base_link") == (9, 22)
    assert place(made, "map", "laser") == (9, 22.5)
    assert place(made, "/map", "/laser") == (9, 22.5)


@given(
    st.lists(st.tuples(st.integers(0, 1000), transforms()), min_size=1, max_size=12),
    st.randoms(use_true_random=False),
)
def test_chains_of_random_trees_are_products_of_matrices(
    links: list[tuple[int, Transform]], dice: random.Random
) -> None:
    """numpy multiplies the matrices from each frame to the root; the messages arrive shuffled."""
    parents = {at + 1: chosen % (at + 1) for at, (chosen, _) in enumerate(links)}
    to_root = {0: np.eye(4)}
    messages = []
    for at, (_, one) in enumerate(links, 1):
        to_root[at] = to_root[parents[at]] @ matrix(one)
        messages.append(stamped(f"f{parents[at]}", f"f{at}", one[:3], one[3:], sec=None))
    dice.shuffle(messages)
    made = TransformTree()
    for message in messages:
        assert made.update({"transforms": [message]}, 1) == []
    for target in to_root:
        for source in to_root:
            found, _ = made.lookup(f"f{target}", f"f{source}")
            wanted = np.linalg.inv(to_root[target]) @ to_root[source]
            np.testing.assert_allclose(matrix(found), wanted, atol=1e-4)


def test_the_age_is_that_of_the_oldest_dynamic_transform() -> None:
    made = TransformTree()
    made.update({"transforms": [stamped("base", "laser")]}, 1.0, is_static=True)
    made.update({"transforms": [stamped("map", "odom")]}, 5.0)
    made.update({"transforms": [stamped("odom", "base")]}, 9.0)
    assert made.lookup("map", "laser")[1] == 5.0
    assert made.lookup("odom", "laser")[1] == 9.0
    assert made.lookup("base", "laser")[1] == math.inf


def test_unconnected_frames_are_named() -> None:
    made = tree(stamped("map", "odom"), stamped("other", "base"))
    with pytest.raises(NotConnected, match="'base' and 'map' are not connected"):
        made.lookup("map", "base")
    with pytest.raises(NotConnected, match="no frame 'moon'"):
        made.lookup("map", "moon")
    with pytest.raises(NotConnected, match="no frame 'moon'"):
        made.lookup("moon", "odom")


def test_a_cycle_is_rejected_and_the_tree_stays() -> None:
    made = tree(stamped("map", "odom"), stamped("odom", "base"))
    faults = made.update({"transforms": [stamped("base", "map")]}, 11)
    assert faults == ["a transform from 'map' closes a cycle: map → base → odom → map"]
    assert made.update({"transforms": [stamped("odom", "odom")]}, 11) == [
        "a transform from 'odom' closes a cycle: odom → odom"
    ]
    assert place(made, "map", "base") == (0, 0)
    assert sorted(made.links) == ["base", "odom"]


def test_a_frame_that_changes_its_parent_moves_with_its_children() -> None:
    made = tree(stamped("map", "odom", (1, 0, 0)), stamped("odom", "base"))
    assert made.update({"transforms": [stamped("earth", "odom", (5, 0, 0))]}, 11) == []
    assert place(made, "earth", "base") == (5, 0)
    with pytest.raises(NotConnected):
        made.lookup("map", "base")


def test_two_publishers_of_one_frame_are_reported() -> None:
    """Two programs report different parents in turn, a common fault of set-ups with odometry."""
    made = TransformTree()
    for second in range(4):
        parent = ("odom", "map")[second % 2]
        made.update({"transforms": [stamped(parent, "base")]}, float(second))
    rows = made.value(3.0)["frames"]
    assert [row.get("other_parent") for row in rows if row["name"] == "base"] == ["odom"]
    made.update({"transforms": [stamped("map", "base", sec=20)]}, 20.0)
    rows = made.value(20.0)["frames"]
    assert all("other_parent" not in row for row in rows)


def test_a_transform_that_was_overtaken_is_ignored() -> None:
    made = tree(stamped("map", "odom", (2, 0, 0), sec=100), now=10)
    made.update({"transforms": [stamped("map", "odom", (1, 0, 0), sec=99)]}, 10.1)
    assert place(made, "map", "odom") == (2, 0)
    assert made.links["odom"].time_s == 10


def test_a_robot_whose_clock_was_set_back_is_followed() -> None:
    made = tree(stamped("map", "odom", (2, 0, 0), sec=100), now=10)
    made.update({"transforms": [stamped("map", "odom", (3, 0, 0), sec=80)]}, 10.1)
    assert place(made, "map", "odom") == (3, 0)
    made.update({"transforms": [stamped("map", "odom", (4, 0, 0), sec=79)]}, 10.2 + CLOCK_JUMP_S)
    assert place(made, "map", "odom") == (4, 0)


def test_a_clock_that_was_set_back_a_little_is_followed_after_some_messages() -> None:
    """Single transforms that are overtaken stay ignored, however many there are."""
    made = tree(stamped("map", "odom", (1, 0, 0), sec=100), now=10)
    for number in range(2 * SET_BACK):
        made.update({"transforms": [stamped("map", "odom", (2, 0, 0), sec=95)]}, 10.1)
        newer = stamped("map", "odom", (1, 0, 0), sec=101 + number)
        if number >= SET_BACK:
            made.update({"transforms": [newer]}, 10.1)
    assert place(made, "map", "odom") == (1, 0)
    for number in range(SET_BACK):
        assert place(made, "map", "odom") == (1, 0)
        late = stamped("map", "odom", (3, 0, 0), sec=104 + number)
        made.update({"transforms": [late]}, 10.2)
    assert place(made, "map", "odom") == (3, 0)


def test_the_names_of_ros_1_are_understood() -> None:
    """ROS 1 begins names with a slash, and names the parts of a time differently."""
    one = stamped("/map", "/odom", (1, 2, 0))
    one["header"]["stamp"] = {"secs": 7, "nsecs": 500_000_000}
    made = tree(one)
    assert made.links["odom"].parent == "map"
    assert made.links["odom"].stamp_s == 7.5


def test_the_value_lists_parents_before_children_with_ages() -> None:
    made = TransformTree()
    made.update({"transforms": [stamped("base", "laser", (0.1, 0, 0.2))]}, 1.0, is_static=True)
    made.update({"transforms": [stamped("odom", "base", sec=5)]}, 9.25)
    made.update({"transforms": [stamped("map", "odom", sec=4)]}, 9.75)
    rows = made.value(10.0)["frames"]
    assert [(row["depth"], row["name"], row.get("age")) for row in rows] == [
        (0, "map", None), (1, "odom", 0.25), (2, "base", 0.75), (3, "laser", None),
    ]  # fmt: skip
    assert rows[1]["stamp"] == 4.0
    assert rows[3]["translation"] == (0.1, 0, 0.2)
    assert rows[0] == {"name": "map", "parent": "", "depth": 0}


def test_a_value_becomes_a_message_for_the_emulated_robot() -> None:
    made = tree(stamped("map", "odom", (1, 2, 3), sec=4))
    again = TransformTree()
    assert again.update(tree_message(made.value(10)), 10) == []
    assert again.links["odom"].transform == Transform(1, 2, 3, 0, 0, 0, 1)
    assert again.links["odom"].stamp_s == 4


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"child_frame_id": ""}, "'' is not the name of a frame"),
        ({"child_frame_id": "/"}, "'/' is not the name of a frame"),
        ({"child_frame_id": 5}, "5 is not the name of a frame"),
        ({"child_frame_id": "x" * 101}, "more than 100 characters"),
        ({"header": {"frame_id": ""}}, "'' is not the name of a frame"),
        ({"header": None}, "lacks a frame"),
        ({"transform": {}}, "lacks a frame"),
        ({"transform": {"translation": {"x": 1}, "rotation": {}}}, "lacks a frame"),
    ],
)
def test_a_transform_without_a_part_is_described(change: dict[str, Any], reason: str) -> None:
    found = TransformTree().update({"transforms": [{**stamped("a", "b"), **change}]}, 1)
    assert len(found) == 1
    assert reason in found[0]


@pytest.mark.parametrize(
    ("move", "turn", "reason"),
    [
        ((None, 0, 0), (0, 0, 0, 1), "not made of numbers"),
        (("1", 0, 0), (0, 0, 0, 1), "not made of numbers"),
        ((math.nan, 0, 0), (0, 0, 0, 1), "exceeds 4e+07 m"),
        ((1e9, 0, 0), (0, 0, 0, 1), "exceeds 4e+07 m"),
        ((0, 0, 0), (0, 0, 0, 0), "not a unit quaternion"),
        ((0, 0, 0), (0, 0, 0, 1.1), "not a unit quaternion"),
        ((0, 0, 0), (0, 0, math.nan, 1), "not a unit quaternion"),
        ((10**400, 0, 0), (0, 0, 0, 1), "exceeds 4e+07 m"),
    ],
)
def test_a_transform_with_bad_numbers_is_rejected(move: Any, turn: Any, reason: str) -> None:
    """As tf2 does, also with its tolerance for quaternions."""
    made = tree(stamped("map", "odom", (1, 0, 0)))
    faults = made.update({"transforms": [stamped("map", "odom", move, turn, sec=2)]}, 11)
    assert len(faults) == 1
    assert reason in faults[0]
    assert place(made, "map", "odom") == (1, 0)


def test_a_slightly_long_quaternion_is_normalised() -> None:
    made = tree(stamped("a", "b", (0, 0, 0), (0, 0, 0, 1.004)))
    assert made.links["b"].transform.qw == 1.0


def test_good_transforms_beside_bad_ones_count_and_few_faults_are_told() -> None:
    made = TransformTree()
    bad = [stamped("", "x") for _ in range(50)]
    faults = made.update({"transforms": [*bad, stamped("map", "odom")]}, 1)
    assert len(faults) == 4
    assert faults[-1] == "47 more invalid transforms"
    assert "odom" in made.links


@pytest.mark.parametrize("raw", [None, 5, "x", [], {}, {"transforms": None}, {"transforms": {}}])
def test_a_message_without_transforms_is_described(raw: object) -> None:
    with pytest.raises(BadValue, match="no list of transforms"):
        TransformTree().update(raw, 1)


def test_a_flood_of_transforms_is_rejected_as_a_whole() -> None:
    made = TransformTree()
    many = [stamped("map", f"f{at}") for at in range(5000)]
    with pytest.raises(BadValue, match=f"5000 transforms; the limit is {MAX_TRANSFORMS}"):
        made.update({"transforms": many}, 1)
    assert not made.links


def test_the_number_of_frames_is_bounded_and_old_frames_make_room() -> None:
    made = tree(stamped("map", "kept"), is_static=True)
    for at in range(MAX_FRAMES - 1):
        assert made.update({"transforms": [stamped("map", f"f{at}")]}, 10) == []
    assert made.update({"transforms": [stamped("map", "late")]}, 20) == [
        f"the robot has more than {MAX_FRAMES} frames"
    ]
    assert len(made.links) == MAX_FRAMES
    assert made.update({"transforms": [stamped("map", "late")]}, 100) == []
    assert sorted(made.links) == ["kept", "late"]


def test_the_depth_is_bounded() -> None:
    made = TransformTree()
    for at in range(MAX_DEPTH):
        assert made.update({"transforms": [stamped(f"f{at}", f"f{at + 1}", (1, 0, 0))]}, 1) == []
    last = f"f{MAX_DEPTH}"
    assert place(made, "f0", last) == (MAX_DEPTH, 0)
    faults = made.update({"transforms": [stamped(last, "deeper")]}, 1)
    assert faults == [f"the frame 'deeper' is more than {MAX_DEPTH} transforms below the root"]


def test_a_tree_that_is_hung_below_a_deep_one_cannot_hold_up_a_lookup() -> None:
    """The depth of a moved subtree is not checked, but every search ends."""
    made = TransformTree()
    for at in range(MAX_DEPTH):
        made.update({"transforms": [stamped(f"f{at}", f"f{at + 1}")]}, 1)
        made.update({"transforms": [stamped(f"g{at}", f"g{at + 1}")]}, 1)
    made.update({"transforms": [stamped(f"f{MAX_DEPTH - 1}", "g0")]}, 1)
    with pytest.raises(NotConnected):
        made.lookup("f0", f"g{MAX_DEPTH}")
    assert len(made.value(1)["frames"]) == 2 * MAX_DEPTH + 2
