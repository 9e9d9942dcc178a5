"""Every shipped widget folder: complete, named as its folder, its template sound in every state."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from urc.config.parse.widget import WidgetFolder
from urc.model.widget import Widget
from urc.shipped import shipped
from urc.source import read_document
from urc.testing.dashboard import option_defaults
from urc.web.show.cells import WidgetContext, render_widget, widget_context
from urc.web.show.demos import WidgetState, demo_states

FOLDERS = sorted(path for path in shipped("widgets").iterdir() if path.is_dir())
FILES = {"widget.yaml", "template.html.j2", "widget.js", "widget.css", "demo.yaml"}
MORE = {".js", ".json", ".svg", ".png", ".jpg", ".urdf", ".stl"}
"""What else a widget may bring: modules and small assets."""
MOST_BYTES = 256 * 1024
SHELF = WidgetFolder(shipped("widgets"))
TYPES = {
    "string": str,
    "integer": int,
    "number": (int, float),
    "boolean": bool,
    "array": list,
    "object": dict,
}
HOSTILE = "</h3><script>alert(1)</script><img src=x onerror=alert(1)>"


class Page(HTMLParser):
    """Collects the elements of a piece of markup."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep the element."""
        self.elements.append((tag, dict(attrs)))


def read(folder: Path, name: str) -> Any:
    """Return a YAML document of the folder."""
    return read_document(str(folder / name)).data


def widget_of(folder: Path) -> Widget:
    """Return the widget as its manifest declares it."""
    widget = SHELF.get(folder.name)
    assert widget is not None, SHELF.problems
    return widget


def contexts(widget: Widget) -> dict[str, tuple[WidgetState, WidgetContext]]:
    """Return what the template is rendered with in each state of the demo."""
    found = {}
    for state in demo_states(widget):
        found[state.name] = (state, widget_context(state.use, widget, state.profile, "cell-0"))
    return found


STATES = [
    (folder, state)
    for folder in FOLDERS
    for state in (read(folder, "demo.yaml")["states"] if (folder / "demo.yaml").is_file() else ())
]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_widget_folder_is_complete(folder: Path) -> None:
    """All five files, the name of the folder, and inputs that the demo binds."""
    assert {path.name for path in folder.iterdir()} >= FILES
    for path in folder.rglob("*"):
        assert path.is_dir() or path.name in FILES or path.suffix in MORE, path
        assert path.stat().st_size <= MOST_BYTES, path
    manifest = read(folder, "widget.yaml")
    assert (manifest["urc"], manifest["kind"], manifest["name"]) == (1, "widget", folder.name)
    demo = read(folder, "demo.yaml")
    signals = demo.get("signals", {})
    assert set(signals) <= set(manifest.get("inputs", {}))
    for name, port in manifest.get("inputs", {}).items():
        assert name in signals or not port.get("required", True)
    outputs = demo.get("outputs", {})
    assert set(outputs) <= set(manifest.get("outputs", {}))
    for name, port in manifest.get("outputs", {}).items():
        assert name in outputs or not port.get("required", True)
    for state in demo["states"].values():
        for option, value in state.get("options", {}).items():
            declared = manifest["options"][option]
            assert isinstance(value, TYPES[declared["type"]])
            assert value in declared.get("enum", [value])
    assert {"normal", "stale", "none", "hostile"} <= set(demo["states"])


@pytest.mark.cases(60)
@pytest.mark.parametrize(("folder", "state"), STATES, ids=lambda part: getattr(part, "name", part))
def test_a_template_renders_in_each_state_without_values(folder: Path, state: str) -> None:
    """What stands there before the module has loaded makes sense, and texts are texts."""
    widget = widget_of(folder)
    _, context = contexts(widget)[state]
    # A label of its own would stand in place of the title.
    labels = {name: HOSTILE for name in ("label",) if context.options.get(name)}
    hostile = replace(
        context,
        title=HOSTILE,
        options={**context.options, **labels},
        outputs=dict.fromkeys(context.outputs, HOSTILE),
    )
    html = str(render_widget(widget, hostile))
    assert "&lt;img src=x onerror=alert(1)&gt;" in html
    states = context.options.get("done_in") or context.options.get("idle_in")
    shows_value = widget.inputs and not states
    assert "—" in html or not shows_value
    assert 'id="cell-0-' in html
    for tag, attributes in Page(html).elements:
        assert tag not in ("script", "img", "style", "link", "iframe")
        assert not [name for name in attributes if name.startswith("on") or name == "style"]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_style_sheet_touches_only_its_own_widget(folder: Path) -> None:
    """Every selector begins with the widget's name; no ids, no !important, tokens for colours."""
    css = re.sub(r"/\*.*?\*/", "", (folder / "widget.css").read_text("utf-8"), flags=re.S)
    assert "!important" not in css
    assert not re.search(r"#[0-9a-fA-F]{3,8}\b|rgb\(|hsl\(", css)
    for selector in re.findall(r"(?:^|[};{])\s*([^@{};&]+)\{", css):
        for part in re.split(r",(?![^(]*\))", selector):
            assert part.strip().startswith(f".{folder.name}"), part


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.name)
def test_a_template_without_its_command_has_no_dead_control(folder: Path) -> None:
    """Bound to signals only, it renders, and leaves out the buttons that would do nothing."""
    if not read(folder, "widget.yaml").get("outputs"):
        return  # what it does needs no command, as STOP
    widget = widget_of(folder)
    _, context = contexts(widget)["normal"]
    options = {**dict.fromkeys(widget.options), **option_defaults(widget)}
    bare = replace(context, title="T", options=options, outputs={})
    html = str(render_widget(widget, bare))
    assert not {"button", "input", "select"} & {tag for tag, _ in Page(html).elements}
