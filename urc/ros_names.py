"""Names of topics, services and actions in ROS, and the namespace of a robot. Pure.

A name that begins with ``/`` is absolute. All other names are relative: they belong to the robot's
namespace, as for a node of this robot. Source: ROS 2 design, “Topic and Service name mapping”.
"""

import re
from typing import Final

__all__ = ["namespace_fault", "relative_name", "resolved_name"]

_NAMESPACE: Final = re.compile(r"/?(?:[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*)?/?")
_LONGEST: Final = 200


def namespace_fault(namespace: str) -> str:
    """Return the reason why a namespace is invalid, or ""."""
    if len(namespace) > _LONGEST:
        return f"it has more than {_LONGEST} characters"
    if _NAMESPACE.fullmatch(namespace):
        return ""
    return "it must consist of words of letters, digits and _, separated by /, such as fleet/robot1"


def resolved_name(name: str, namespace: str | None) -> str:
    """Return the absolute form of a name.

    Args:
        name: name as written. Empty names, and names that are not of ROS (``parameter:/a``), stay
            unchanged.
        namespace: the namespace, with or without ``/`` at its ends; "" is the root. None leaves all
            names unchanged.
    """
    if namespace is None or not name or name[0] in "/~" or ":" in name:
        return name
    return f"{_prefix(namespace)}{name}"


def relative_name(name: str, namespace: str | None) -> str:
    """Return the relative form of an absolute name in a namespace; other names unchanged."""
    return name if namespace is None else name.removeprefix(_prefix(namespace))


def _prefix(namespace: str) -> str:
    inner = namespace.strip("/")
    return f"/{inner}/" if inner else "/"
