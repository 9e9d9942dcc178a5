"""A widget's ``demo.yaml``: its states, each as a small robot with fixed values.

Layer 5. The gallery, the tests and the manual's images use these states.
"""

import base64
import binascii
import json
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc.images import media_type
from urc.model.driver import Argument, Command, Driver, Reply, TransportSpec
from urc.model.exchange import Hold
from urc.model.interface import Interface, WidgetUse
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.profile import Profile
from urc.model.values import AlarmLimits, Signal
from urc.model.widget import Widget, WidgetPort
from urc.problems import ProblemsError, UrcError
from urc.protocol.values.occupancy_grid import Grid, encode_grid
from urc.protocol.values.point_cloud import encode_cloud, packed_cloud
from urc.source import Document, read_document
from urc.web.show.demo_shape import check_demo
from urc.web.wire.messages import encode_hello

__all__ = ["WidgetState", "demo_states", "colour_bars"]

PICTURE_BYTES = 4 << 20
"""Maximum size of a demo image, in bytes."""
_CELLS: Final = {"#": 100, ".": 0, " ": 255, **{str(tenth): 10 * tenth for tenth in range(1, 10)}}
"""Cell of an occupancy grid, by letter in a demo."""
_BARS = ((0xC0,) * 3, (0xC0, 0xC0, 0), (0, 0xC0, 0xC0), (0, 0xC0, 0), (0xC0, 0, 0xC0), (0xC0, 0, 0))


class WidgetState(NamedTuple):
    """One state of a widget, ready for rendering."""

    name: str
    use: WidgetUse
    profile: Profile
    """Profile of a robot with only this widget and without connections."""
    news: str
    """Values of the robot, as JSON for ``gallery.js``."""
    shows: tuple[str, ...]
    """Texts that the widget must show in this state."""


def demo_states(widget: Widget) -> list[WidgetState]:
    """Return the states in the widget's ``demo.yaml``, in the file's order.

    Raises:
        ProblemsError: the demo is missing or invalid.
    """
    document = read_document(str(widget.folder / "demo.yaml"))
    problems = check_demo(widget, document)
    if problems:
        raise ProblemsError(problems)
    demo: Any = document.data
    return [_state(widget, document, demo, name) for name in demo["states"]]


def _state(widget: Widget, document: Document, demo: Mapping[str, Any], name: str) -> WidgetState:
    shown: Mapping[str, Any] = demo["states"][name] or {}
    signals, inputs, lists = _signals(
        {**(demo.get("signals") or {}), **(shown.get("signals") or {})}
    )
    commands, outputs = _commands(widget, demo.get("outputs") or {})
    options = {**_defaults(widget), **(shown.get("options") or {})}
    use = WidgetUse(name, widget.name, inputs, outputs, options, shown.get("title", ""))
    use = use._replace(lists=lists)
    driver = Driver({"wire": TransportSpec("wire", "tcp")}, signals, commands=commands)
    profile = Profile(
        name="demo",
        title="Demo",
        file=str(widget.folder / "demo.yaml"),
        driver=driver,
        slots={name: use},
        interfaces={"default": Interface("default")},
        widgets={widget.name: widget},
    )
    images = _images(widget, document, name, shown)
    news = {
        "hello": json.loads(encode_hello(profile, "demo", 0.0)),
        "readings": list(_readings(shown, images, inputs, lists)),
        "history": shown.get("history") or {},
        "follow": shown.get("follow") or {},
        "replies": shown.get("replies") or {},
    }
    texts = tuple(str(text) for text in shown.get("shows") or ())
    return WidgetState(name, use, profile, json.dumps(news), texts)


def _signals(
    declared: Mapping[str, Any],
) -> tuple[dict[str, Signal], dict[str, str], dict[str, tuple[str, ...]]]:
    """Return the signals, the bindings of single inputs, and the bindings of multiple inputs."""
    signals: dict[str, Signal] = {}
    inputs: dict[str, str] = {}
    lists: dict[str, tuple[str, ...]] = {}
    for name, given in declared.items():
        if isinstance(given, list):
            lists[name] = tuple(f"{name}_{place}" for place in range(len(given)))
            signals |= {
                signal: _signal(signal, one) for signal, one in zip(lists[name], given, strict=True)
            }
        else:
            inputs[name] = name
            signals[name] = _signal(name, given)
    return signals, inputs, lists


def _signal(name: str, given: Mapping[str, Any]) -> Signal:
    limits = AlarmLimits(**(given.get("limits") or {}))
    states = tuple((str(raw), str(word)) for raw, word in dict(given.get("states") or {}).items())
    return Signal(name, **{**given, "limits": limits, "states": states})


def _commands(
    widget: Widget, bound: Mapping[str, Any]
) -> tuple[dict[str, Command], dict[str, str]]:
    commands: dict[str, Command] = {}
    outputs: dict[str, str] = {}
    for output, given in bound.items():
        spec = {"command": given} if isinstance(given, str) else given
        name = str(spec["command"])
        outputs[output] = name
        commands[name] = _command(name, widget.outputs.get(output, WidgetPort(output)), spec)
    return commands, outputs


def _command(name: str, port: WidgetPort, spec: Mapping[str, Any]) -> Command:
    given = spec.get("arguments")
    if given is None:
        arguments = {one: Argument(one, min=-1, max=1, default=0.0) for one in port.arguments}
    else:
        arguments = {one: _argument(one, more or {}) for one, more in given.items()}
    return Command(
        name,
        "wire",
        WriteSpec("text"),
        arguments,
        reply=Reply(ReadSpec("regex")) if spec.get("reply") else None,
        title=spec.get("title", ""),
        hold=Hold(0.05) if port.is_held else None,
    )


