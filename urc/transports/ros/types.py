"""Type names of ROS 1 and ROS 2."""

__all__ = ["spelled"]


def spelled(name: str, kind: str, ros: int | None) -> str:
    """Return `name` in the form of that ROS version.

    Args:
        name: ``pkg/Type`` or ``pkg/msg/Type``; "" stays "".
        kind: the middle word: ``msg``, ``srv`` or ``action``.
        ros: 1, 2, or None: as written.
    """
    words = name.split("/")
    if ros is None or not all(words) or len(words) not in (2, 3):
        return name
    return f"{words[0]}/{words[-1]}" if ros == 1 else f"{words[0]}/{kind}/{words[-1]}"
