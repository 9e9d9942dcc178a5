r"""Regular expressions in documents, matched in linear time.

Only `urc.patterns` and `urc.filters.lists` use this module. All patterns use the RE2 dialect, which
has no look-around and no back-references. In RE2, ``$`` matches only the end of the text, and
``\d`` matches only ASCII digits. A pattern runs on `re` if `_is_linear` proves linear time, because
`re` is ten times faster for short lines. Unproven patterns run on RE2, or are refused if RE2 is not
installed.

Theory of operation: backtracking takes more than linear time only if two parts of a pattern can
match the same characters in many ways. Every proven pattern has a start anchor, and its
alternatives start with different characters. Every repeat in a proven pattern matches a single set
of characters, and the set excludes every character that may follow the repeat.

The run time of RE2 is proportional to the text size times the program size. A program contains
every repeat ``{n}`` in expanded form. A size limit for unproven patterns therefore limits the run
time. This module computes the size of a pattern from its source, independently of RE2.
"""

import re
import warnings
from collections.abc import Callable, Mapping
from re import _constants, _parser  # type: ignore[attr-defined]  # the syntax tree is private
from typing import Any, Final, Protocol

from urc.problems import UrcError

__all__ = [
    "Pattern",
    "PatternError",
    "can_be_empty",
    "compile_pattern",
    "cost_of",
    "example",
    "is_plain_group",
    "literal_prefix",
]

_OTHER_GROUP: Final = re.compile(r"\(?\?<([A-Za-z_]\w*)>")
"""Pattern for a named group in the syntax of JavaScript, PCRE and .NET."""
MAX_SOURCE: Final = 1024
MAX_REPEAT: Final = 1000
"""Maximum ``n`` of a repeat ``{n}`` in RE2."""
MAX_COST: Final = 1000
"""Maximum size of an unproven pattern with expanded repeats, approximately in RE2 instructions.

The pattern ``\\$[^\\r\\n]{1,80}\\r\\n`` for an NMEA 0183 sentence has a size of 802. The slowest
pattern within the limit takes about half a second for a frame of 64 KiB.
"""
_RE2_BYTES: Final = 4 << 20
"""Memory limit of RE2 for one pattern, in bytes. With only 1 MiB, RE2 is a hundred times slower for
repeats of optional parts."""
_BEYOND_ASCII: Final = 6
"""Number of RE2 instructions for all non-ASCII characters, which RE2 matches byte by byte."""

_OTHER = 128
"""Number that represents all non-ASCII characters in a character set."""
_ALL = frozenset(range(129))
_DIGITS = frozenset(range(48, 58))
_SPACES = frozenset(b" \t\n\r\f\v")
_WORD = _DIGITS | frozenset(range(65, 91)) | frozenset(range(97, 123)) | {95}
_CATEGORIES: dict[Any, frozenset[int]] = {
    _constants.CATEGORY_DIGIT: _DIGITS,
    _constants.CATEGORY_NOT_DIGIT: _ALL - _DIGITS,
    _constants.CATEGORY_SPACE: _SPACES,
    _constants.CATEGORY_NOT_SPACE: _ALL - _SPACES,
    _constants.CATEGORY_WORD: _WORD,
    _constants.CATEGORY_NOT_WORD: _ALL - _WORD,
}
_REFUSED: dict[Any, str] = {
    _constants.ASSERT: "look-ahead and look-behind",
    _constants.ASSERT_NOT: "look-ahead and look-behind",
    _constants.GROUPREF: "back-references",
    _constants.GROUPREF_EXISTS: "conditional groups",
    _constants.ATOMIC_GROUP: "atomic groups",
    _constants.POSSESSIVE_REPEAT: "possessive repeats",
}


_INSTEAD: dict[Any, str] = dict.fromkeys(_REFUSED, "")
_INSTEAD[_constants.ASSERT] = (
    "; match the whole text, and capture the wanted part with a named group"
)
_INSTEAD[_constants.ASSERT_NOT] = "; match the allowed text instead, or exclude frames with 'when'"
_INSTEAD[_constants.GROUPREF] = "; name both groups and compare them with 'when: a == b'"


class PatternError(UrcError):
    """An invalid pattern; `offset` is the 0-based character position of the error."""

    def __init__(self, message: str, offset: int = 0) -> None:
        super().__init__(message)
        self.offset = offset


class _Match(Protocol):
    def groupdict(self) -> dict[str, str | None]: ...


class Pattern:
    """A compiled, immutable pattern. Patterns with equal source are equal."""

    __slots__ = ("_search", "groups", "is_proven", "source")

    def __init__(self, source: str, groups: tuple[str, ...], search: Any, is_proven: bool) -> None:
        self.source = source
        """Source of the pattern, as in the document."""
        self.groups = groups
        """Names of the pattern's groups, in order."""
        self.is_proven = is_proven
        """Whether the pattern runs on `re` instead of RE2."""
        self._search = search

    @property
    def places(self) -> Mapping[str, int]:
        """Number of each named group, by group name."""
        tree = _parser.parse(self.source, re.ASCII)
        return dict(tree.state.groupdict)

    @property
    def match(self) -> Callable[[str], "re.Match[str] | None"] | None:
        """The compiled matcher of a proven pattern; None for a pattern on RE2."""
        return self._search if self.is_proven else None

    def search(self, text: str) -> Mapping[str, str | None] | None:
        """Return the named groups of the first match in `text`; None if there is no match."""
        found: _Match | None = self._search(text)
        return None if found is None else found.groupdict()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Pattern) and other.source == self.source

    def __hash__(self) -> int:
        return hash(self.source)

    def __repr__(self) -> str:
        return f"Pattern({self.source!r})"


def compile_pattern(text: str, *, is_over_bytes: bool = False) -> Pattern:
    """Compile a pattern.

    Args:
        text: source of the pattern, as in the document.
        is_over_bytes: whether the pattern matches bytes, each as one character, instead of text.

    Raises:
        PatternError: the pattern is invalid or unsupported, or RE2 is required but not installed.
    """
    if len(text) > MAX_SOURCE:
        raise PatternError(f"a pattern may have at most {MAX_SOURCE} characters, found {len(text)}")
    try:
        with warnings.catch_warnings():
            # Python plans a new meaning for "[[", "--" and "&&" in a character class.
            warnings.simplefilter("error", FutureWarning)
            tree = _parser.parse(text, re.ASCII)
    except FutureWarning as error:
        words = str(error).lower()
        raise PatternError(f"{words}: escape the character with a backslash: {text!r}") from None
    except re.error as error:
        named = _OTHER_GROUP.match(text, error.pos or 0)
        said = f"a named group begins with (?P<{named[1]}>" if named else error.msg
        raise PatternError(f"invalid pattern: {said}", error.pos or 0) from None
    except (RecursionError, OverflowError):
        raise PatternError("the pattern is nested too deeply or repeats too often") from None
    _check_dialect(tree, text)
    names = tree.state.groupdict
    groups = tuple(sorted(names, key=names.__getitem__))
    if _is_linear(tree, text):
        ends_there = tree[-1] == (_constants.AT, _constants.AT_END)
        source = text[:-1] + r"\Z" if ends_there else text
        return Pattern(text, groups, re.compile(source, re.ASCII).match, True)
    cost = _cost(tree, 1 if is_over_bytes else _BEYOND_ASCII)
    if cost > MAX_COST:
        raise PatternError(
            f"this pattern has {cost} parts, but the limit is {MAX_COST}: use smaller numbers in"
            " {…}, or start with '^' and let no repeat match the start of the next part"
        )
    return Pattern(text, groups, _re2_search(text), False)


def example(pattern: Pattern, groups: Mapping[str, str], variant: int = 0) -> str:
    """Return a short string that matches `pattern`, with the text of `groups` in its named groups.

    The caller must check that the result really matches `pattern`.

    Args:
        pattern: pattern to match.
        groups: text of each named group, by name.
        variant: number of the example to return, from 0. Variant 0 omits optional parts that
            contain none of `groups`, and uses the first alternatives and the first printable
            characters. Other variants use other alternatives, characters and numbers of repeats.
    """
    tree = _parser.parse(pattern.source, re.ASCII)
    names = {number: name for name, number in tree.state.groupdict.items()}
    return _example(tree, names, groups, variant)


def literal_prefix(pattern: Pattern) -> str:
    """Return the literal start of every match of a proven pattern; "" for other patterns."""
    if not pattern.is_proven:
        return ""
    prefix = ""
    for operation, argument in list(_parser.parse(pattern.source, re.ASCII))[1:]:
        if operation is not _constants.LITERAL:
            break
        prefix += chr(argument)
    return prefix


def is_plain_group(pattern: Pattern, name: str) -> bool:
    """Return whether a group can never match ``_`` or non-ASCII characters."""
    tree = _parser.parse(pattern.source, re.ASCII)
    found = _alphabet(tree, tree.state.groupdict[name])
    return found is not None and not found & {_OTHER, ord("_")}


def can_be_empty(pattern: Pattern, name: str) -> bool:
    """Return whether a group can match the empty string."""
    tree = _parser.parse(pattern.source, re.ASCII)
    return bool(_least_width(tree, tree.state.groupdict[name]) == 0)


def _least_width(tree: Any, number: int) -> int | None:
    """Return the group's minimum length in characters; None for a group outside `tree`."""
    for operation, argument in tree:
        if operation is _constants.SUBPATTERN and argument[0] == number:
            return int(argument[3].getwidth()[0])
        for part in _parts(operation, argument):
            found = _least_width(part, number)
            if found is not None:
                return found
    return None