def _argument(name: str, given: Mapping[str, Any]) -> Argument:
    return Argument(name, **{**given, "choices": tuple(given.get("choices") or ())})


def _defaults(widget: Widget) -> dict[str, object]:
    return {
        name: schema["default"]
        for name, schema in widget.options.items()
        if isinstance(schema, Mapping) and "default" in schema
    }


def _readings(
    shown: Mapping[str, Any],
    images: Mapping[str, Any],
    inputs: Mapping[str, str],
    lists: Mapping[str, tuple[str, ...]],
) -> Iterator[dict[str, Any]]:
    """Yield one reading per signal: its value or image, its age in seconds and its alarm."""
    ages, alarms = shown.get("age_s", 0.0), shown.get("alarms") or {}
    for name, value in (shown.get("values") or {}).items():
        many = name in lists
        names = lists[name] if many else (inputs[name],)
        age_s = ages.get(name, 0.0) if isinstance(ages, Mapping) else ages
        for place, signal in enumerate(names):
            alarm = alarms.get(name, "")
            one = {
                "signal": signal,
                "age": _nth(age_s, place),
                "alarm": _nth(alarm, place) if many else alarm,
            }
            found = images.get(name)
            if isinstance(found, list):
                yield {**one, **found[place]}
            else:
                yield {**one, **(found or {"value": value[place] if many else value})}


def _nth(given: Any, place: int) -> Any:
    return given[place] if isinstance(given, list) else given


def _images(
    widget: Widget, document: Document, state: str, shown: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the images among a state's values, by input: one image, or one for each signal."""
    images: dict[str, Any] = {}
    for name, value in (shown.get("values") or {}).items():
        try:
            many = [_image(widget, one) for one in value] if isinstance(value, list) else []
            data = None if many else _image(widget, value)
        except UrcError as error:
            path = ("states", state, "values", name)
            raise ProblemsError([document.problem(path, "bad-value", str(error))]) from error
        if data is not None:
            images[name] = _encoded(data)
        elif many and None not in many:
            images[name] = [_encoded(one) for one in many if one is not None]
    return images


def _encoded(data: bytes) -> dict[str, Any]:
    return {"picture": base64.b64encode(data).decode(), "type": media_type(data)}


def _image(widget: Widget, value: Any) -> bytes | None:
    """Return a generated, stored or inline image; None if the value is not an image."""
    match value:
        case {"picture": [int(width), int(height)], **more} if not more:
            return colour_bars(width, height)
        case {"picture": _, **more} if not more:
            raise UrcError("a test picture is written as [width, height]")
        case {"file": name, **more} if not more:
            return _file(widget.folder, str(name))
        case {"base64": text, **more} if not more:
            return _decoded(str(text))
        case {"rows": [str(), *_] as rows, **more}:
            return _grid(rows, {str(name): one for name, one in more.items()})
        case {"points": [[_, _, _, _], *_] as points, **more} if not more:
            return _cloud(points)
    return None


def _grid(rows: list[str], place: Mapping[str, Any]) -> bytes:
    """Return an occupancy grid drawn with letters, the far row first.

    ``#`` is occupied, ``.`` is free, a space is unknown, and a digit is ten times its value.
    """
    width = len(rows[0])
    if not width or any(len(row) != width or set(row) - _CELLS.keys() for row in rows):
        raise UrcError(f"the rows of a grid have equal lengths and the letters {''.join(_CELLS)!r}")
    cells = bytes(_CELLS[letter] for row in reversed(rows) for letter in row)
    try:
        numbers = {name: float(place.get(name, 0)) for name in ("x", "y", "yaw")}
        return encode_grid(
            Grid(width, len(rows), float(place["resolution"]), **numbers, frame="map", cells=cells)
        )
    except (KeyError, TypeError, ValueError) as fault:
        raise UrcError(f"a grid needs numbers for resolution, x, y and yaw: {fault}") from fault


def _cloud(points: list[list[Any]]) -> bytes:
    """Return a point cloud; each point has x, y and z in metres, and an intensity."""
    try:
        values = [[float(value) for value in point] for point in points]
        columns = dict(zip(("x", "y", "z", "intensity"), zip(*values, strict=True), strict=True))
    except (TypeError, ValueError) as fault:
        raise UrcError(f"a point of a cloud has four numbers: {fault}") from fault
    return encode_cloud(packed_cloud("base_link", "intensity", len(points), columns))


def _decoded(text: str) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise UrcError(f"base64: {error}") from error


def _file(folder: Path, name: str) -> bytes:
    """Return a file in the widget's folder; raise `UrcError` for any other path."""
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()) or not path.is_file():
        raise UrcError(f"there is no file {name!r} in the widget's folder")
    if path.stat().st_size > PICTURE_BYTES:
        raise UrcError(f"{name!r} is larger than {PICTURE_BYTES} bytes")
    return path.read_bytes()


def colour_bars(width: int, height: int) -> bytes:
    """Return a PNG with colour bars above a grey ramp; the bytes depend only on the size."""
    if not (1 <= width <= 2048 and 1 <= height <= 2048):
        raise UrcError(
            f"expected a test picture of 1 to 2048 pixels per side, found {width} x {height}"
        )
    bars = b"".join(bytes(_BARS[x * len(_BARS) // width]) for x in range(width))
    ramp = b"".join(bytes((x * 255 // max(1, width - 1),) * 3) for x in range(width))
    rows = b"".join(b"\0" + (bars if y < height * 2 // 3 else ramp) for y in range(height))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows, 6)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )
