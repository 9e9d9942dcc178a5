"""The profile of a mobile base, written from the topics of a robot."""

from itertools import combinations
from pathlib import Path

import pytest

from urc.problems import UrcError
from urc.runtime.ros_profile import BaseProfile, candidates, document_of, settings_of
from urc.transports.ros.topic_list import TopicList, TopicRow
from urc.web.dev.watch import examine

OPTIONAL = ("scan", "camera", "battery", "map", "imu")
SETS = [one for count in range(6) for one in combinations(OPTIONAL, count)]


def base(parts: tuple[str, ...] = (), version: int = 2, **how: object) -> BaseProfile:
    topics = {"cmd_vel": "/base/cmd_vel", "odom": "/o"} | {name: f"/x/{name}" for name in parts}
    title = 'My "base" – ☺: #x'
    made = BaseProfile(
        "scout", title, "10.0.0.7", 7447, "zenoh", version, topics, is_stamped=version == 2
    )
    return made._replace(**how)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("parts", SETS, ids="-".join)
def test_every_choice_of_parts_is_a_valid_profile(
    parts: tuple[str, ...], version: int, tmp_path: Path
) -> None:
    """Without errors or warnings, and its tests succeed."""
    file = tmp_path / "scout.yaml"
    file.write_text(document_of(base(parts, version)), encoding="utf-8")
    checked = examine(str(file))
    assert [one.headline for one in checked.problems] == []
    assert checked.profile is not None
    known = checked.profile.settings
    assert settings_of(base(parts, version)).keys() <= known.keys()
    assert checked.profile.title == base().title
    usual = "camera/image_raw/compressed"
    assert known["camera"].default == (usual if "camera" in parts else "")


@pytest.mark.parametrize("lacks", ["cmd_vel", "odom"])
def test_a_robot_that_cannot_be_driven_gets_no_profile(lacks: str) -> None:
    topics = {name: topic for name, topic in base().topics.items() if name != lacks}
    with pytest.raises(UrcError, match=f"needs a topic for {lacks}"):
        document_of(base(topics=topics))


def rows(*listed: TopicRow) -> dict[str, list[tuple[str, str]]]:
    return candidates(TopicList(listed, len(listed), 2, True, True))


def test_the_usual_names_come_first() -> None:
    odometry = ("nav_msgs/msg/Odometry",)
    names = ("/a/truth", "/robot1/odom", "/odom", "/x/y/odom")
    found = rows(*(TopicRow(name, odometry) for name in names))
    assert [name for name, _ in found["odom"]] == [
        "/odom",
        "/robot1/odom",
        "/x/y/odom",
        "/a/truth",
    ]
    assert found["scan"] == []


def test_the_type_of_commands_is_that_of_the_subscribers() -> None:
    """A joystick that publishes Twist is not asked."""
    twist, stamped = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
    takes = TopicRow("/cmd_vel", (twist,), (stamped,), ("/joy",), ("/base",))
    unheard = TopicRow("/other/cmd_vel", (twist,), (twist,), ("/joy",), ())
    unknown = TopicRow("/third/cmd_vel", (twist,), (twist,))
    found = rows(takes, unheard, unknown)["cmd_vel"]
    assert found == [
        ("/cmd_vel", "geometry_msgs/TwistStamped"),
        ("/third/cmd_vel", "geometry_msgs/Twist"),
    ]


def test_a_command_topic_of_unknown_type_is_offered_by_its_name() -> None:
    """As rosapi of ROS 1 reports a topic that nothing publishes."""
    found = rows(
        TopicRow("/robot1/cmd_vel", subscribers=("/base",)),
        TopicRow("/goal", subscribers=("/base",)),
        TopicRow("/other/cmd_vel", subscribers=()),
        TopicRow("/odom", publishers=("/base",)),
    )
    assert found["cmd_vel"] == [("/robot1/cmd_vel", "")]
    assert found["odom"] == []


def test_names_that_no_document_should_contain_are_left_out() -> None:
    """Templates, quotes and other characters that ROS does not allow."""
    odometry = ("nav_msgs/msg/Odometry",)
    names = ('/o"dom', "/{{ 7 }}", "/od\\x1bom", "/ödom", "/o dom", "", "/")
    assert rows(*(TopicRow(name, odometry) for name in names))["odom"] == []
