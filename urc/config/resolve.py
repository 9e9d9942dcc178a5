"""Converts a profile into a single document that shows the origin of every key.

The result is a valid document that describes the same robot without other documents.
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from urc.config.compose.merge import Tree, merge
from urc.config.gather import gather
from urc.config.node import Node
from urc.config.parse.widget import WidgetFolder
from urc.config.schemas import read_schema
from urc.config.sources import RESERVED, Sources
from urc.model.interface import Interface, Layout, WidgetUse
from urc.model.profile import Profile
from urc.problems import Problem, has_errors, printable
from urc.source import Document, Mark

__all__ = ["ResolvedProfile", "resolve", "written"]

_HEADER: Final = ("urc", "kind", "name", "title", "summary", "licence", "author", "tags")
_BUILDING: Final = ("extends", "include", "partial", "params", "driver", "interfaces")
_BESIDE: Final = ("settings", "widgets", "tests", "simulator")
_PLAIN: Final = re.compile(r"[A-Za-z_](?:[\w./ -]*[\w./-])?|\d+(?:ms|s|m|h)", re.ASCII)
_WORDS: Final = frozenset(("null", "true", "false", "yes", "no", "on", "off", "y", "n"))
"""Words that some YAML readers do not interpret as strings."""
_UNSAFE: Final = re.compile("[\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")
_BLOCK: Final = re.compile(r"(?:[!-~](?:[ -~]*[!-~])?\n){2,}")
_INLINE_MOST: Final = 60


class ResolvedProfile(NamedTuple):
    """A resolved document and its problems."""

    text: str
    """The resolved document; "" after errors."""
    problems: tuple[Problem, ...]


def resolve(path: str, registry: WidgetFolder, profile: Profile | None = None) -> ResolvedProfile:
    """Return the document at `path` merged with all its sources.

    Args:
        path: path of a robot, driver, interface or widget.
        registry: the available widgets.
        profile: the loaded profile, which is needed only for the default interface.
    """
    sources, problems, _, _ = gather(path)
    if sources is None:
        if not has_errors(problems):
            text = "this is a partial document: resolve a document that includes or extends it"
            problems.append(Problem("partial-document", text, path))
        return ResolvedProfile("", tuple(problems))
    lines = [f"# {path}, merged by 'urc resolve'."]
    made = _default_look(sources, profile)
    if made:
        told = " and ".join(f"'{key}'" for key in made)
        lines.append(f"# URC generated {told}: the document declares no interface.")
    for key, node in (*_sections(sources, registry), *made.items()):
        lines += _entry(key, node, 0)
    return ResolvedProfile("\n".join(lines) + "\n", tuple(problems))


def _sections(sources: Sources, registry: WidgetFolder) -> Iterator[tuple[str, object]]:
    root = sources.root
    if sources.kind not in ("robot", "driver"):
        yield from ((key, part) for key, part in root.entries().items() if key not in _BUILDING)
        return
    for key in _HEADER:
        if key in root.data:
            yield key, root.must(key)
    if sources.settings:
        yield "settings", sources.settings
    for key in read_schema("robot.schema.json")["$defs"]["inlineDriver"]["properties"]:
        if key in sources.driver.data and key not in _BESIDE:
            yield key, sources.driver.must(key)
    if sources.slots:
        yield "widgets", {slot: _slot(parts, registry) for slot, parts in sources.slots.items()}
    if sources.interfaces:
        yield "interfaces", {name: _layout(part) for name, part in sources.interfaces.items()}
    if sources.tests:
        yield "tests", sources.tests
    if sources.simulator or sources.rules:
        plain = {name: part for name, part in sources.rules.items() if name not in RESERVED}
        inner: dict[str, object] = {**sources.simulator, **plain}
        rest = {name: part for name, part in sources.rules.items() if name in RESERVED}
        yield "simulator", inner | ({"rules": rest} if rest else {})


def _layout(part: Node) -> Mapping[str, Node]:
    """Return the keys of an interface that are also allowed inside a robot's document."""
    keys = read_schema("interface.schema.json")["$defs"]["inlineInterface"]["properties"]
    return {key: inner for key, inner in part.entries().items() if key in keys}


def _slot(parts: list[Node], registry: WidgetFolder) -> Node:
    """Return the merged declaration of a slot's widget; later parts override earlier parts."""
    tree = _tree(parts[0])
    for part in parts[1:]:
        over = _tree(part)
        if part.data.get("use", tree.value["use"]) != tree.value["use"]:  # type: ignore[index]
            tree = _for_widget(tree, str(part.data["use"]), registry)
        tree = merge(tree, over)
    home = tree.home
    document = Document(home.file, home.text, home.lines, tree.value, tree.mark)
    return Node(document, (), tree.value)


def _tree(part: Node) -> Tree:
    mark = part.document.at(part.path) or Mark(part.document.mark.span, "{")
    return Tree(part.data, mark, part.document.source_of(part.path))


