"""Checks the topics of Zenoh transports, which are keys and key expressions."""

from typing import Final

from urc.config.node import Node, Problems
from urc.expressions import ExpressionError, split_template
from urc.key_expressions import key_fault

__all__ = ["check_key", "check_sent_keys"]

_IDLE: Final = ("type", "stamped", "qos", "retain")
"""Keys of a sent message that have no effect on Zenoh."""


def check_sent_keys(part: Node, problems: Problems) -> None:
    """Report an invalid topic of the message at `part`, and keys that have no effect."""
    check_key(part.get("topic"), problems)
    for name in _IDLE:
        if name in part.data:
            problems.error(
                part,
                "misplaced-key",
                f"{name!r} has no effect on zenoh",
                at=name,
                key=True,
                hint=f"remove {name!r}: Zenoh keeps no values, and keys have no types",
            )


def check_key(part: Node | None, problems: Problems, *, is_expression: bool = False) -> None:
    """Report a topic at `part` that is not a key, or not a key expression.

    An inserted value counts as ordinary text; the transport checks the actual value.
    """
    if part is None or not isinstance(part.data, str):
        return
    try:
        pieces = list(split_template(part.data))
    except ExpressionError:
        return  # reported where the template is compiled
    key = "".join("x" if expression is not None else text for _, text, expression in pieces)
    fault = key_fault(key, is_expression=is_expression)
    if fault:
        what = "key expression" if is_expression else "key"
        example = "cells/*/volts" if is_expression else "lamp/set"
        problems.error(
            part,
            "wrong-key",
            f"{part.data!r} is not a Zenoh {what}: {fault}",
            hint=f"write a {what} such as {example}",
        )
