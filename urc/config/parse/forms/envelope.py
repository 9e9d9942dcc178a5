"""The forms of message transports: `publish`, `call`, `goal`, `request`, `get`.

An envelope has an address and a body. The address may contain templates, and the body has one of
the other forms.
"""

from collections.abc import Iterable
from typing import Any, Final

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext, body_form
from urc.config.parse.forms.json_text import compiled_tree, placed_templates, templates_in
from urc.config.parse.forms.stamped import stamped_body, stamped_type
from urc.config.parse.headers import check_headers
from urc.expressions import Template, compile_template
from urc.model.payload import WriteSpec

__all__ = ["parse_write", "templates"]

_BODY: Final = "body"


def parse_write(part: Node, problems: Problems, context: FormContext) -> WriteSpec | None:
    """Return the envelope at `part`; the key of `part`, such as ``publish``, is the verb."""
    body = body_form(part)
    spec = body[1].parse_write(body[0], problems, context) if body else None
    before = len(problems.problems)
    check_headers(part, problems)
    attributes = {
        name: compiled_tree(inner, problems)
        for name, inner in part.entries().items()
        if name != "stamped" and (body is None or inner.path != body[0].path)
    }
    if (body and spec is None) or len(problems.problems) > before:
        return None
    if part.name == "request" and ("url" in part.data) == ("path" in part.data):
        both = "url" in part.data
        text = "'path' and 'url' cannot be used together" if both else "'path' is missing"
        hint = "write 'path', or 'url' for an address that the robot reported"
        problems.error(part, "two-forms" if both else "missing-key", text, key=True, hint=hint)
        return None
    url = attributes.get("url")
    if isinstance(url, Template) and any(not name.startswith("_") for name in url.names):
        text = "'url' must consist of one field from the robot, such as _next"
        hint = "put arguments and settings into 'path' or 'query', which cannot change the server"
        problems.error(part.must("url"), "wrong-form", text, hint=hint)
        return None
    stamped = part.get("stamped") if part.name == "publish" else None
    if stamped is not None and stamped.data:
        spec = _stamped(part, attributes, spec, problems)
        if spec is None:
            return None
    if part.name == "request":
        attributes.setdefault("method", "GET" if spec is None else "POST")
    found = list(templates_in(attributes))
    names = [one.names for one in found] + ([spec.names] if spec else [])
    settings = [one.settings for one in found] + ([spec.settings] if spec else [])
    return WriteSpec(
        "envelope",
        {"verb": part.name, "attributes": attributes, _BODY: spec},
        frozenset[str]().union(*names),
        frozenset[str]().union(*settings),
    )


def _stamped(
    part: Node, attributes: dict[str, Any], spec: WriteSpec | None, problems: Problems
) -> WriteSpec | None:
    """Return the body of a stamped message, and set its type in `attributes`; None after a problem.

    If `stamped` is an expression, the type is a template, and the writer chooses the body: it knows
    the settings.
    """
    plain = attributes.get("type")
    kind = stamped_type(part, plain, problems)
    if kind is None or spec is None:
        return None
    body = stamped_body(kind, spec.options["tree"])
    inner = part.must("stamped")
    if not isinstance(inner.data, str):
        attributes["type"] = kind
        return spec._replace(options={"tree": body})
    chosen = problems.expression(inner)
    if chosen is None:
        return None
    if not chosen.names <= {"settings"}:
        others = ", ".join(sorted(chosen.names - {"settings"}))
        text = f"'stamped' can use only settings, found {others}"
        problems.error(inner, "unknown-name", text, hint="write settings.NAME, true or false")
        return None
    attributes["type"] = compile_template(
        f"{{{{ '{kind}' if ({inner.data}) else '{plain}' }}}}",
    )
    options = {**spec.options, "stamped": body, "is_stamped": chosen}
    return spec._replace(options=options, settings=spec.settings | chosen.settings)


def _unstamped(part: Node, spec: WriteSpec) -> WriteSpec:
    """Return the declaration of the body as written, without the conversion to the stamped type."""
    tree = spec.options.get("tree")
    if part.data.get("stamped") is not True or not isinstance(tree, dict):
        return spec
    return spec._replace(options={"tree": next(reversed(tree.values()))})


def templates(part: Node, spec: WriteSpec) -> Iterable[tuple[Node, Template]]:
    """Return every template of the envelope, with its position."""
    attributes = spec.options.get("attributes")
    if isinstance(attributes, dict):
        for name, tree in attributes.items():
            if name in part.data:
                yield from placed_templates(part.must(name), tree)
    body, written = body_form(part), spec.options.get(_BODY)
    if body and isinstance(written, WriteSpec):
        yield from body[1].templates(body[0], _unstamped(part, written))
