"""Replaces a driver's parameters, such as ``{params.id}``, in keys and texts.

Each robot sets the values of its driver's parameters, and URC inserts them while it loads the
documents. The operator, in contrast, provides the values of settings.
"""

from collections.abc import Mapping
from typing import Any, Final

from urc.config.compose.fill import ExpansionBudget, ExpansionTooLarge, fill, report_unquoted
from urc.config.compose.merge import Tree, count_nodes
from urc.config.node import Node, Problems
from urc.config.schemas import fits
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import check_range, check_within, fit, fit_hint
from urc.model.values import Value
from urc.source import Document, Mark, Path

__all__ = ["fill_params"]

_NODES_MOST: Final = 10_000
_SAMPLES: Final[Mapping[str, Value]] = {
    "integer": 1, "number": 1.0, "boolean": False, "string": "sample",
}  # fmt: skip


def fill_params(
    document: Document, given: Node | None, use: Node | None, problems: Problems
) -> Document:
    """Return a driver's document with its parameters replaced.

    `given` contains the robot's values, and `use` is the robot's reference to the driver. To check
    a driver without a robot, pass None for both. Each parameter without a default then gets a
    sample value of its type.
    """
    data = document.data
    if not isinstance(data, dict):
        return document
    if "params" not in data:
        if given is not None:
            for inner in given.entries().values():
                _report_unknown(inner, (), problems)
        return document
    if not fits("driver.schema.json#/$defs/params", data["params"]):
        return document  # the shape pass reports it
    part = Node(document, (), data).must("params")
    values = _values(part, given, use, problems)
    filler = _ParameterFiller(document, values, problems)
    result = filler.document()
    for name, inner in part.entries().items():
        if name not in filler.used:
            problems.warn(
                inner,
                "unused-param",
                f"nothing uses the parameter {name!r}",
                key=True,
                hint=f"write {{params.{name}}} in place of the value",
            )
    return result


def _values(
    part: Node, given: Node | None, use: Node | None, problems: Problems
) -> dict[str, Value]:
    gifts = given.entries() if given is not None else {}
    for name, gift in gifts.items():
        if name not in part.data:
            _report_unknown(gift, part.data, problems)
    values = {}
    for name, inner in part.entries().items():
        kind = inner.text("type", "string")
        bounds = check_range(inner, kind, problems)
        choices = [choice.data for choice in inner.listed("choices")]
        default = inner.get("default")
        if default is not None:
            _checked(default, kind, bounds, choices, problems)
        own = gifts.get(name)
        if own is not None:
            values[name] = _checked(own, kind, bounds, choices, problems)
        elif default is not None:
            values[name] = default.data
        else:
            values[name] = _sample(kind, bounds, choices)
            if use is not None:
                problems.error(
                    use,
                    "missing-param",
                    f"this driver needs the parameter {name!r}",
                    key=True,
                    hint=f"write driver: {{ use: …, params: {{ {name}: … }} }}",
                )
    return values


def _report_unknown(gift: Node, known: Mapping[str, Any] | tuple[()], problems: Problems) -> None:
    problems.error(
        gift,
        "unknown-param",
        f"the driver has no parameter {gift.name!r}",
        key=True,
        hint=did_you_mean(gift.name, known, "parameters"),
    )


def _checked(
    part: Node,
    kind: str,
    bounds: tuple[float | None, float | None],
    choices: list[Value],
    problems: Problems,
) -> Value:
    if any(type(part.data) is type(one) and part.data == one for one in choices):
        return part.data  # type: ignore[no-any-return]  # choices may have several types
    try:
        value = fit(part.data, kind)
    except ValueError as error:
        problems.error(part, "wrong-type", str(error), hint=fit_hint(part.data, kind))
        return _SAMPLES[kind]
    check_within(value, *bounds, part, problems)
    if choices and value not in choices:
        problems.error(
            part,
            "unknown-word",
            f"{value!r} is not one of the choices",
            hint=did_you_mean(str(value), map(str, choices), "choices"),
        )
    return value


def _sample(kind: str, bounds: tuple[float | None, float | None], choices: list[Value]) -> Value:
    if choices:
        return choices[0]
    low, high = bounds
    value = _SAMPLES[kind]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if low is not None and value < low:
            return low
        if high is not None and value > high:
            return high
    return value


class _ParameterFiller:
    """Replaces the parameters in one document and records which parameters it uses."""

    def __init__(self, document: Document, values: Mapping[str, Value], problems: Problems) -> None:
        self.used: set[str] = set()
        self._document = document
        self._values = values
        self._problems = problems

    def document(self) -> Document:
        document, data = self._document, self._document.data
        assert isinstance(data, dict)  # noqa: S101 - checked by the caller
        budget = ExpansionBudget(_NODES_MOST - count_nodes(data) + len(data))
        value: dict[str, object] = {}
        marks: dict[str | int, Mark] = {}
        for key, item in data.items():
            tree = Tree(item, document.mark.children[key], document)
            if key != "params":
                try:
                    names = {"params": _RecordedValues(self._values, self.used)}
                    tree = fill(tree, (key,), names, budget, self)
                except ExpansionTooLarge:
                    self._problems.error(
                        Node(document, (key,), item),
                        "too-large",
                        "the text is too long after its parameters are replaced",
                        key=True,
                    )
            value[key], marks[key] = tree.value, tree.mark
        mark = document.mark.copy(marks)
        return Document(
            document.file, document.text, document.lines, value, mark, document.problems
        )

    def unquoted(self, path: Path, text: str) -> None:
        """Report a name in braces that YAML reads as a mapping."""
        report_unquoted(Node(self._document, path, None), text, self._problems)

    def unknown(self, path: Path, name: str, word: str, offset: int) -> None:
        """Report a parameter that the driver does not declare."""
        place: dict[str, Any] = {"offset": offset, "length": len(name) + len(word) + bool(word)}
        self._problems.error(
            Node(self._document, path, None),
            "unknown-param",
            f"there is no parameter {word!r}"
            if word
            else "'params' contains all parameters; name one of them",
            hint=did_you_mean(word, self._values, "parameters"),
            **place,
        )


class _RecordedValues(Mapping[str, Value]):
    """A mapping of values that records each name that is looked up."""

    def __init__(self, values: Mapping[str, Value], used: set[str]) -> None:
        self._values = values
        self._used = used

    def __getitem__(self, name: str) -> Value:
        self._used.add(name)
        return self._values[name]

    def __contains__(self, name: object) -> bool:
        return name in self._values

    def __iter__(self) -> Any:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)
