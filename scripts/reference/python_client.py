"""The reference page for the Python client, generated from the docstrings of its public names."""

import inspect
import re
from collections.abc import Iterator
from typing import Any

import urc.client
from scripts.reference.markdown import fence, plain

__all__ = ["page"]

_SECTION = re.compile(r"^(Args|Raises|Returns|Yields):$", re.MULTILINE)


def page() -> str:
    """Return the page: the functions first, then the classes."""
    lines = [
        "# Python client reference",
        "",
        "The public names of `urc.client`. The guide is [Python programs](../python.md).",
        "",
    ]
    for name in sorted(urc.client.__all__, key=lambda one: (not one[0].islower(), one)):
        value = getattr(urc.client, name)
        lines += _class(name, value) if inspect.isclass(value) else _function(name, value, 2)
    return "\n".join(lines).rstrip() + "\n"


def _class(name: str, value: type) -> Iterator[str]:
    yield from (f"## {name}", "", *_text(value))
    for key, member in vars(value).items():
        target = member.fget if isinstance(member, property) else member
        if key.startswith("_") or not (inspect.isfunction(target) and inspect.getdoc(target)):
            continue
        if isinstance(member, property):
            yield from (f"### {name}.{key}", "", *_text(target))
        else:
            yield from _function(f"{name}.{key}", target, 3)


def _function(name: str, value: Any, level: int) -> Iterator[str]:
    yield from (f"{'#' * level} {name}", "")
    start = "async " if inspect.iscoroutinefunction(value) else ""
    yield from fence(f"{start}def {name.rpartition('.')[2]}{_signature(value)}", "python")
    yield from _text(value)


def _signature(value: Any) -> str:
    text = str(inspect.signature(value)).replace("'", "")
    return re.sub(r"\b(?:[a-z_]+\.)+([A-Z]\w*)", r"\1", text)


def _text(value: Any) -> Iterator[str]:
    """Yield the lines of a docstring in Markdown; sections such as `Raises:` become lists."""
    text = inspect.getdoc(value) or ""
    main, *rest = _SECTION.split(text)
    yield from (*plain(main).strip().splitlines(), "")
    for title, body in zip(rest[::2], rest[1::2], strict=True):
        yield from (f"{title}:", "")
        entries = re.split(r"\n(?=    \S)", body.strip("\n"))
        yield from (f"- {' '.join(plain(one).split())}" for one in entries if one.strip())
        yield ""
