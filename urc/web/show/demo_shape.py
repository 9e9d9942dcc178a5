"""The JSON Schema of a widget's ``demo.yaml``, generated from the widget's manifest.

Layer 5. The gallery and `urc validate` use the same schema, so their results agree.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from urc.config.shape.check import check_inline, check_options
from urc.model.values import BINARY_TYPES
from urc.model.widget import Widget
from urc.problems import Problem
from urc.source import Document

__all__ = ["check_demo"]

_TEXT: Final = {"type": "string"}
_NUMBER: Final = {"type": "number"}
_COUNT: Final = {"type": "integer", "minimum": 0}
_FLAG: Final = {"type": "boolean"}
_WORDS: Final = ("lolo", "low", "high", "hihi")
_SEVERITIES: Final = ("minor", "major")
_ALARM: Final = {
    "if": {"type": "array"},
    "then": {"items": {"enum": ["", *_WORDS, *_SEVERITIES]}},
    "else": {"enum": [*_WORDS, *_SEVERITIES]},
}
_ELEMENTS: Final = ["integer", "number", "boolean", "string"]
_TYPES: Final = [*_ELEMENTS, "array", "object", "transform_tree", *BINARY_TYPES]


def _mapping(title: str, properties: Mapping[str, Any], *required: str) -> dict[str, Any]:
    """Return the schema of a mapping that permits only the keys in `properties`."""
    return {
        "title": title,
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


_VALUE: Final = {
    "title": _TEXT,
    "unit": _TEXT,
    "min": _NUMBER,
    "max": _NUMBER,
    "description": _TEXT,
    "items": {"enum": _ELEMENTS},
    "size": _COUNT,
}
"""Schema properties that the signals and arguments of a demo have in common."""
_SIGNAL: Final = _mapping(
    "signal of a demo",
    {
        **_VALUE,
        "type": {"enum": _TYPES},
        "precision": _COUNT,
        "states": {"type": "object"},
        "limits": _mapping(
            "the limits of a signal",
            dict.fromkeys((*_WORDS, "hysteresis", "for_s"), _NUMBER),
        ),
        "stale_after_s": _NUMBER,
        "axes": {"enum": ["", "FLU", "FRD", "ENU", "NED", "bearing"]},
        "deadband": _NUMBER,
        "debounce_s": _NUMBER,
    },
)
_ARGUMENT: Final = _mapping(
    "argument of a demo",
    {
        **_VALUE,
        "type": {"enum": [*_ELEMENTS, "array"]},
        "choices": {"type": "array"},
        "default": True,
        "is_required": _FLAG,
        "allows_control": _FLAG,
    },
) | {"type": ["object", "null"]}
_OUTPUT: Final = {
    "type": ["string", "object"],
    "if": _TEXT,
    "else": _mapping(
        "output of a demo",
        {
            "command": _TEXT,
            "title": _TEXT,
            "reply": _FLAG,
            "arguments": {"type": "object", "additionalProperties": _ARGUMENT},
        },
        "command",
    ),
}
_FOLLOW: Final = dict.fromkeys(
    ("links", "log", "lease", "alarms", "watched", "latency", "sequences", "theme", "stop"), True
)


def check_demo(widget: Widget, document: Document) -> list[Problem]:
    """Return all problems in a demo.

    A demo's states refer to its bindings, so the states' options are checked only if the bindings
    are valid.
    """
    data = document.data
    problems = check_inline(document, (), data, _demo(widget, data))
    bound = [one for one in problems if one.path.partition(".")[0] in ("signals", "outputs")]
    if bound or not isinstance(data, dict):
        return bound or problems
    for name, state in _part(data, "states").items():
        options = _part(state, "options")
        problems += check_options(document, ("states", name, "options"), options, widget.options)
    return sorted(problems, key=lambda one: (one.line, one.column))


def _demo(widget: Widget, data: Any) -> dict[str, Any]:
    signals = _part(data, "signals")
    outputs = _part(data, "outputs")
    ports = {
        name: {"type": "array", "items": _SIGNAL} if port.is_multiple else _SIGNAL
        for name, port in widget.inputs.items()
    }
    bound = _mapping("the inputs of this widget", ports) | {"type": ["object", "null"]}
    plain = _state(bound, signals, outputs)
    own = {
        name: _state(bound, {**signals, **_part(given, "signals")}, outputs)
        for name, given in _part(data, "states").items()
    }
    states = {
        **_mapping("the states of a demo", {"normal": plain, **own}, "normal"),
        "additionalProperties": plain,
    }
    parts = {
        "signals": bound,
        "outputs": _mapping("the outputs of this widget", dict.fromkeys(widget.outputs, _OUTPUT))
        | {"type": ["object", "null"]},
        "states": states,
    }
    return _mapping("demo", parts, "states")


def _part(data: Any, key: str) -> dict[str, Any]:
    found = data.get(key) if isinstance(data, dict) else None
    return found if isinstance(found, dict) else {}


def _state(
    bound: Mapping[str, Any], signals: Mapping[str, Any], outputs: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the schema of a state, given the signals of the state and of the whole demo."""
    values = {name: _values(given) for name, given in signals.items()}
    past = {"type": "array", "items": {"type": "array", "minItems": 2, "maxItems": 2}}
    answered = {*outputs, *_commands(outputs.values())}
    state = _mapping(
        "state of a demo",
        {
            "signals": bound,
            "values": _mapping("the signals of this demo", values),
            "title": _TEXT,
            "options": {"type": "object"},
            "age_s": _ages(signals),
            "alarms": _mapping("the signals of this demo", dict.fromkeys(signals, _ALARM)),
            "history": _mapping("the signals of this demo", dict.fromkeys(_single(signals), past)),
            "follow": _mapping("the topics that a widget follows", _FOLLOW),
            "replies": _mapping("the commands of this demo", dict.fromkeys(answered, True)),
            "shows": {"type": "array"},
        },
    )
    return state | {"type": ["object", "null"]}


def _values(given: Any) -> dict[str, Any]:
    """Return the schema of a value; a multiple input requires one value for each signal."""
    if not isinstance(given, list):
        return {}
    return {"type": "array", "minItems": len(given), "maxItems": len(given)}


def _ages(names: Iterable[str]) -> dict[str, Any]:
    """Return the schema of ages: one age for all signals, or one age per signal."""
    age = {"if": {"type": "array"}, "then": {"items": _NUMBER}, "else": _NUMBER}
    named = _mapping("the signals of this demo", dict.fromkeys(names, age))
    return {"type": ["number", "object"], "if": {"type": "object"}, "then": named}


def _single(signals: Mapping[str, Any]) -> list[str]:
    """Return the names of individual signals; a list of signals adds one name per element."""
    names = []
    for name, given in signals.items():
        many = isinstance(given, list)
        names += [f"{name}_{place}" for place in range(len(given))] if many else [name]
    return names


def _commands(outputs: Iterable[Any]) -> list[str]:
    return [
        str(given.get("command", "")) if isinstance(given, dict) else str(given)
        for given in outputs
    ]
