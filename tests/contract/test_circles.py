"""No circles: no two modules need each other, nor two rooms of the dashboard."""

import re
from collections.abc import Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.contract.modules import MODULES, ROOT, imports_of, tree_of

Graph = dict[str, set[str]]


def python_modules() -> dict[str, Path]:
    """Return dotted name → file of all of ours."""
    found = {}
    for path in MODULES:
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def python_graph() -> Mapping[str, set[str]]:
    """Return module → the modules of ours that it imports."""
    modules = python_modules()
    graph: Graph = {}
    for name, path in modules.items():
        graph[name] = set()
        for _, full in imports_of(str(path.relative_to(ROOT)), tree_of(path)):
            wanted = full
            while wanted and wanted not in modules:
                wanted = wanted.rpartition(".")[0]
            if wanted not in ("", name):
                graph[name].add(wanted)
    return graph


def script_graph() -> Graph:
    """Return module → the modules of ours that it imports, of the pages and the widgets."""
    graph: Graph = {}
    static = ROOT / "urc/web/static"
    for path in sorted([*static.rglob("*.js"), *(ROOT / "widgets").glob("*/*.js")]):
        text = re.sub(r"/\*.*?\*/", "", path.read_text("utf-8"), flags=re.S)  # types are no imports
        wanted = re.findall(r"""(?:\bfrom|\bimport)\s*\(?\s*["']([^"']+)["']""", text)
        graph[str(path)] = {
            str(
                static / f"widgets/{one[4:]}.js"
                if one.startswith("urc/")
                else (path.parent / one).resolve()
            )
            for one in wanted
            if one.startswith(("./", "../", "urc/")) and one != "urc/words"
        }
    return graph


def rooms_of(graph: Mapping[str, set[str]], house: str) -> Graph:
    """Return room → rooms, where a room is a folder in `house`, or a module beside the folders."""
    rooms: Graph = {}
    for name, wanted in graph.items():
        if name.startswith(f"{house}."):
            room = name.split(".")[house.count(".") + 1]
            others = {
                one.split(".")[house.count(".") + 1]
                for one in wanted
                if one.startswith(f"{house}.")
            }
            rooms.setdefault(room, set()).update(others - {room})
    return rooms


def circle_in(graph: Mapping[str, set[str]]) -> list[str]:
    """Return one circle, or nothing."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_two_python_modules_need_each_other() -> None:
    """A module can be read with what is below it, and nothing else."""
    assert circle_in(python_graph()) == []


def test_no_two_scripts_need_each_other() -> None:
    """That holds for what browsers load, too."""
    graph = script_graph()
    assert any(graph.values())
    assert circle_in(graph) == []


def test_no_two_rooms_of_the_dashboard_need_each_other() -> None:
    """What is between two rooms goes one way."""
    assert circle_in(rooms_of(python_graph(), "urc.web")) == []


def test_no_two_passes_over_documents_need_each_other() -> None:
    """Text becomes the model in one direction."""
    assert circle_in(rooms_of(python_graph(), "urc.config")) == []


@pytest.mark.parametrize(
    ("graph", "circle"),
    [
        ({"a": {"b"}, "b": {"c"}, "c": set()}, set()),
        ({"a": {"b"}, "b": {"c"}, "c": {"a"}}, {"a", "b", "c"}),
    ],
)
def test_a_circle_is_found(graph: Graph, circle: set[str]) -> None:
    """The check sees one that goes over several modules."""
    assert set(circle_in(graph)) == circle


def test_a_circle_of_rooms_is_found() -> None:
    """Two rooms may be in a circle though no two of their modules are."""
    graph = {"web.a.one": {"web.b.one"}, "web.b.two": {"web.a.two"}}
    assert rooms_of(graph, "web") == {"a": {"b"}, "b": {"a"}}