def _for_widget(tree: Tree, name: str, registry: WidgetFolder) -> Tree:
    """Return a slot's declaration for another widget, without options and unsuitable bindings."""
    widget = registry.get(name)
    ports = {**widget.inputs, **widget.outputs} if widget is not None else {}
    value = {key: item for key, item in dict(tree.value).items() if key != "options"}  # type: ignore[call-overload]
    bind = value.get("bind")
    if isinstance(bind, dict):
        value["bind"] = {key: item for key, item in bind.items() if key in ports}
    return Tree(value, tree.mark, tree.home)


# ---- text


def written(key: str, value: object) -> str:
    """Return ``key: value`` in document notation, without origin comments."""
    return "\n".join(_entry(key, value, 0)) + "\n"


def _entry(key: str, node: object, depth: int) -> Iterator[str]:
    """Yield the lines of one key and its value."""
    yield from _value(f"{'  ' * depth}{_text(key)}:", node, depth, _place(node))


def _value(head: str, node: object, depth: int, place: str) -> Iterator[str]:
    """Yield the lines of a value; `head` is the indented key."""
    value = node.data if isinstance(node, Node) else node
    if isinstance(value, Mapping):
        entries = node.entries() if isinstance(node, Node) else value
        yield f"{head}{'' if entries else ' {}'}{place}"
        for key, inner in entries.items():
            yield from _entry(key, inner, depth + 1)
    elif isinstance(value, list):
        yield from _list(head, node, value, depth, place)
    elif isinstance(value, str) and _BLOCK.fullmatch(value):
        yield f"{head} |{place}"
        for line in value.splitlines():
            yield f"{'  ' * (depth + 1)}{line}".rstrip()
    else:
        yield f"{head} {_scalar(value)}{place}"


def _list(head: str, node: object, value: list[object], depth: int, place: str) -> Iterator[str]:
    if not any(isinstance(_data(item), (Mapping, list)) for item in value):
        inline = f"[{', '.join(_scalar(_data(item)) for item in value)}]"
        if len(inline) <= _INLINE_MOST or not value:
            yield f"{head} {inline}{place}"
            return
    yield f"{head}{place}"
    items = node.items() if isinstance(node, Node) else value
    pad = "  " * (depth + 1)
    for item in items:
        inside = _data(item)
        if not isinstance(inside, Mapping) or not inside:
            yield from _value(f"{pad}-", item, depth + 1, _place(item))
            continue
        entries = item.entries() if isinstance(item, Node) else inside
        lines = [line for key, one in entries.items() for line in _entry(key, one, depth + 2)]
        yield f"{pad}- {lines[0].lstrip()}"
        yield from lines[1:]


def _data(node: object) -> object:
    return node.data if isinstance(node, Node) else node


def _place(node: object) -> str:
    """Return a comment with the file and line of a key; "" for an unknown origin."""
    if not isinstance(node, Node):
        return ""
    mark = node.document.at(node.path)
    if mark is None:
        return ""
    span = mark.key or mark.span
    return printable(f"  # {node.document.source_of(node.path).file}:{span.line}")


def _scalar(value: object) -> str:
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    return json.dumps(value)


def _text(text: str) -> str:
    """Quote text, unless every YAML reader treats the unquoted text as a string."""
    if _PLAIN.fullmatch(text) and text.lower() not in _WORDS:
        return text
    if "\\" in text and text.isascii() and text.isprintable() and "'" not in text:
        return f"'{text}'"  # probably a pattern
    quoted = json.dumps(text, ensure_ascii=False)
    return _UNSAFE.sub(lambda found: f"\\u{ord(found[0]):04x}", quoted)


def _default_look(sources: Sources, profile: Profile | None) -> dict[str, object]:
    """Return the default ``widgets`` and ``interfaces`` for documents without interfaces."""
    if profile is None or sources.interfaces:
        return {}
    made: dict[str, object] = {}
    if not sources.slots and profile.slots:
        made["widgets"] = {slot: _use(use) for slot, use in profile.slots.items()}
    if sources.kind == "robot" and profile.slots:
        made["interfaces"] = {name: _interface(one) for name, one in profile.interfaces.items()}
    return made


def _use(use: WidgetUse) -> dict[str, object]:
    bind: dict[str, object] = {**use.inputs}
    bind |= {name: list(many) for name, many in use.lists.items()}
    bind |= {name: _output(use, name) for name in use.outputs}
    written: dict[str, object] = {"use": use.widget, "bind": bind}
    return written | ({"title": use.title} if use.title else {})


def _output(use: WidgetUse, name: str) -> object:
    given = use.given.get(name)
    command = use.outputs[name]
    if given is None or not given.names:
        return command
    return {"command": command, "args": {source: target for target, source in given.names.items()}}


def _interface(interface: Interface) -> dict[str, object]:
    layouts = {screen: _picture(grid) for screen, grid in interface.layouts.items()}
    return {"title": interface.title, "layouts": layouts}


def _picture(grid: Layout) -> str:
    rows = [["."] * grid.columns for _ in range(grid.rows)]
    for slot in grid.slots:
        for row in range(slot.row, slot.row + slot.row_span):
            for column in range(slot.column, slot.column + slot.column_span):
                rows[row][column] = slot.name
    width = max(len(name) for row in rows for name in row)
    return "".join("  ".join(name.ljust(width) for name in row).rstrip() + "\n" for row in rows)