def _alphabet(tree: Any, number: int) -> frozenset[int] | None:
    """Return all possible characters of the group; None for a group outside `tree`."""
    for operation, argument in tree:
        if operation is _constants.SUBPATTERN and argument[0] == number:
            return _letters(argument[3])
        for part in _parts(operation, argument):
            found = _alphabet(part, number)
            if found is not None:
                return found
    return None


def _letters(tree: Any) -> frozenset[int]:
    letters: frozenset[int] = frozenset()
    for operation, argument in tree:
        parts = _parts(operation, argument)
        if parts:
            letters = letters.union(*map(_letters, parts))
        elif operation is not _constants.AT:
            letters |= _characters(operation, argument) or _ALL
    return letters


def _example(tree: Any, names: Mapping[int, str], groups: Mapping[str, str], variant: int) -> str:
    pieces: list[str] = []
    for operation, argument in tree:
        if operation is _constants.SUBPATTERN:
            name = names.get(argument[0], "")
            inner = _example(argument[3], names, groups, variant)
            pieces.append(groups.get(name, inner) if name else inner)
        elif operation is _constants.BRANCH:
            chosen = [part for part in argument[1] if _mentions(part, names, groups)]
            ways = chosen or argument[1]
            pieces.append(_example(ways[variant % len(ways)], names, groups, variant))
        elif operation in (_constants.MAX_REPEAT, _constants.MIN_REPEAT):
            low, high, inner = argument
            most = low + variant if high is _constants.MAXREPEAT else high
            times = max(min(low + variant, most), int(_mentions(inner, names, groups)))
            pieces.append(_example(inner, names, groups, variant) * times)
        elif operation is _constants.LITERAL:
            pieces.append(chr(argument))
        elif operation is not _constants.AT:
            pieces.append(_printable(_characters(operation, argument), variant))
    return "".join(pieces)


def _mentions(tree: Any, names: Mapping[int, str], groups: Mapping[str, str]) -> bool:
    """Return whether `tree` contains one of `groups`."""
    for operation, argument in tree:
        if operation is _constants.SUBPATTERN and names.get(argument[0], "") in groups:
            return True
        if any(_mentions(part, names, groups) for part in _parts(operation, argument)):
            return True
    return False


def _printable(characters: frozenset[int] | None, variant: int) -> str:
    wanted = characters or _ALL
    preferred = (*range(48, 58), *range(97, 123), *range(32, 48), *range(58, 97), *range(123, 127))
    found = [code for code in preferred if code in wanted] or [min(wanted, default=63)]
    # Variant 0 is the first character, 1 is the last, and others are in between.
    return chr(found[0 if not variant else -1 if variant == 1 else variant * 7 % len(found)])


def _check_dialect(tree: Any, text: str) -> None:
    for operation, argument in tree:
        if operation in _REFUSED:
            raise PatternError(
                f"{_REFUSED[operation]} are not supported: {text!r}{_INSTEAD[operation]}"
            )
        if operation in (_constants.MAX_REPEAT, _constants.MIN_REPEAT):
            low, high, _ = argument
            if max(low, 0 if high is _constants.MAXREPEAT else high) > MAX_REPEAT:
                raise PatternError(f"a repeat count may be at most {MAX_REPEAT}: {text!r}")
        for part in _parts(operation, argument):
            _check_dialect(part, text)


def _parts(operation: Any, argument: Any) -> list[Any]:
    """Return the child syntax trees of one node."""
    if operation is _constants.SUBPATTERN:
        return [argument[3]]
    if operation in (_constants.MAX_REPEAT, _constants.MIN_REPEAT):
        return [argument[2]]
    return list(argument[1]) if operation is _constants.BRANCH else []


def cost_of(source: str) -> int:
    """Return the size of a pattern with expanded repeats, approximately in RE2 instructions."""
    return _cost(_parser.parse(source, re.ASCII))


def _cost(tree: Any, beyond: int = _BEYOND_ASCII) -> int:
    """Return the size of the RE2 program; `beyond` is the size for all non-ASCII characters."""
    return sum(_cost_of_item(operation, argument, beyond) for operation, argument in tree)


def _cost_of_item(operation: Any, argument: Any, beyond: int) -> int:
    if operation is _constants.LITERAL:
        return 1 if beyond == 1 else len(chr(argument).encode("utf-8", "surrogatepass"))
    if operation is _constants.SUBPATTERN:
        return _cost(argument[3], beyond) + (0 if argument[0] is None else 2)
    if operation is _constants.BRANCH:
        return sum(_cost(part, beyond) + 1 for part in argument[1]) - 1
    if operation in (_constants.MAX_REPEAT, _constants.MIN_REPEAT):
        low, high, inner = argument
        once = _cost(inner, beyond)
        if high is _constants.MAXREPEAT:
            return int(max(low, 1) * once + 1)
        return int(high * once + (high - low))
    characters = _characters(operation, argument)
    if characters is None:
        return 1
    starts = sum(1 for code in characters if code < _OTHER and code - 1 not in characters)
    return starts + (beyond if _OTHER in characters else 0)


