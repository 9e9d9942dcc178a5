"""Reference pages for the language's keys, generated from the schemas: one page for each family."""

import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from scripts.reference.families import FAMILIES

__all__ = ["KINDS", "definitions", "index", "missing", "page", "read_schema"]

ROOT = Path(__file__).resolve().parents[2]
SCHEMAS = ROOT / "schemas"
KINDS = ("robot", "driver", "interface", "widget")
COMMON = "driver:anyTransport"
"""Keys of every transport; a transport's page repeats only the keys whose schema differs."""

Schema = Mapping[str, Any]

_TYPES = {
    "string": "text",
    "number": "number",
    "integer": "whole number",
    "boolean": "true or false",
    "object": "mapping",
    "array": "list",
    "null": "null",
}
_BOUNDS = {
    "minimum": "at least {}",
    "maximum": "at most {}",
    "exclusiveMinimum": "more than {}",
    "exclusiveMaximum": "less than {}",
    "minLength": "at least {} characters",
    "maxLength": "at most {} characters",
    "minItems": "at least {} items",
    "maxItems": "at most {} items",
    "minProperties": "at least {} keys",
    "maxProperties": "at most {} keys",
}
_PLAIN = re.compile(r"[A-Za-z_][\w ./%-]*")
_WORDS_OF_YAML = frozenset(("true", "false", "null", "yes", "no", "on", "off", "y", "n"))


@cache
def read_schema(name: str) -> Schema:
    """Return the schema in the file with this name."""
    schema: Schema = json.loads((SCHEMAS / name).read_text("utf-8"))
    return schema


@cache
def definitions() -> dict[str, Schema]:
    """Return each kind of document and each definition in a schema, such as `driver:hold`."""
    found: dict[str, Schema] = {}
    for kind in KINDS:
        schema = read_schema(f"{kind}.schema.json")
        found[kind] = schema
        found |= {f"{kind}:{name}": inner for name, inner in schema.get("$defs", {}).items()}
    return found


def page(name: str) -> str:
    """Return the page for a family of keys."""
    family = FAMILIES[name]
    lines = [f"# {family.title}", "", *_paragraph(family.summary)]
    for guide, text in family.guides.items():
        lines += [f"Guide: [{text}](../../{guide}).", ""]
    every = definitions()
    for address in family.definitions:
        kind, _, short = address.partition(":")
        lines += _definition(f"{kind}.schema.json", short or kind, every[address])
    return "\n".join(lines).rstrip() + "\n"


@cache
def page_of() -> dict[str, str]:
    """Return the name of the reference page for each definition."""
    return {one: name for name, family in FAMILIES.items() for one in family.definitions}


def _definition(file: str, name: str, schema: Schema) -> Iterator[str]:
    yield from (f"## {name}", "")
    if file.partition(".")[0] == name:
        yield from _paragraph(schema["description"])
    else:
        yield from _described(file, schema)
    shared = _shared(file, name, schema)
    yield from _keys(file, name, schema, shared)
    if shared:
        links = ", ".join(f"[{one}](connections.md#anytransport{one})" for one in shared)
        yield from (f"Keys of every transport: {links}.", "")


def _shared(file: str, name: str, schema: Schema) -> list[str]:
    """Return the keys of a transport that have the same schema in every transport."""
    common = definitions()[COMMON]
    if schema is common or "type" not in schema.get("properties", {}):
        return []
    properties = common["properties"]
    return [
        key
        for key, inner in schema["properties"].items()
        if key in properties and inner == properties[key] and key != "type"
    ]


def missing() -> list[str]:
    """Return the paths of all properties without a description or an example."""
    found = []
    for kind in KINDS:
        file = f"{kind}.schema.json"
        schema = read_schema(file)
        for place, owner in _objects(kind, schema):
            for name, inner in owner.get("properties", {}).items():
                whole = _whole(file, inner)
                for word in ("description", "examples"):
                    if not whole.get(word):
                        found.append(f"{place}.{name}: {word}")
    return found


def _objects(kind: str, schema: Schema) -> Iterator[tuple[str, Schema]]:
    yield kind, schema
    for name, inner in schema.get("$defs", {}).items():
        yield f"{kind}: {name}", inner


def _keys(file: str, owner: str, schema: Schema, shared: list[str]) -> Iterator[str]:
    """Yield a section for each property, except the keys common to all transports."""
    usual = "yes, unless another key makes it optional"
    required = dict.fromkeys(_required_when_whole(schema), usual)
    required |= dict.fromkeys(schema.get("required", ()), "yes")
    own = {key: one for key, one in schema.get("properties", {}).items() if key not in shared}
    for name, inner in own.items():
        yield from (f"### {owner}.{name}", "")
        yield from _described(file, inner, required.get(name, ""))


def _required_when_whole(schema: Schema) -> list[str]:
    """Return the keys that may be omitted only in a part or in a document with a parent."""
    otherwise = schema.get("else", {})
    inner: list[str] = list(otherwise.get("required", ()))
    return inner + _required_when_whole(otherwise) if otherwise else inner


