"""The reference page for WebSocket messages, generated from the message types in `urc.wire`."""

import inspect
import typing
from collections.abc import Iterator

import msgspec

from scripts.reference.markdown import plain, table
from urc.web.api.field_texts import field_texts
from urc.wire import client_messages, server_messages

__all__ = ["page"]

_PAGE = "Every message of the WebSocket `/ws?robot=NAME`, which the dashboard and `urc.client` use."


def page() -> str:
    """Return the page: client messages, server messages, rows, close codes."""
    lines = ["# WebSocket messages", "", _PAGE]
    lines += ["A message is a JSON object; the field `t` contains the kind of the message.", ""]
    sent = typing.get_args(client_messages.ClientMessage)
    received = typing.get_args(server_messages.ServerMessage)
    lines += ["## From a client to the server", ""]
    for one in (*sent, client_messages.JoinRedundant, client_messages.JoinPictures):
        lines += _message(one, _right(one))
    lines += ["## From the server to a client", ""]
    for one in received:
        lines += _message(one, "")
    lines += ["## Rows", "", "Parts of messages.", ""]
    for one in _rows(received):
        lines += [f"### {one.__name__}", "", *_fields(one)]
    lines += ["## Close codes", ""]
    codes = [(n, v) for n, v in vars(server_messages).items() if n.startswith("CLOSE_")]
    named = ((str(code), name[6:].lower().replace("_", " ")) for name, code in codes)
    lines += table(("code", "reason"), named)
    return "\n".join(lines).rstrip() + "\n"


def _right(message: type) -> str:
    role = client_messages.RIGHTS.get(message)
    return f"Right: {role or 'none'}."


def _rows(messages: tuple[type, ...]) -> list[type]:
    public = (getattr(server_messages, name) for name in server_messages.__all__)
    every = {one for one in public if isinstance(one, type)}
    return sorted(every - {*messages, server_messages.Outbound}, key=lambda one: one.__name__)


def _message(message: type, right: str) -> Iterator[str]:
    tag = message.__struct_config__.tag  # type: ignore[attr-defined]  # of each Struct
    yield from (f"### {tag}", "")
    yield from _fields(message)
    if right:
        yield from (right, "")


def _fields(message: type) -> Iterator[str]:
    yield from (plain(inspect.cleandoc(message.__doc__ or "")), "")
    texts = field_texts(message)
    rows = [
        (
            f"`{field.encode_name}`",
            _type(field.type),
            "yes" if field.required else "",
            plain(texts.get(field.name, "")),
        )
        for field in msgspec.structs.fields(message)
    ]
    if rows:
        yield from table(("field", "type", "required", "meaning"), rows)


def _type(annotation: object) -> str:
    """Return a field's type in words."""
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation is type(None):
        return "null"
    if origin is typing.Annotated:
        return _type(inner[0])
    if origin is typing.Literal:
        return ", ".join(f"`{one}`" for one in inner)
    if origin in (list, tuple) or getattr(origin, "__name__", "") == "Sequence":
        return f"list of {_type(inner[0])}"
    if origin is dict or getattr(origin, "__name__", "") == "Mapping":
        return f"map to {_type(inner[1])}"
    if inner:
        return " or ".join(dict.fromkeys(map(_type, inner)))
    words = {"str": "text", "int": "integer", "float": "number", "bool": "boolean", "object": "any"}
    name = getattr(annotation, "__name__", str(annotation))
    return words.get(name, f"[{name}](#{name.lower()})" if name.endswith("Row") else name)
