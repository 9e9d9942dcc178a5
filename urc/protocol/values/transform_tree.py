"""Transform trees: the coordinate frames of a robot, from messages of the type tf2_msgs/TFMessage.

Pure. The tree keeps the newest transform of each frame, with the time of receipt and the robot's
timestamp. It has no history: URC shows the present, so it needs neither interpolation nor a buffer.
A transform that is older than the stored one is ignored, because two publishers may overtake each
other. It is accepted after a jump of the robot's clock by more than `CLOCK_JUMP_S`, and after a
series of such transforms.

Messages are untrusted. The number of frames, of transforms per message, and of frames in a chain
is limited. A transform that would close a cycle is rejected when it arrives, so every search ends.

Sources: tf2_msgs/TFMessage; REP 105; the checks and the tolerance for quaternions are those of
tf2's buffer.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple, TypeGuard

from urc.expressions import quoted
from urc.protocol.values.convert import BadValue, Unusable
from urc.protocol.values.foxglove_shapes import transforms_of
from urc.protocol.values.transforms import IDENTITY, Transform, compose, invert

__all__ = [
    "MAX_DEPTH",
    "MAX_FRAMES",
    "MAX_TRANSFORMS",
    "StoredTransform",
    "NotConnected",
    "TransformTree",
]

MAX_FRAMES: Final = 500
"""Maximum number of coordinate frames in a transform tree."""
MAX_TRANSFORMS: Final = 1000
"""Maximum number of transforms in one message; a larger message is rejected as a whole."""
MAX_DEPTH: Final = 100
"""Maximum number of transforms between a coordinate frame and the root of its tree."""
MAX_NAME: Final = 100
"""Maximum length of the name of a coordinate frame, in characters."""
CLOCK_JUMP_S: Final = 10.0
"""Difference between two timestamps beyond which the robot's clock was set, in seconds."""
FORGET_S: Final = 60.0
"""Age after which a transform may be dropped if the tree is full, in seconds."""
SET_BACK: Final = 5
"""Number of late transforms in a row, each newer than the one before, after which the robot's clock
was set back."""
RIVAL_S: Final = 10.0
"""Time within which a frame that returns to its previous parent has two publishers, in seconds."""
_FARTHEST_M: Final = 4e7
"""Maximum distance between two frames in metres: the Earth's circumference."""
_NORM_TOLERANCE: Final = 0.01
"""Tolerance for the squared norm of a quaternion, as in tf2."""
_SEARCH_S: Final = 1.0
"""Minimum time between two searches for old frames in a full tree, in seconds."""
_REPORTED: Final = 3
"""Maximum number of rejected transforms of one message that are described."""


class NotConnected(ValueError):
    """There is no chain of transforms between two frames; the message contains the reason."""


class StoredTransform(NamedTuple):
    """The newest transform from a frame to its parent."""

    parent: str
    transform: Transform
    time_s: float
    """Time of receipt in seconds, from the engine's monotonic clock."""
    stamp_s: float | None
    """Timestamp of the robot in seconds; None without a timestamp."""
    is_static: bool
    """Whether the transform is from the topic of static transforms, which never become stale."""
    previous: str = ""
    """Name of the previous parent; "" if the parent has never changed."""
    changed_s: float = -math.inf
    """Time of the last change of the parent, in seconds."""
    has_rival: bool = False
    """Whether two publishers report different parents in turn."""
    late: int = 0
    """Number of late transforms in a row, each newer than the one before."""
    late_stamp_s: float = -math.inf
    """Timestamp of the last late transform, in seconds."""


