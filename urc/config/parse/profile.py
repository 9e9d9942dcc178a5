"""Parser for the settings and tags of a profile."""

from typing import Final

from urc.config.node import Node, Problems
from urc.config.values import check_range, check_within, fit, fit_hint, shown
from urc.model.profile import Setting
from urc.model.values import Value

__all__ = ["parse_setting", "parse_tags", "setting_value"]

_VALUE_TYPES: Final = {
    "integer": "integer",
    "number": "number",
    "boolean": "boolean",
    "port": "integer",
}
"""Types of the values of settings that are not text, by type of setting."""


def parse_setting(part: Node, problems: Problems) -> Setting:
    """Return the setting at `part`; report mistakes in the declaration."""
    kind = part.text("type")
    low, high = check_range(
        part, _VALUE_TYPES.get(kind, "string") if kind != "port" else kind, problems
    )
    choices = tuple(str(inner.data) for inner in part.listed("choices"))
    _check_choices(part, kind, choices, problems)
    is_secret = part.flag("secret", default=False)
    default_part = part.get("default")
    if is_secret and default_part is not None:
        problems.error(
            default_part,
            "secret-in-document",
            "a document must not contain a secret",
            key=True,
            hint="remove 'default': the operator enters the secret",
        )
    is_required = part.flag("required", default=True)
    if not is_required and default_part is not None:
        problems.error(
            part,
            "misplaced-key",
            "'required' has no effect with 'default', because the setting is never empty",
            at="required",
            key=True,
            hint="remove one of the two keys",
        )
    setting = Setting(
        name=part.name,
        type=kind,  # type: ignore[arg-type]  # the schema's enum is this Literal
        title=part.text("title", part.name.replace("_", " ").capitalize()),
        choices=choices,
        min=low,
        max=high,
        is_secret=is_secret,
        is_required=is_required,
        description=part.text("description"),
        group=part.text("group"),
        default=(
            None if default_part is None else setting_value(default_part, kind, choices, problems)
        ),
    )
    if default_part is not None:
        check_within(setting.default, low, high, default_part, problems)
    return setting


def parse_tags(part: Node, problems: Problems) -> tuple[str, ...]:
    """Return the tags of the robot at `part`; report duplicate tags."""
    tags: dict[str, None] = {}
    for inner in part.listed("tags"):
        if inner.data in tags:
            problems.error(
                inner,
                "duplicate-name",
                f"the tag {inner.data!r} is listed twice",
                hint="remove one of the two tags",
            )
        tags[inner.data] = None
    return tuple(tags)


def _check_choices(part: Node, kind: str, choices: tuple[str, ...], problems: Problems) -> None:
    """Report a setting of type ``choice`` without choices, and any other setting with choices."""
    if kind == "choice" and not choices:
        problems.error(part, "missing-key", "a setting of type choice needs 'choices'", key=True)
    if kind != "choice" and choices:
        problems.error(
            part,
            "misplaced-key",
            f"'choices' has no effect for type {kind}",
            at="choices",
            key=True,
            hint="write 'type: choice'",
        )


def setting_value(part: Node, kind: str, choices: tuple[str, ...], problems: Problems) -> Value:
    """Return the value of a setting in a document; None if a problem was reported."""
    wanted = _VALUE_TYPES.get(kind, "string")
    try:
        value = fit(part.data, wanted)
    except ValueError as error:
        problems.error(part, "wrong-type", str(error), hint=fit_hint(part.data, wanted))
        return None
    fault = ""
    if kind == "port" and not 1 <= int(value or 0) <= 65535:
        fault = f"expected a port from 1 to 65535, found {value}"
    elif kind == "host" and not _is_host(str(value)):
        fault = f"expected a host name or an address, found {shown(value)}"
    elif kind == "choice" and value not in choices:
        fault = f"{shown(value)} is not one of the choices"
    if fault:
        problems.error(part, "bad-value", fault)
        return None
    return value


def _is_host(text: str) -> bool:
    """Return whether a string may be a host name or address, without a scheme, port or spaces."""
    return 0 < len(text) <= 253 and not any(char.isspace() or char in "/@?#'\"" for char in text)
