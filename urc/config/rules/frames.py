"""Rules for frames: patterns that match too much, and unused names.

These rules only issue warnings. The rules report two declarations of the same frame only if an
example frame matches both.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, Final, cast

from urc.config.node import Node, Problems
from urc.config.parse.form import read_form
from urc.model.binary import Item, fixed_size
from urc.model.driver import Driver, Reply
from urc.model.exchange import ProvisionalReplies
from urc.model.payload import ReadSpec
from urc.model.values import Signal
from urc.patterns import Pattern, can_be_empty, example

__all__ = ["check_frames_apart"]

_FILLINGS: Final = ("0", "7", "-1.5", "q", "Zq", "a b", "~", "A5", "F", "+12", "x_1", "")
"""Sample values of a field for example frames; a pattern may reject some values."""
_VARIANTS: Final = 6
_SHOWN: Final = 40
_WORD: Final = re.compile(r"\w+")
_LETTERS: Final = re.compile(r"\^([A-Za-z0-9 :,=/_-]*)")
_GROUP: Final = re.compile(r"\(\?(?:P<\w+>|:)")
_MAY_BE_LESS: Final = re.compile(r"[*?|{]|\(\)")
"""Pattern for the syntax that lets a group match empty text."""


def check_frames_apart(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about ambiguous, empty or unused frame declarations in the driver at `part`."""
    _check_messages(part, driver, problems)
    for inner, reply in _replies(part, driver):
        _check_refusals(inner, reply, problems)
        for stage, read in _stages(inner, reply):
            _check_empty(stage, read, driver.signals, problems)
    _check_shared_refusals(part, driver, problems)
    for name, inner in part.named("messages").items():
        _check_empty(inner, driver.messages[name].read, driver.signals, problems)
    for inner in _prompts(part):
        pattern = problems.pattern(inner)
        if pattern is not None and _finds(pattern, ""):
            problems.warn(
                inner,
                "matches-empty",
                "the pattern matches empty text, so any first byte counts as the prompt",
                hint="match the end of the prompt, such as 'login: $'",
            )
    _check_words(part, problems)


def _prompts(part: Node) -> Iterator[Node]:
    """Yield the pattern of every prompt in the steps of the driver at `part`."""
    for inner in part.named("sequences").values():
        yield from _prompts_in(inner)
    for inner in part.named("transports").values():
        for key in ("on_connect", "on_close"):
            steps = inner.get(key)
            if steps is not None:
                yield from _prompts_in(steps)


def _prompts_in(part: Node) -> Iterator[Node]:
    if isinstance(part.data, dict):
        for key, inner in part.entries().items():
            if key == "prompt":
                yield inner
            else:
                yield from _prompts_in(inner)
    elif isinstance(part.data, list):
        for inner in part.items():
            yield from _prompts_in(inner)


def _replies(part: Node, driver: Driver) -> Iterator[tuple[Node, Reply]]:
    for name, inner in part.named("commands").items():
        reply = driver.commands[name].reply
        if reply is not None and "reply" in inner.data:
            yield inner.must("reply"), reply
    for inner, poll in zip(part.listed("polls"), driver.polls, strict=True):
        if poll.reply is not None and "reply" in inner.data:
            yield inner.must("reply"), poll.reply


def _stages(part: Node, reply: Reply) -> Iterator[tuple[Node, ReadSpec]]:
    reads = [reply.read, *(one.read for one in reply.stages)]
    yield from zip(part.listed("stages") or [part], reads, strict=True)


# -- frames that match two declarations


class _Text:
    """A declaration of text frames, with sample frames and methods that match frames."""

    def __init__(self, pattern: Pattern | None, text: str = "") -> None:
        self._pattern = pattern
        self._text = text
        self.head = text if pattern is None else _head(pattern.source)
        """Fixed characters at the start of every frame, or ""."""

    def takes(self, text: str) -> bool:
        return text == self._text if self._pattern is None else bool(_finds(self._pattern, text))

    @cached_property
    def samples(self) -> tuple[str, ...]:
        """Sample frames that match the declaration."""
        if self._pattern is None:
            return (self._text,)
        groups = self._pattern.groups
        made = [example(self._pattern, {}, variant) for variant in range(_VARIANTS)]
        made += [example(self._pattern, dict.fromkeys(groups, one)) for one in _FILLINGS]
        return tuple(dict.fromkeys(one for one in made if _finds(self._pattern, one)))

    def takes_all_of(self, other: "_Text") -> bool:
        """Return whether every sample of `other` also matches this declaration."""
        if not (self.head.startswith(other.head) or other.head.startswith(self.head)):
            return False
        return bool(other.samples) and all(map(self.takes, other.samples))


