"""A stand-in for `rpds`: persistent collections by copying.

The collections implement the part of the interface that jsonschema and referencing use. A copy is
fast enough: the schemas of URC add few entries, once.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Generic, TypeVar

__all__ = ["HashTrieMap", "HashTrieSet", "List"]

K = TypeVar("K")
V = TypeVar("V")


class HashTrieMap(Mapping[K, V]):
    """An immutable map; changes return another map."""

    __slots__ = ("_items",)

    def __init__(self, value: Mapping[K, V] | Iterable[tuple[K, V]] = (), **named: Any) -> None:
        """Copy `value`, a map or pairs of key and value."""
        self._items: dict[Any, Any] = dict(value, **named)

    def __getitem__(self, key: K) -> V:
        """Return the value of `key`; raise KeyError if it is missing."""
        found: V = self._items[key]
        return found

    def __iter__(self) -> Iterator[K]:
        """Iterate over the keys."""
        return iter(self._items)

    def __len__(self) -> int:
        """Return the number of keys."""
        return len(self._items)

    def __hash__(self) -> int:
        """Return the hash of all items; raise TypeError if a value has none."""
        return hash(frozenset(self._items.items()))

    def __repr__(self) -> str:
        return f"HashTrieMap({self._items!r})"

    @classmethod
    def convert(cls, value: "Mapping[K, V] | Iterable[tuple[K, V]]") -> "HashTrieMap[K, V]":
        """Return `value` as a map of this type."""
        return value if isinstance(value, HashTrieMap) else cls(value)

    def insert(self, key: K, val: V) -> "HashTrieMap[K, V]":
        """Return a map with one more item."""
        return HashTrieMap({**self._items, key: val})

    def update(self, *args: Mapping[K, V] | Iterable[tuple[K, V]]) -> "HashTrieMap[K, V]":
        """Return a map with the items of all `args` added."""
        items = dict(self._items)
        for one in args:
            items.update(one)
        return HashTrieMap(items)

    def remove(self, key: K) -> "HashTrieMap[K, V]":
        """Return a map without `key`; raise KeyError if it is missing."""
        items = dict(self._items)
        del items[key]
        return HashTrieMap(items)

    def discard(self, key: K) -> "HashTrieMap[K, V]":
        """Return a map without `key`, which may be missing."""
        return self.remove(key) if key in self._items else self


class HashTrieSet(frozenset[V]):
    """An immutable set; changes return another set."""

    __slots__ = ()

    def insert(self, value: V) -> "HashTrieSet[V]":
        """Return a set with one more value."""
        return HashTrieSet(self | {value})

    def update(self, *args: Iterable[V]) -> "HashTrieSet[V]":
        """Return a set with the values of all `args` added."""
        return HashTrieSet(self.union(*args))

    def remove(self, value: V) -> "HashTrieSet[V]":
        """Return a set without `value`; raise KeyError if it is missing."""
        if value not in self:
            raise KeyError(value)
        return self.discard(value)

    def discard(self, value: V) -> "HashTrieSet[V]":
        """Return a set without `value`, which may be missing."""
        return HashTrieSet(self - {value})


class List(Generic[V]):
    """An immutable list; changes return another list."""

    __slots__ = ("_values",)

    def __init__(self, value: Iterable[V] = (), *more: V) -> None:
        """Copy the values of an iterable, or of the arguments."""
        self._values: tuple[V, ...] = (value, *more) if more else tuple(value)  # type: ignore[arg-type]

    def __iter__(self) -> Iterator[V]:
        """Iterate over the values, first to last."""
        return iter(self._values)

    def __len__(self) -> int:
        """Return the number of values."""
        return len(self._values)

    def __eq__(self, other: object) -> bool:
        """Return whether `other` is a list with equal values."""
        return isinstance(other, List) and self._values == other._values

    def __hash__(self) -> int:
        """Return the hash of all values."""
        return hash(self._values)

    def __repr__(self) -> str:
        return f"List({list(self._values)!r})"

    def push_front(self, value: V) -> "List[V]":
        """Return a list that begins with `value`."""
        return List((value, *self._values))
