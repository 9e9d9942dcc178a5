"""The docstrings of a message type's fields, for the OpenAPI document and the reference.

Python discards the docstrings of fields, so this module reads the source code of the types.
"""

import ast
import inspect
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise

__all__ = ["field_texts"]


def field_texts(message: type) -> Mapping[str, str]:
    """Return the field docstrings of `message` and its base classes, keyed by field name.

    If the source code is not available, the result is empty.
    """
    found: dict[str, str] = {}
    for one in reversed(message.__mro__):
        found |= _texts_of_module(one.__module__).get(one.__qualname__, {})
    return found


@cache
def _texts_of_module(name: str) -> Mapping[str, Mapping[str, str]]:
    """Return the field docstrings of each class in a module, keyed by class name."""
    try:
        source = inspect.getsource(sys.modules[name])
    except (OSError, TypeError):  # a module without a file
        return {}
    body = ast.parse(source).body
    return {one.name: dict(_texts(one)) for one in body if isinstance(one, ast.ClassDef)}


def _texts(definition: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for field, text in pairwise(definition.body):
        if not isinstance(field, ast.AnnAssign) or not isinstance(field.target, ast.Name):
            continue
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            yield field.target.id, inspect.cleandoc(str(text.value.value))