def _finds(pattern: Pattern, text: str) -> bool:
    return pattern.search(text) is not None


def _head(source: str) -> str:
    """Return the fixed characters at the start of a pattern; "" if they are not obvious."""
    found = _LETTERS.match(source)
    if found is None or "|" in source:
        return ""
    return found[1][:-1] if source[found.end() : found.end() + 1] in ("*", "?", "{") else found[1]


def _check_messages(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about a message if an earlier message already matches all its frames."""
    seen: list[tuple[str, str, ReadSpec, _Text | None]] = []
    for name, inner in part.named("messages").items():
        message = driver.messages[name]
        text = _text_of(message.read)
        for other, transport, read, earlier in seen:
            if transport != message.transport or read.topic != message.read.topic:
                continue
            shown = _shared(read, earlier, message.read, text)
            if shown is not None:
                problems.warn(
                    inner,
                    "ambiguous-frame",
                    f"{other!r}, above, matches the same frames{shown}, so no frame reaches this"
                    " declaration",
                    key=True,
                    hint="put the more specific declaration first, or distinguish the two with"
                    " 'when'",
                )
                break
        seen.append((name, message.transport, message.read, text))


def _shared(
    first: ReadSpec, earlier: _Text | None, second: ReadSpec, later: _Text | None
) -> str | None:
    """Return text with an example if `first` matches every frame of `second`; otherwise, None."""
    if first.topic != second.topic:
        return None
    if first.when is not None or first.lines is not None or second.lines is not None:
        return None
    if earlier is not None and later is not None:
        if earlier.takes_all_of(later):
            return f", such as {later.samples[0][:_SHOWN]!r}"
        return None
    if first.form == second.form == "struct":
        return "" if _covers(_items(first), _items(second)) else None
    return None


def _text_of(read: ReadSpec) -> _Text | None:
    if read.form == "equals":
        return _Text(None, cast("str", read.options["text"]))
    pattern = read.options.get("pattern")
    if read.form != "regex" or not isinstance(pattern, Pattern):
        return None
    return _Text(pattern)


def _items(read: ReadSpec) -> tuple[Item, ...]:
    return cast("tuple[Item, ...]", read.options.get("items", ()))


def _covers(first: tuple[Item, ...], second: tuple[Item, ...]) -> bool:
    """Return whether every frame of `second` certainly matches `first`."""
    size = fixed_size(first)
    if size is None or size != fixed_size(second):
        return False
    asked = _asked(first)
    return asked is not None and asked.items() <= (_asked(second) or {}).items()


def _asked(items: tuple[Item, ...]) -> dict[tuple[int, int], object] | None:
    """Return the constants by offset and size; None if a match depends on other conditions."""
    found: dict[tuple[int, int], object] = {}
    offset = 0
    for item in items:
        size = fixed_size((item,)) or 0
        if item.valid is not None or any(one.const is not None for one in item.items):
            return None
        if item.kind == "struct" or item.kind == "text":
            return None
        if item.const is not None:
            found[offset, size] = (item.const, item.number if item.kind == "number" else None)
        offset += size
    return found


def _check_refusals(part: Node, reply: Reply, problems: Problems) -> None:
    """Warn if an error pattern, which takes precedence, matches a successful reply."""
    good = _text_of(reply.read) if reply.read.when is None and reply.read.lines is None else None
    errors = [(inner, "an error", "errors") for inner in part.listed("errors")]
    asides = [("resend", "a resend request"), ("extend", "a busy reply")]
    errors += [(part.must(key), what, f"{key!r}") for key, what in asides if key in part.data]
    patterns = (*reply.errors, *_patterns_of(reply.asides))
    for inner, what, whose in errors:
        pattern = next((one for one in patterns if one.source == inner.data), None)
        if pattern is None:
            continue
        if _finds(pattern, ""):
            problems.warn(
                inner,
                "matches-empty",
                f"the pattern matches empty text, so every reply counts as {what}"
                if _finds(pattern, "~ no such answer ~")
                else "the pattern matches an empty reply",
                hint=f"match the start of {what}: '^ERR'"
                if what == "an error"
                else "match the start of the frame",
            )
        elif good is not None and _Text(pattern).takes_all_of(good):
            problems.warn(
                inner,
                "ambiguous-frame",
                f"a successful reply also matches, such as {good.samples[0][:_SHOWN]!r}, and"
                f" would count as {what}",
                hint=f"make the pattern match {whose} only, because this pattern is tried first",
            )
    _check_struct_refusals(part, reply, problems)


def _check_shared_refusals(part: Node, driver: Driver, problems: Problems) -> None:
    """Warn about a transport's error pattern that matches a successful reply."""
    for name, inner in part.named("transports").items():
        spec = driver.transports[name]
        requests = [(one.transport, one.reply) for one in driver.commands.values()]
        requests += [(one.transport, one.reply) for one in driver.polls]
        for transport, reply in requests:
            if transport != name or reply is None or reply.read.lines is not None:
                continue
            alone = Reply(reply.read, spec.errors, faults=spec.faults)
            told = len(problems.problems)
            _check_refusals(inner, alone, problems)
            if len(problems.problems) > told:
                break  # one warning is enough


def _patterns_of(asides: ProvisionalReplies) -> Iterator[Pattern]:
    for read in (asides.resend, asides.extend):
        pattern = read.options.get("pattern") if read is not None else None
        if isinstance(pattern, Pattern):
            yield pattern


def _check_struct_refusals(part: Node, reply: Reply, problems: Problems) -> None:
    """Warn about a binary error reply that differs from a successful reply only in its fields."""
    given = [inner for inner in part.listed("errors") if isinstance(inner.data, dict)]
    if len(given) != len(reply.faults) or reply.read.form != "struct":
        return
    for inner, fault in zip(given, reply.faults, strict=True):
        is_plain = fault.read.form == "struct" and fault.read.when is None
        if is_plain and _covers(_items(fault.read), _items(reply.read)):
            problems.warn(
                inner,
                "ambiguous-frame",
                "a successful reply also matches, and would count as an error",
                hint="give 'when' a condition that is true only for errors, because errors are"
                " tried first",
            )


# -- numbers from empty text


def _check_empty(
    part: Node, read: ReadSpec, signals: Mapping[str, Signal], problems: Problems
) -> None:
    """Warn about a numeric field if its group may match empty text."""
    pattern = read.options.get("pattern")
    if read.form != "regex" or not isinstance(pattern, Pattern):
        return
    if not _MAY_BE_LESS.search(_GROUP.sub("(", pattern.source)):
        return
    for name in pattern.groups:
        signal = signals.get(name)
        if signal is None or name in read.conversions or not _is_plain_number(signal):
            continue
        if can_be_empty(pattern, name):
            found = read_form(part)
            place, where = found[1].place_of(found[0], name) if found else (part, {})
            problems.warn(
                place,
                "matches-empty",
                f"{name!r} may be empty here, but empty text is not a number",
                hint="write + instead of *, or not_available: [''] if empty means 'not available'",
                **where,
            )


def _is_plain_number(signal: Signal) -> bool:
    conversion = signal.conversion
    return (
        signal.type in ("integer", "number")
        and not signal.states
        and not conversion.states
        and "" not in conversion.not_available
    )


# -- types and enums


def _check_words(part: Node, problems: Problems) -> None:
    """Warn about unused types and enums."""
    if "types" not in part.data and "enums" not in part.data:
        return
    everywhere = _words(part.data)
    for key, noun, code in (("types", "type", "unused-type"), ("enums", "enum", "unused-enum")):
        for name, inner in part.named(key).items():
            if everywhere[name] == _words(inner.data)[name]:
                problems.warn(
                    inner,
                    code,
                    f"nothing uses the {noun} {name!r}",
                    key=True,
                    hint="use the name in a struct, or remove the declaration",
                )


def _words(data: Any) -> Counter[str]:
    """Return how often each word occurs in the texts of a part."""
    return Counter(word for text in _texts(data) for word in _WORD.findall(text))


def _texts(data: Any) -> Iterator[str]:
    """Yield every text in nested data."""
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict):
        for value in data.values():
            yield from _texts(value)
    elif isinstance(data, list):
        for value in data:
            yield from _texts(value)
