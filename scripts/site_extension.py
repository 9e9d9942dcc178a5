"""The Sphinx extension for the documentation site: anchors, links to the reference, llms.txt."""

from html import escape
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

from scripts.docs import term_anchors
from scripts.site_names import place_of

__all__ = ["setup"]

GLOSSARY = "glossary"
REFERENCE = (
    *("reference/keys/", "reference/cli", "reference/codes", "reference/filters"),
    *("reference/http-api", "reference/websocket", "reference/python-client"),
    *("reference/environment", "reference/limits", "gallery/robots", "gallery/widgets"),
)
MADE_BY = (
    (REFERENCE, "python -m scripts.reference"),
    (("robots/",), "python -m scripts.robot_pictures"),
    (("licences",), "python -m scripts.licences"),
)
"""Prefixes of generated pages' names, with the command that writes the pages."""
LABELS = {
    '<aside class="sidebar-drawer"': '<aside aria-label="Chapters" class="sidebar-drawer"',
    '<aside class="toc-drawer': '<aside aria-label="On this page" class="toc-drawer',
    '<div class="highlight"><pre>': '<div class="highlight"><pre tabindex="0">',
    'class="content-icon-container"': (
        'class="content-icon-container" role="navigation" aria-label="Page"'
    ),
}
"""Parts of the theme's markup, and the corrections that the accessibility checker axe requires."""
DOCUMENT = "urc-document"
"""CSS class of a code block with a whole document; the playground adds its button to the block."""