class TransformTree:
    """The coordinate frames of one connection."""

    def __init__(self) -> None:
        self.links: dict[str, StoredTransform] = {}
        """Newest transforms, keyed by the name of the child frame."""
        self._searched_s = -math.inf
        """Time of the last search for old frames, in seconds."""

    def clear(self) -> None:
        """Drop all frames; after a reconnection, old transforms would be wrong."""
        self.links.clear()
        self._searched_s = -math.inf

    def forget_stamps(self) -> None:
        """Drop all timestamps, after the robot's clock was set; the transforms remain."""
        self.links = {name: one._replace(stamp_s=None) for name, one in self.links.items()}

    def update(self, raw: object, now: float, *, is_static: bool = False) -> list[str]:
        """Store the transforms of a message; return descriptions of rejected transforms.

        Args:
            raw: the message's content as a mapping with the list ``transforms``, or one of the
                corresponding messages of Foxglove.
            now: time of receipt, in seconds.
            is_static: whether the message is from the topic of static transforms.

        Raises:
            BadValue: the whole message is invalid.
        """
        if isinstance(raw, Unusable):
            raise BadValue(raw.why)
        raw = transforms_of(raw)
        found = raw.get("transforms") if isinstance(raw, Mapping) else None
        if not isinstance(found, (list, tuple)):
            raise BadValue("the message has no list of transforms")
        if len(found) > MAX_TRANSFORMS:
            raise BadValue(f"a message with {len(found)} transforms; the limit is {MAX_TRANSFORMS}")
        faults: list[str] = []
        for one in found:
            try:
                self._add(one, now, is_static)
            except BadValue as fault:
                faults.append(str(fault))
        more = len(faults) - _REPORTED
        return faults if more <= 0 else [*faults[:_REPORTED], f"{more} more invalid transforms"]

    def _add(self, raw: Any, now: float, is_static: bool) -> None:
        try:
            child, parent = raw["child_frame_id"], raw["header"]["frame_id"]
            move, turn = raw["transform"]["translation"], raw["transform"]["rotation"]
            values = (
                move["x"], move["y"], move["z"], turn["x"], turn["y"], turn["z"], turn["w"],
            )  # fmt: skip
        except (KeyError, TypeError, IndexError):
            raise BadValue("a transform lacks a frame, a translation or a rotation") from None
        child, parent = _name(child), _name(parent)
        stamp_s = _stamp_of(raw["header"])
        last = self.links.get(child)
        if last is None or last.parent != parent:
            last = self._connect(child, parent, last, now)
        elif _is_late(stamp_s, last, now) and not is_static:
            late = last.late + 1 if stamp_s > last.late_stamp_s else 1
            last = self.links[child] = last._replace(late=late, late_stamp_s=stamp_s)
            if late < SET_BACK:
                return
        is_same = last.transform == values
        transform = last.transform if is_same else _checked(values, child)
        self.links[child] = last._replace(
            transform=transform, time_s=now, stamp_s=stamp_s, is_static=is_static, late=0
        )

    def _connect(
        self, child: str, parent: str, last: StoredTransform | None, now: float
    ) -> StoredTransform:
        """Return a link to another parent; raise `BadValue` if it would close a cycle."""
        path = [child]
        at = parent
        while at in self.links and len(path) <= MAX_DEPTH and at != child:
            path.append(at)
            at = self.links[at].parent
        if at == child:
            way = " → ".join((*path, child)) if len(path) <= 4 else f"{len(path)} frames"
            raise BadValue(f"a transform from {quoted(child)} closes a cycle: {way}")
        if len(path) > MAX_DEPTH:
            raise BadValue(
                f"the frame {quoted(child)} is more than {MAX_DEPTH} transforms below the root"
            )
        if last is None:
            self._make_room(now)
            return StoredTransform(parent, IDENTITY, now, None, False)
        has_rival = parent == last.previous and now - last.changed_s < RIVAL_S
        return last._replace(
            parent=parent, previous=last.parent, changed_s=now, has_rival=has_rival
        )

    def _make_room(self, now: float) -> None:
        if len(self.links) < MAX_FRAMES:
            return
        if now - self._searched_s < _SEARCH_S:
            raise BadValue(f"the robot has more than {MAX_FRAMES} frames")
        self._searched_s = now
        old = [
            name
            for name, one in self.links.items()
            if not one.is_static and now - one.time_s > FORGET_S
        ]
        for name in old:
            del self.links[name]
        if len(self.links) >= MAX_FRAMES:
            raise BadValue(f"the robot has more than {MAX_FRAMES} frames")

    def lookup(self, target: str, source: str) -> tuple[Transform, float]:
        """Return the transform from `source` to `target`, and the time of its oldest part.

        The time is when the oldest transform of the chain was received, in seconds; infinity if all
        transforms are static.

        Raises:
            NotConnected: a frame is unknown, or the frames are not connected.
        """
        target, source = target.lstrip("/"), source.lstrip("/")
        if target == source:
            return IDENTITY, math.inf
        up = self._chain(source)
        down = self._chain(target)
        place = {name: at for at, (name, _) in enumerate(up)}
        for after, (name, to_target) in enumerate(down):
            at = place.get(name)
            if at is not None:
                links = [self.links[one] for one, _ in (*up[:at], *down[:after])]
                times = (one.time_s for one in links if not one.is_static)
                found = compose(invert(to_target), up[at][1]) if after else up[at][1]
                return found, min(times, default=math.inf)
        for name in (source, target):
            if name not in self.links and all(one.parent != name for one in self.links.values()):
                raise NotConnected(f"the robot has no frame {quoted(name)}")
        raise NotConnected(f"the frames {quoted(source)} and {quoted(target)} are not connected")

    def _chain(self, frame: str) -> list[tuple[str, Transform]]:
        """Return a frame and its ancestors, each with the transform from `frame` to it."""
        found = [(frame, IDENTITY)]
        so_far = IDENTITY
        link = self.links.get(frame)
        while link is not None and len(found) <= MAX_DEPTH:
            so_far = compose(link.transform, so_far) if len(found) > 1 else link.transform
            found.append((link.parent, so_far))
            link = self.links.get(link.parent)
        return found

    def value(self, now: float) -> dict[str, Any]:
        """Return the tree as a value of a signal: all frames, parents before their children."""
        children: dict[str, list[str]] = {}
        for name, link in self.links.items():
            children.setdefault(link.parent, []).append(name)
        roots = sorted(name for name in children if name not in self.links)
        return {"frames": tuple(self._rows(roots, children, now))}

    def _rows(
        self, roots: list[str], children: Mapping[str, list[str]], now: float
    ) -> Iterator[dict[str, object]]:
        waiting = [(name, 0) for name in reversed(roots)]
        while waiting:
            name, depth = waiting.pop()
            link = self.links.get(name)
            yield (
                {"name": name, "parent": "", "depth": depth}
                if link is None
                else _row(name, depth, link, now)
            )
            waiting += [(one, depth + 1) for one in sorted(children.get(name, ()), reverse=True)]


