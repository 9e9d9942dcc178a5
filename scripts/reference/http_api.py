"""The reference page for the HTTP API, generated from the server's OpenAPI document."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from scripts.reference.markdown import plain, table
from urc.web.api_document import api_document

__all__ = ["page"]

Schema = Mapping[str, Any]
_REF = "#/components/schemas/"


def page() -> str:
    """Return the page of the HTTP API: one section for each call and each named schema."""
    document = json.loads(api_document())
    lines = [
        "# HTTP API reference",
        "",
        "Every call of the [HTTP API](../api.md), with the required right, body and responses.",
        "A running server serves the same content as OpenAPI at `/api/v1/openapi.json`.",
        "",
    ]
    lines += ["## Calls", ""]
    for path, verbs in document["paths"].items():
        for verb, call in verbs.items():
            lines += _call(f"{verb.upper()} {path}", call)
    lines += ["## Shapes", ""]
    for name, schema in document["components"]["schemas"].items():
        lines += _shape(name, schema)
    return "\n".join(lines).rstrip() + "\n"


def _call(name: str, call: Schema) -> Iterator[str]:
    yield from (f"### {name}", "", plain(call["summary"]), "")
    yield from (plain(call["description"]), "")
    if parameters := call.get("parameters"):
        head = ("parameter", "in", "type", "meaning")
        rows = [
            (f"`{one['name']}`", one["in"], _type(one.get("schema", {})), _text(one))
            for one in parameters
        ]
        yield from table(head, rows)
    for content in call.get("requestBody", {}).get("content", {}).values():
        yield f"- body: {_type(content.get('schema', {}))}"
    for status, answer in call["responses"].items():
        if status.startswith("2"):
            for kind, content in (answer.get("content") or {"": {}}).items():
                shape = _type(content["schema"]) if content.get("schema") else f"`{kind}`"
                yield f"- {status}: {shape if kind else 'no content'}"
    failures = [status for status in call["responses"] if status >= "3"]
    yield from (f"- failures: {', '.join(failures)}", "")


def _shape(name: str, schema: Schema) -> Iterator[str]:
    yield from (f"### {name}", "", plain(schema.get("description", "")), "")
    required = schema.get("required", ())
    rows = [
        (f"`{key}`", _type(one), "yes" if key in required else "", _text(one))
        for key, one in schema.get("properties", {}).items()
    ]
    if rows:
        yield from table(("field", "type", "required", "meaning"), rows)


def _text(schema: Schema) -> str:
    return plain(schema.get("description", ""))


def _type(schema: Schema) -> str:
    """Return a schema's type in words, with links to named schemas."""
    if "$ref" in schema:
        name = schema["$ref"].removeprefix(_REF)
        return f"[{name}](#{name.lower()})"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(one)}`" for one in schema["enum"])
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if choices := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(_type(one) for one in choices)
    kind = schema.get("type", "any")
    if kind == "array" and schema.get("items"):
        return f"list of {_type(schema['items'])}"
    if kind == "object" and isinstance(schema.get("additionalProperties"), Mapping):
        return f"map to {_type(schema['additionalProperties'])}"
    return str(kind)