def setup(app: Sphinx) -> dict[str, Any]:
    """Connect the extension's functions to the events of Sphinx."""
    app.connect("doctree-read", mark_documents)
    app.connect("doctree-read", anchor_terms)
    app.connect("doctree-resolved", link_names)
    app.connect("html-page-context", shorten_navigation, priority=400)  # before the theme's own
    app.connect("build-finished", write_llms)
    app.connect("build-finished", label_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def mark_documents(_: Sphinx, tree: nodes.document) -> None:
    """Add the class `DOCUMENT` to each fenced block that contains a whole document."""
    texts = [block.astext() for block in tree.findall(nodes.literal_block)]
    for block in tree.findall(nodes.literal_block):
        text = block.astext()
        is_piece = any(text in other and len(text) < len(other) for other in texts)
        if block.get("language") == "yaml" and text.startswith("urc: 1\n") and not is_piece:
            block["classes"].append(DOCUMENT)


def anchor_terms(app: Sphinx, tree: nodes.document) -> None:
    """Add an anchor to each glossary term, such as `#term-signal`."""
    if app.env.docname != GLOSSARY:
        return
    slugs = app.env.metadata[GLOSSARY].setdefault("myst_slugs", {})
    for row in tree.findall(nodes.row):
        cells = [cell.astext() for cell in row.findall(nodes.entry)]
        if len(cells) != 4 or isinstance(row.parent, nodes.thead):
            continue
        for anchor in term_anchors(cells[0]):
            row["ids"].append(anchor)
            slugs[anchor] = (row.line or 0, anchor, cells[0])


def link_names(app: Sphinx, tree: nodes.document, name: str) -> None:
    """Link the first mention of each command, variable, code and key to the reference."""
    if name.startswith(("reference/", "decisions/")):
        return
    seen = set()
    for literal in list(tree.findall(nodes.literal)):
        place = place_of(literal.astext())
        if place is None or place in seen or is_within(literal, nodes.reference, nodes.title):
            continue
        seen.add(place)
        address = f"{app.builder.get_relative_uri(name, place.page)}#{place.anchor}"
        link = nodes.reference("", "", internal=True, refuri=address, classes=["urc-name"])
        literal.replace_self(link)
        link += literal


def is_within(node: nodes.Node, *kinds: type[nodes.Node]) -> bool:
    """Return whether a node has an ancestor of one of these kinds."""
    while (node := node.parent) is not None:
        if isinstance(node, kinds):
            return True
    return False


def shorten_navigation(
    app: Sphinx, name: str, _template: str, context: dict[str, Any], _tree: nodes.document | None
) -> None:
    """Pass the chapters to the theme, with only the current chapter's pages.

    Otherwise, Sphinx would resolve the whole table of contents for each page, which takes two
    minutes for 270 pages.
    """
    here = {name, *ancestors(app, name)}

    def listed(parent: str, level: int) -> str:
        items = []
        for page in app.env.toctree_includes.get(parent, []):
            is_current = page in here
            mark = " current" if is_current else ""
            address = "#" if page == name else context["pathto"](page)
            inner = listed(page, level + 1) if is_current else ""
            link = f'<a class="reference internal{mark}" href="{address}">{title(app, page)}</a>'
            items.append(f'<li class="toctree-l{level}{mark}">{link}{inner}</li>')
        return f"<ul>{''.join(items)}</ul>" if items else ""

    if context.get("body") and name not in ("genindex", "search"):
        context["body"] += source_line(context, name)
    context["toctree"] = lambda **_: listed(app.config.root_doc, 1)


def source_line(context: dict[str, Any], name: str) -> str:
    """Return the page's last line: the file to edit, or the command that generated the page."""
    for starts, command in MADE_BY:
        if name.startswith(starts):
            return f'<p class="urc-source">Made by <code>{command}</code> from the code.</p>'
    address = context["pathto"](f"_sources/{name}.md.txt", True)
    file = f'<a href="{address}">docs/{name}.md</a>'
    return f'<p class="urc-source">To correct this page, edit {file}.</p>'


def ancestors(app: Sphinx, name: str) -> list[str]:
    """Return the pages above a page in the table of contents, nearest first."""
    includes = app.env.toctree_includes
    parents = {child: page for page, inner in includes.items() for child in inner}
    found = []
    while (name := parents.get(name, "")) and name not in found:
        found.append(name)
    return found


def title(app: Sphinx, name: str) -> str:
    """Return a page's title as HTML."""
    return escape(title_of(app, name))


def write_llms(app: Sphinx, fault: Exception | None) -> None:
    """Write llms.txt, the list of all pages for language models, and the pages as Markdown."""
    if fault is not None or app.builder.name != "html":
        return
    root = app.config.root_doc
    lines = [f"# {app.config.project}", "", f"> {summary_of(app, root)}", ""]
    for name in app.env.toctree_includes.get(root, []):
        lines += [f"## {title_of(app, name)}", ""]
        for page in [name, *below(app, name)]:
            source = f"_sources/{page}.md.txt"
            lines.append(f"- [{title_of(app, page)}]({source}): {summary_of(app, page)}")
        lines.append("")
    (Path(app.outdir) / "llms.txt").write_text("\n".join(lines), encoding="utf-8")


def label_pages(app: Sphinx, fault: Exception | None) -> None:
    """Label the theme's landmarks, and make wide code blocks scrollable by keyboard."""
    if fault is not None or app.builder.name != "html":
        return
    for name in app.env.all_docs:
        file = Path(app.outdir) / f"{name}.html"
        text = file.read_text("utf-8")
        for before, after in LABELS.items():
            text = text.replace(before, after)
        file.write_text(text, encoding="utf-8")


def below(app: Sphinx, name: str) -> list[str]:
    """Return the pages below a page in the table of contents, in order."""
    found: list[str] = []
    for page in app.env.toctree_includes.get(name, []):
        found += [page, *below(app, page)]
    return found


def title_of(app: Sphinx, name: str) -> str:
    """Return a page's title."""
    return str(app.env.titles[name].astext())


def summary_of(app: Sphinx, name: str) -> str:
    """Return a page's first paragraph, on one line."""
    tree = app.env.get_doctree(name)
    first = next(tree.findall(nodes.paragraph), None)
    return " ".join(first.astext().split()) if first else ""