def _described(file: str, schema: Any, required: str = "") -> Iterator[str]:
    """Yield the description, type, allowed values and example of the value in a schema."""
    whole = _whole(file, schema)
    yield from _paragraph(whole.get("description", ""))
    facts = [("type", _type(file, schema))]
    if required:
        facts.append(("required", required))
    if "default" in whole:
        facts.append(("default", f"`{_yaml(whole['default'])}`"))
    if allowed := _allowed(whole):
        facts.append(("allowed", allowed))
    if "pattern" in whole:
        facts.append(("form", f"`{whole['pattern']}`"))
    for name, text in facts:
        yield f"- {name}: {text}"
    for example in whole.get("examples", ()):
        yield (
            f"- example: `` {_yaml(example)} ``"
            if "`" in _yaml(example)
            else (f"- example: `{_yaml(example)}`")
        )
    yield ""


def _paragraph(text: str) -> list[str]:
    """Return the text with one sentence per line, followed by an empty line."""
    sentences = re.sub(r"(?<=[a-z)`'\"}\]]\.) (?=[A-Z{`])", "\n", text)
    return [*sentences.split("\n"), ""] if text else []


def _whole(file: str, schema: Any) -> dict[str, Any]:
    """Return a schema merged with its references; the schema's own keys take precedence."""
    whole: dict[str, Any] = dict(schema) if isinstance(schema, Mapping) else {}
    while "$ref" in whole:
        file, target = _target(file, whole.pop("$ref"))
        whole = {**target, **whole}
        if "$ref" in target:
            whole["$ref"] = target["$ref"]
    return whole


def _target(file: str, reference: str) -> tuple[str, Schema]:
    other, _, pointer = reference.partition("#")
    file = other or file
    schema: Any = read_schema(file)
    for part in filter(None, pointer.split("/")):
        schema = schema[part]
    return file, schema


def _type(file: str, schema: Any) -> str:
    """Return the type in words, with a link to its definition."""
    if not isinstance(schema, Mapping):
        return "anything"
    if "$ref" in schema:
        return _link(file, schema["$ref"])
    kinds = _kinds(file, schema)
    if kinds:
        return ", or ".join(kinds)
    types = schema.get("type", ())
    names = [types] if isinstance(types, str) else list(types)
    words = [_TYPES[name] for name in names]
    if "const" in schema:
        return f"`{_yaml(schema['const'])}`"
    if not words:
        return "one of the values below" if "enum" in schema else "anything"
    inner = schema.get("additionalProperties")
    if "object" in names and isinstance(inner, Mapping):
        words[names.index("object")] = f"mapping of names to {_type(file, inner)}"
    if "array" in names and "items" in schema:
        words[names.index("array")] = f"list of {_type(file, schema['items'])}"
    return " or ".join(words)


def _kinds(file: str, schema: Schema) -> list[str]:
    """Return the types allowed by the `then` and `else` branches of a schema's `if`."""
    if "if" not in schema or ("properties" in schema and not _refers(schema)):
        return []
    found: list[str] = []
    for branch in ("then", "else"):
        inner = schema.get(branch)
        if isinstance(inner, Mapping):
            nested = _kinds(file, inner)
            if nested:
                found += nested
            elif "$ref" in inner or "type" in inner:
                found.append(_type(file, inner))
    return list(dict.fromkeys(found))


def _refers(schema: Schema) -> bool:
    return any("$ref" in schema.get(branch, {}) for branch in ("then", "else"))


def _link(file: str, reference: str) -> str:
    other, _, pointer = reference.partition("#")
    kind = (other or file).partition(".")[0]
    name = pointer.rpartition("/")[2]
    where = page_of()[f"{kind}:{name}" if name else kind]
    return f"[{name or kind}]({where}.md#{(name or kind).lower()})"


def _allowed(schema: Schema) -> str:
    """Return the allowed words or the allowed range of a value."""
    words = [f"`{_yaml(word)}`" for word in schema.get("enum", ())]
    bounds = [_bound(key, schema[key]) for key in _BOUNDS if key in schema]
    return ", ".join(words + bounds)


def _bound(key: str, limit: object) -> str:
    is_size = key in ("minLength", "minItems", "minProperties")
    return "not empty" if is_size and limit == 1 else _BOUNDS[key].format(limit)


def _yaml(value: object) -> str:
    """Return a value in YAML's flow style, on one line."""
    if isinstance(value, str):
        return value if _is_plain(value) else json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_yaml(str(key))}: {_yaml(item)}" for key, item in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list):
        return f"[{', '.join(map(_yaml, value))}]"
    return json.dumps(value)


def _is_plain(text: str) -> bool:
    is_word = _PLAIN.fullmatch(text) is not None and text == text.strip()
    return is_word and text.lower() not in _WORDS_OF_YAML


def index() -> str:
    """Return the page with the list of all families."""
    lines = [
        "# Keys of documents by task",
        "",
        "Every key of the language, generated from the schemas.",
        "Each page describes one family of keys.",
        "",
        "| page | keys |",
        "|---|---|",
        *(f"| [{one.title}]({name}.md) | {one.summary} |" for name, one in FAMILIES.items()),
        "",
        "```{toctree}",
        ":hidden:",
        "",
        *FAMILIES,
        "```",
        "",
    ]
    return "\n".join(lines)
