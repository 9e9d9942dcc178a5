"""Parser for widget manifests and reader for a folder of widgets."""

import re
from collections.abc import Iterable
from pathlib import Path as FilePath
from typing import cast

from urc.config.node import Node, Problems
from urc.config.schemas import kind_of
from urc.config.shape.check import check_options, check_shape
from urc.config.spelling_suggestions import did_you_mean
from urc.model.widget import Footprint, Widget, WidgetPort
from urc.problems import Problem, ProblemsError, has_errors
from urc.source import Document, read_document

__all__ = ["WidgetFolder", "parse_widget"]

_NAME = re.compile(r"[a-z][a-z0-9-]{0,63}")


def parse_widget(document: Document, problems: Problems) -> Widget:
    """Return the widget that a manifest declares."""
    part = Node(document, (), document.data)
    folder = FilePath(document.file).parent
    name = part.text("name")
    if folder.absolute().name != name:
        problems.error(
            part,
            "wrong-name",
            f"the folder has the name {folder.absolute().name!r}, but the widget has the name"
            f" {name!r}",
            at="name",
            hint="give the folder and the widget the same name",
        )
    size = part.get("size")
    smallest = [int(inner.data) for inner in size.listed("min")] if size else []
    options = part.get("options")
    if options is not None:
        _check_defaults(options, problems)
    widget = Widget(
        name=name,
        title=part.text("title"),
        folder=folder,
        inputs={key: _input(inner) for key, inner in part.named("inputs").items()},
        outputs={key: _output(inner) for key, inner in part.named("outputs").items()},
        options={key: inner.data for key, inner in part.named("options").items()},
        min_cells=(smallest[0], smallest[1]) if smallest else (1, 1),
        footprint=cast("Footprint", part.text("footprint", "instrument")),  # the schema's enum
        is_dead_man=part.flag("dead_man", default=False),
        summary=part.text("summary"),
        licence=part.text("licence"),
        author=part.text("author"),
        at_least_one_of=tuple(str(inner.data) for inner in part.listed("at_least_one_of")),
        required_together=tuple(
            tuple(map(str, inner.data)) for inner in part.listed("required_together")
        ),
        common_frame=tuple(str(inner.data) for inner in part.listed("common_frame")),
    )
    _check_names(part, widget, problems)
    return widget


def _check_names(part: Node, widget: Widget, problems: Problems) -> None:
    """Report each reference to an input, output or option that the manifest does not declare."""
    ports, options = {**widget.inputs, **widget.outputs}, widget.options
    told: list[tuple[Node, Iterable[str]]] = []
    told += [(inner, (*ports, *options)) for inner in part.listed("at_least_one_of")]
    told += [(inner, widget.inputs) for inner in part.listed("common_frame")]
    told += [
        (inner, ports) for group in part.listed("required_together") for inner in group.items()
    ]
    for inner in (*part.named("inputs").values(), *part.named("outputs").values()):
        if "unit_of" in inner.data:
            told.append((inner.must("unit_of"), ports))
    for inner in part.named("inputs").values():
        told += [(one, (*widget.inputs, *options)) for one in inner.listed("replaces")]
    for inner in part.named("options").values():
        if "less_than" in inner.data:
            told.append((inner.must("less_than"), options))
        for one in (inner, inner.get("items")):
            if one is not None and "argument_of" in one.data:
                told.append((one.must("argument_of"), widget.outputs))
    for inner, known in told:
        if inner.data not in known:
            problems.error(
                inner,
                "unknown-input",
                f"this key cannot refer to {inner.data!r}",
                hint=did_you_mean(inner.data, known, "names"),
            )


def _port(part: Node) -> WidgetPort:
    return WidgetPort(
        name=part.name,
        types=_one_or_more(part.get("type")),
        unit=part.text("unit"),
        unit_of=part.text("unit_of"),
        is_required=part.flag("required", default=True),
        description=part.text("description"),
    )


def _input(part: Node) -> WidgetPort:
    size = part.get("size")
    return _port(part)._replace(
        items=_one_or_more(part.get("items")),
        size=None if size is None else int(size.data),
        is_multiple=part.flag("multiple", default=False),
        keeps_all=part.flag("keep_all", default=False),
        quantity=part.text("quantity"),
        replaces=tuple(str(inner.data) for inner in part.listed("replaces")),
    )


def _one_or_more(part: Node | None) -> tuple[str, ...]:
    if part is None:
        return ()
    return (part.data,) if isinstance(part.data, str) else tuple(part.data)


def _output(part: Node) -> WidgetPort:
    return _port(part)._replace(
        is_held=part.flag("hold", default=False), arguments=tuple(part.named("arguments"))
    )


def _check_defaults(options: Node, problems: Problems) -> None:
    """Report each default that does not fit its own schema."""
    for name, inner in options.entries().items():
        default = inner.get("default")
        if default is None:
            continue
        for problem in check_options(
            options.document, options.path, {name: default.data}, options.data
        ):
            problems.error(default, problem.code, problem.message, hint=problem.hint)


def _nearby(file: FilePath) -> str:
    """Return a path relative to the current folder if possible, otherwise the absolute path."""
    try:
        return str(file.relative_to(FilePath.cwd()))
    except (OSError, ValueError):
        return str(file)


class WidgetFolder:
    """The widgets of one folder. Each manifest is read once, on the first use of its widget."""

    def __init__(self, folder: FilePath) -> None:
        self.folder = folder
        self.problems: list[Problem] = []
        """The problems in the manifests read so far."""
        self._widgets: dict[str, Widget | None] = {}

    @property
    def files(self) -> tuple[str, ...]:
        """Return the paths of all requested manifests, including missing manifests."""
        return tuple(str(self.folder / name / "widget.yaml") for name in self._widgets)

    def names(self) -> list[str]:
        """Return the names of all widgets in the folder."""
        try:
            return sorted(entry.parent.name for entry in self.folder.glob("*/widget.yaml"))
        except OSError:
            return []

    def get(self, name: str) -> Widget | None:
        """Return a widget; None if the widget is missing or its manifest is invalid."""
        if name not in self._widgets:
            self._widgets[name] = self._read(name) if self.has(name) else None
        return self._widgets[name]

    def has(self, name: str) -> bool:
        """Return whether the folder contains this widget, even if its manifest is invalid."""
        return bool(_NAME.fullmatch(name)) and (self.folder / name / "widget.yaml").is_file()

    def place(self, name: str) -> FilePath:
        """Return the folder of the widget with this name."""
        return self.folder / name

    def hint(self, name: str) -> str:
        """Return a hint for an unknown widget name."""
        return did_you_mean(name, self.names(), "widgets")

    def _read(self, name: str) -> Widget | None:
        try:
            document = read_document(_nearby(self.folder / name / "widget.yaml"))
        except ProblemsError as error:
            self.problems += error.problems
            return None
        wrong = check_shape(document)
        if not wrong and kind_of(document) != "widget":
            wrong = [
                document.problem(
                    ("kind",),
                    "wrong-kind",
                    "expected the manifest of a widget",
                    hint="write 'kind: widget'",
                )
            ]
        problems = Problems()
        widget = None if has_errors(wrong) else parse_widget(document, problems)
        self.problems += [*document.problems, *wrong, *problems]
        return None if has_errors(problems) else widget