def _row(name: str, depth: int, link: StoredTransform, now: float) -> dict[str, object]:
    x, y, z, *turn = link.transform
    row: dict[str, object] = {
        "name": name,
        "parent": link.parent,
        "depth": depth,
        "translation": (round(x, 4), round(y, 4), round(z, 4)),
        "rotation": tuple(round(one, 5) for one in turn),
        "age": None if link.is_static else round(now - link.time_s, 3),
    }
    if link.stamp_s is not None and not link.is_static:
        row["stamp"] = round(link.stamp_s, 3)
    if link.has_rival and now - link.changed_s < RIVAL_S:
        row["other_parent"] = link.previous
    return row


def _name(raw: object) -> str:
    """Return the name of a frame; before tf2, names began with a slash."""
    name = raw.lstrip("/") if isinstance(raw, str) else ""
    if not name:
        raise BadValue(f"{quoted(raw)} is not the name of a frame")
    if len(name) > MAX_NAME:
        raise BadValue(f"the name of a frame has more than {MAX_NAME} characters")
    return name


def _checked(values: tuple[Any, ...], child: str) -> Transform:
    """Return a transform with a unit quaternion; raise `BadValue` for invalid numbers."""
    try:
        x, y, z, qx, qy, qz, qw = values
        norm2 = qx * qx + qy * qy + qz * qz + qw * qw
        is_place = abs(x) <= _FARTHEST_M and abs(y) <= _FARTHEST_M and abs(z) <= _FARTHEST_M
    except (TypeError, OverflowError):
        raise BadValue(f"the transform of {quoted(child)} is not made of numbers") from None
    if not abs(norm2 - 1) <= _NORM_TOLERANCE:
        raise BadValue(f"the rotation of {quoted(child)} is not a unit quaternion")
    if not is_place:
        raise BadValue(f"the translation of {quoted(child)} exceeds {_FARTHEST_M:g} m")
    if norm2 == 1:
        return Transform(*values)
    norm = math.sqrt(norm2)
    return Transform(x, y, z, qx / norm, qy / norm, qz / norm, qw / norm)


def _stamp_of(header: Mapping[str, Any]) -> float | None:
    """Return the timestamp of a header in seconds; ROS 1 has other names for its parts."""
    stamp = header.get("stamp")
    if not isinstance(stamp, Mapping):
        return None
    whole = stamp.get("sec", stamp.get("secs"))
    part = stamp.get("nanosec", stamp.get("nsecs"))
    if isinstance(whole, int) and isinstance(part, int) and 0 <= part < 10**9:
        return whole + part / 1e9 if -(2**31) <= whole < 2**32 else None
    return None


def _is_late(stamp_s: float | None, last: StoredTransform, now: float) -> TypeGuard[float]:
    """Return whether a transform is older than the stored one, and not from a changed clock."""
    if stamp_s is None or last.stamp_s is None or now - last.time_s >= CLOCK_JUMP_S:
        return False
    return 0 < last.stamp_s - stamp_s <= CLOCK_JUMP_S


def tree_message(value: object) -> object:
    """Return the message of a tree's value, for emulated robots; return other values unchanged."""
    rows = value.get("frames") if isinstance(value, Mapping) else None
    if not isinstance(rows, (list, tuple)):
        return value
    return {"transforms": [_message_of(row) for row in rows if row.get("parent")]}


def _message_of(row: Mapping[str, Any]) -> dict[str, object]:
    stamp_s = row.get("stamp") or 0.0
    return {
        "header": {
            "stamp": {"sec": int(stamp_s), "nanosec": int(stamp_s % 1 * 1e9)},
            "frame_id": row["parent"],
        },
        "child_frame_id": row["name"],
        "transform": {
            "translation": dict(zip("xyz", row["translation"], strict=True)),
            "rotation": dict(zip("xyzw", row["rotation"], strict=True)),
        },
    }
