"""The filter `poses`: ROS poses from lists of positions and directions.

Private to `urc.filters.table`. The filter accepts any values from a document, and raises TypeError
or ValueError with a message for users.

Source: geometry_msgs/Pose and geometry_msgs/PoseStamped; angles as in REP 103.
"""

import math
from typing import Any, Final

__all__ = ["poses"]

MAX_POSES: Final = 4096


def poses(xs: Any, ys: Any, yaws: Any = None, frame: Any = None) -> list[dict[str, Any]]:
    """Return a pose for each position; with a frame, each pose has a header.

    Args:
        xs: numbers, in metres.
        ys: as many numbers, in metres.
        yaws: as many angles about z, in radians; none or an empty list for no rotation.
        frame: name of the coordinate frame of stamped poses, or none.
    """
    columns = [_numbers(one) for one in (xs, ys)]
    columns.append(_numbers(yaws) if yaws else [0.0] * len(columns[0]))
    lengths = [len(one) for one in columns]
    if len(set(lengths)) > 1:
        counts = ", ".join(map(str, lengths))
        raise ValueError(f"'poses' needs as many y and angles as x, found {counts}")
    if lengths[0] > MAX_POSES:
        raise ValueError(f"'poses' takes at most {MAX_POSES} positions")
    if frame is not None and not isinstance(frame, str):
        raise TypeError("'poses' needs the name of a frame as text")
    found = [_pose(*one) for one in zip(*columns, strict=True)]
    if frame is None:
        return found
    return [{"header": {"frame_id": frame}, "pose": one} for one in found]


def _pose(x: float, y: float, yaw: float) -> dict[str, Any]:
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}


def _numbers(value: Any) -> list[float]:
    if not isinstance(value, (list, tuple)):
        raise TypeError("'poses' needs lists of numbers")
    for one in value:
        is_number = isinstance(one, (int, float)) and not isinstance(one, bool)
        if not is_number or not math.isfinite(one):
            raise TypeError("'poses' needs lists of numbers")
    return list(value)