def _re2_search(text: str) -> Any:
    try:
        import re2
    except ImportError:
        raise PatternError(
            "this pattern needs google-re2, which is not installed: start with '^' and let no"
            f" repeat match the start of the next part: {text!r}"
        ) from None
    options = re2.Options()
    options.log_errors = False
    options.max_mem = _RE2_BYTES
    try:
        return re2.compile(text, options).search
    except re2.error as error:
        reason = error.args[0] if error.args else "unknown"
        words = reason.decode("utf-8", "replace") if isinstance(reason, bytes) else str(reason)
        raise PatternError(f"invalid RE2 pattern: {words}") from None


class _NotProven(Exception):
    """Raised if linear time cannot be proven; the pattern may nevertheless run in linear time."""


def _is_linear(tree: Any, text: str) -> bool:
    items = list(tree)
    if not items or items[0] != (_constants.AT, _constants.AT_BEGINNING):
        return False
    ends = [place for place, item in enumerate(items) if item == (_constants.AT, _constants.AT_END)]
    if ends and (ends != [len(items) - 1] or not text.endswith("$")):
        return False
    if tree.state.flags & ~(re.ASCII | re.UNICODE):
        return False
    try:
        _first_of(items[1 : ends[0] if ends else None], frozenset())
    except _NotProven:
        return False
    return True


def _first_of(items: list[Any], follow: frozenset[int]) -> frozenset[int]:
    """Check each item; return the possible first characters of `items` followed by `follow`.

    The check runs from the last item to the first, because checking an item requires the possible
    next characters.
    """
    for operation, argument in reversed(items):
        follow = _first_of_item(operation, argument, follow)
    return follow


def _first_of_item(operation: Any, argument: Any, follow: frozenset[int]) -> frozenset[int]:
    characters = _characters(operation, argument)
    if characters is not None:
        return characters
    if operation is _constants.SUBPATTERN:
        _, add_flags, remove_flags, inner = argument
        if add_flags or remove_flags:
            raise _NotProven
        return _first_of(list(inner), follow)
    if operation is _constants.BRANCH:
        return _first_of_branch(argument[1], follow)
    if operation in (_constants.MAX_REPEAT, _constants.MIN_REPEAT):
        return _first_of_repeat(argument, follow)
    raise _NotProven


def _first_of_branch(alternatives: Any, follow: frozenset[int]) -> frozenset[int]:
    union: frozenset[int] = frozenset()
    for alternative in alternatives:
        first = _first_of(list(alternative), follow)
        if not alternative or union & first:
            raise _NotProven
        union |= first
    return union


def _first_of_repeat(argument: Any, follow: frozenset[int]) -> frozenset[int]:
    low, high, inner = argument
    items = list(inner)
    one = _characters(*items[0]) if len(items) == 1 else None
    if low == high and all(_characters(*item) is not None for item in items):
        return (_characters(*items[0]) or follow) if low and items else follow
    if one is None and items and items[0][0] is _constants.SUBPATTERN and len(items) == 1:
        group = list(items[0][1][3])
        one = _characters(*group[0]) if len(group) == 1 else None
    if one is None:
        if high != 1:
            raise _NotProven
        one = _first_of(items, follow)
        if any(item[0] in (_constants.MAX_REPEAT, _constants.MIN_REPEAT) for item in items[:1]):
            raise _NotProven
    if one & follow:
        raise _NotProven
    return one if low else one | follow


def _characters(operation: Any, argument: Any) -> frozenset[int] | None:
    """Return the character set of a single-character item; None for other items."""
    if operation is _constants.LITERAL:
        return frozenset((min(argument, _OTHER),))
    if operation is _constants.NOT_LITERAL:
        return _ALL - {argument} if argument < _OTHER else _ALL
    if operation is _constants.ANY:
        return _ALL - {10}
    if operation is not _constants.IN:
        return None
    union: set[int] = set()
    is_negated = False
    for kind, value in argument:
        if kind is _constants.NEGATE:
            is_negated = True
        elif kind is _constants.LITERAL:
            union.add(min(value, _OTHER))
        elif kind is _constants.RANGE:
            union.update(range(min(value[0], _OTHER), min(value[1], _OTHER) + 1))
        else:
            union |= _CATEGORIES[value]
    # A negated class that contains non-ASCII characters still matches all other non-ASCII
    # characters.
    return (_ALL - (union - {_OTHER})) if is_negated else frozenset(union)
