"""Names of ROS in a namespace."""

import pytest

from urc.ros_names import namespace_fault, relative_name, resolved_name


@pytest.mark.parametrize(
    ("name", "namespace", "absolute"),
    [
        ("odom", "robot1", "/robot1/odom"),
        ("odom", "/fleet/robot1/", "/fleet/robot1/odom"),
        ("odom", "", "/odom"),
        ("odom", "/", "/odom"),
        ("odom", None, "odom"),
        ("/map", "robot1", "/map"),
        ("~/state", "robot1", "~/state"),
        ("parameter:/base.rate", "robot1", "parameter:/base.rate"),
        ("", "robot1", ""),
    ],
)
def test_only_relative_names_are_resolved(name: str, namespace: str | None, absolute: str) -> None:
    assert resolved_name(name, namespace) == absolute
    if name == "odom":
        assert relative_name(absolute, namespace) == name


def test_names_outside_the_namespace_stay_absolute() -> None:
    assert relative_name("/robot10/odom", "robot1") == "/robot10/odom"


@pytest.mark.parametrize("namespace", ["robot 1", "1robot", "a//b", "a-b", "é", "x" * 300, "a\n"])
def test_invalid_namespaces_have_a_reason(namespace: str) -> None:
    assert namespace_fault(namespace)


@pytest.mark.parametrize("namespace", ["", "/", "robot1", "/fleet/robot_1/"])
def test_valid_namespaces_have_none(namespace: str) -> None:
    assert namespace_fault(namespace) == ""
