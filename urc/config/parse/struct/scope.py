"""The scope of one struct: the unique names that its expressions may use."""

from collections.abc import Iterator
from typing import Literal

from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import COUNTERS, Template
from urc.model.binary import FRAME_NAMES, OUTER_NAMES, Item, names_of, number_of, scope_of

__all__ = ["Scope"]


class Scope:
    """The names of all items before the current position in a struct."""

    def __init__(self, problems: Problems, purpose: Literal["read", "send", "type"]) -> None:
        self.known: dict[str, Item | None] = {}
        """Items by name; None for a known name that has no item in this struct."""
        self.uses: list[tuple[Node, Template]] = []
        """Expressions that use arguments or settings, with their nodes."""
        self._problems = problems
        self._purpose = purpose

    def get(self, name: str) -> Item | None:
        """Return the item with this name; None for an unknown name."""
        return self.known.get(name.strip())

    @staticmethod
    def names(item: Item) -> Iterator[str]:
        """Yield the names that an item adds to the scope."""
        yield from names_of((item,))

    def add(self, part: Node, item: Item) -> None:
        """Add an item to the scope; report a duplicate name at `part`."""
        own = {one.id: one for one in scope_of((item,)) if one.id}
        if item.switch is not None:
            return  # the items of its cases were already added
        for name in self.names(item):
            self.know(part, name, own.get(name))
            if self._purpose == "send" and own.get(name, item).value is None:
                self.uses.append((part, _argument(part, name)))
        if self._purpose == "send" and item.kind == "struct":
            self.uses += [(part, one) for one in _outer_values(item.items)]

    def know(self, part: Node, name: str, item: Item | None) -> None:
        """Add one name to the scope; report a duplicate name."""
        if name in self.known:
            at = "id" if isinstance(part.data, dict) and "id" in part.data else ""
            text = f"another item has the name {name!r}"
            self._problems.error(
                part, "duplicate-name", text, at=at, hint="give each of them its own name"
            )
        self.known[name] = item

    def check_name(self, part: Node, name: str) -> None:
        """Report a reserved or invalid id."""
        if name in FRAME_NAMES or number_of(name) is not None or name == "settings":
            self._problems.error(part, "bad-name", f"{name!r} is a reserved name")
        elif name and not (name.isidentifier() and name.isascii() and name == name.lower()):
            text = f"{name!r} is not a valid item name"
            hint = "use lower-case letters, digits and underscores"
            self._problems.error(part, "bad-name", text, hint=hint)

    def expression(self, part: Node) -> Template | None:
        """Return the expression at `part`; report names that are not in the scope."""
        return self._expression(part, frozenset())

    def _expression(self, part: Node, outer: frozenset[str]) -> Template | None:
        expression = self._problems.expression(part)
        return None if expression is None else self._checked(part, expression, outer)

    def value(self, part: Node | None) -> Template | None:
        """Return a sent value, which is an expression or a number."""
        if part is None:
            return None
        if isinstance(part.data, str):
            # A sent type may use names from outside the type; a received struct ignores 'value'.
            return self._expression(part, OUTER_NAMES if self._purpose == "type" else frozenset())
        from urc.expressions import compile_expression

        return compile_expression(repr(part.data))

    def _checked(self, part: Node, expression: Template, outer: frozenset[str]) -> Template:
        if self._purpose == "send":
            self.uses.append((part, expression))
            return expression
        for name in sorted(expression.names - self.known.keys() - FRAME_NAMES - outer):
            found = expression.source.find("seq" if name == COUNTERS else name)
            self._problems.error(
                part,
                "unknown-name",
                f"no earlier item has the name {name!r}",
                offset=max(found, 0),
                length=len(name),
                hint=self._hint(name),
            )
        return expression

    def _hint(self, name: str) -> str:
        if name in ("settings", COUNTERS) and self._purpose == "type":
            return (
                "only the 'value' of an item in a type may use settings and seq(), because"
                " received frames have neither"
            )
        if name == "settings":
            return "to compare a frame with a setting, use 'when' next to the struct"
        return did_you_mean(name, [*self.known, *FRAME_NAMES], "names")


def _outer_values(items: tuple[Item, ...]) -> Iterator[Template]:
    """Yield each `value` in a type's items that uses settings or counters."""
    for item in items:
        if item.value is not None and item.value.names & OUTER_NAMES:
            one = item.value
            yield Template(one.source, one.python, one.names & OUTER_NAMES, one.settings)
        yield from _outer_values(item.items)
        if item.switch is not None:
            for _, case in item.switch.cases:
                yield from _outer_values(case)
            yield from _outer_values(item.switch.default or ())


def _argument(part: Node, name: str) -> Template:
    """Return an expression that reads the argument `name`."""
    source = part.data if isinstance(part.data, str) else name
    return Template(source, f"ns[{name!r}]", frozenset((name,)), frozenset())
