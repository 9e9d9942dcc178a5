"""Generated functions that read messages in CDR (ROS 2) and in the ROS 1 format.

Theory of operation. The source is generated once for each combination of layout, byte order and
wanted parts. Consecutive fields of fixed size become one *run*, which a single `struct.Struct`
unpacks or skips. CDR aligns each number to its size, counted from the end of the four-byte header.
The generator therefore tracks each field's offset modulo a power of two. After a string, the offset
is unknown, and the next number is aligned at run time. Non-finite numbers become None, as in JSON
from rosbridge. The data is untrusted. Every length is compared with the remaining bytes before use,
and the number of elements is limited.

Sources: OMG CDR (formal/02-06-51); DDS-XTypes 1.3, section 7.4 (encapsulation identifiers).
Wide strings follow rosidl_typesupport_fastrtps_cpp: a count, then four bytes for each UTF-16 code
unit.
"""

import struct
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from urc.protocol.compile.source import function_of
from urc.protocol.ros.definition import SIZES, Array, BadDefinition, Layout, Primitive, Record, Text
from urc.protocol.ros.wanted import EACH, FEW, PACKED, Wanted
from urc.protocol.values.transform_tree import MAX_TRANSFORMS

__all__ = ["MAX_ELEMENTS", "BadRosMessage", "Read", "build_read", "read_safely"]

MAX_ELEMENTS: Final = 200_000
"""Maximum number of strings and nested messages in the arrays of one message. An element has a few
bytes in a message, but takes a hundred bytes or more of memory."""
MAX_NUMBERS: Final = 4_000_000
"""Maximum length of an array of numbers."""
_HEADER: Final = 4
_FAULTS: Final = (struct.error, IndexError, OverflowError, ValueError, MemoryError)

Read = Callable[[bytes], dict[str, Any]]


class BadRosMessage(ValueError):
    """A message that does not match its definition."""


def build_read(
    layout: Record, wanted: Wanted, *, order: str = "<", is_ros1: bool = False, widest: int = 8
) -> Read:
    """Return a function that reads the wanted parts of a message.

    The function may raise any error for an invalid message; call it through `read_safely`.

    Args:
        layout: layout of the message.
        wanted: parts to read.
        order: byte order in the notation of the module `struct`.
        is_ros1: whether the message is in the ROS 1 format, without header and alignment.
        widest: largest alignment, in bytes (8 in XCDR1, 4 in XCDR2).

    Raises:
        BadDefinition: the layout is nested too deeply for a generated function.
    """
    try:
        return _ReadGenerator(order, is_ros1, widest).function(layout, wanted)
    except (SyntaxError, RecursionError, MemoryError, struct.error) as fault:
        raise BadDefinition(f"the type is too large or nested too deeply ({fault})") from fault


def read_safely(read: Read, data: bytes) -> dict[str, Any]:
    """Read a message; raise `BadRosMessage` if it does not match its definition."""
    try:
        return read(data)
    except BadRosMessage:
        raise
    except _FAULTS as fault:
        raise BadRosMessage(f"the message does not match its definition ({fault})") from fault


def _bad(text: str) -> None:
    raise BadRosMessage(text)


def _finite(value: float) -> float | None:
    return value if value - value == 0 else None


def _all_finite(values: list[Any]) -> list[Any]:
    """Replace non-finite numbers with None."""
    total = sum(values)
    if total - total == 0:
        return values
    return [value if value - value == 0 else None for value in values]


def _numbers(code: str, data: bytes, is_swapped: bool) -> list[Any]:
    values = array(code, data)
    if is_swapped:
        values.byteswap()
    return values.tolist()


def _wide(data: bytes, order: str) -> str:
    """Return the text of a wide string, which has four bytes for each UTF-16 code unit."""
    units = struct.unpack(f"{order}{len(data) // 4}I", data)
    return b"".join(struct.pack("<H", unit & 0xFFFF) for unit in units).decode(
        "utf-16-le", "replace"
    )


_SCOPE: Final[dict[str, Any]] = {
    "len": len, "list": list, "range": range, "bytes": bytes,
    "bad": _bad, "finite": _finite, "all_finite": _all_finite, "numbers": _numbers, "wide": _wide,
    "MAX_ELEMENTS": MAX_ELEMENTS, "MAX_NUMBERS": MAX_NUMBERS, "MAX_TRANSFORMS": MAX_TRANSFORMS,
}  # fmt: skip


class _ReadGenerator:
    """A generator of source text; each instance creates one function."""

    def __init__(self, order: str, is_ros1: bool, widest: int) -> None:
        self._order = order
        self._is_ros1 = is_ros1
        self._widest = 1 if is_ros1 else widest
        self._is_swapped = (order == ">") is not (array("H", [1]).tobytes() == b"\0\1")
        self._lines: list[str] = []
        self._indent = "    "
        self._scope = dict(_SCOPE)
        self._count = 0
        self._parts: list[str] = []
        """Format codes of the current run."""
        self._names: list[str] = []
        """Names of the variables that receive the values of the current run."""
        self._floats: list[str] = []
        self._size = 0
        """Size of the current run in bytes."""
        self._modulus, self._rest = 8, 0
        """The offset at the end of the run, modulo `_modulus`, equals `_rest`."""
        self._has_room = False

    def function(self, layout: Record, wanted: Wanted) -> Read:
        start = 0 if self._is_ros1 else _HEADER
        value = self._read(layout, wanted)
        self._flush()
        lines = [f"    p = {start}", "    end = len(data)"]
        if self._has_room:
            lines.append("    room = MAX_ELEMENTS")
        lines += self._lines
        lines += ["    if p > end:", "        bad('the message ends too early')"]
        lines.append(f"    return {value or '{}'}")
        read: Read = function_of("read_message", "data", lines, self._scope)
        return read

    # -- source text

    def _emit(self, *lines: str) -> None:
        self._lines += [self._indent + line for line in lines]

    @contextmanager
    def _block(self, head: str) -> Iterator[None]:
        self._emit(head)
        indent, self._indent = self._indent, self._indent + "    "
        yield
        self._indent = indent

    def _name(self) -> str:
        self._count += 1
        return f"v{self._count}"

    def _struct(self, form: str, method: str) -> str:
        name = f"s_{method}_{len(self._scope)}"
        self._scope[name] = getattr(struct.Struct(self._order + form), method)
        return name

    # -- runs and alignment

    def _flush(self) -> None:
        """Generate the code that reads or skips the current run, and begin a new run."""
        if self._names:
            form = "".join(self._parts)
            names = ", ".join(self._names) + ("," if len(self._names) == 1 else "")
            self._emit(f"{names} = {self._struct(form, 'unpack_from')}(data, p)")
            if self._floats:
                total = " + ".join(self._floats)
                with self._block(f"if (total := {total}) - total:"):
                    self._emit(*(f"{name} = finite({name})" for name in self._floats))
        if self._size:
            self._emit(f"p += {self._size}")
        self._parts, self._names, self._floats, self._size = [], [], [], 0

    def _skip(self, size: int) -> None:
        """Add `size` bytes to the current run, without reading them."""
        if size:
            if self._parts and self._parts[-1].endswith("x"):
                size_before = int(self._parts[-1][:-1])
                self._parts[-1] = f"{size_before + size}x"
            else:
                self._parts.append(f"{size}x")
            self._size += size
            self._advance(size)

    def _advance(self, size: int) -> None:
        self._rest = (self._rest + size) % self._modulus

    def _align(self, size: int) -> None:
        size = min(size, self._widest)
        if size <= self._modulus:
            self._skip(-self._rest % size)
            return
        self._flush()
        origin = 0 if self._is_ros1 else _HEADER
        self._emit(f"p += ({origin} - p) & {size - 1}")
        self._modulus, self._rest = size, 0

    def _lose_place(self, modulus: int = 1) -> None:
        """Record that the offset is only known to be a multiple of `modulus`."""
        self._modulus, self._rest = modulus, 0

    # -- values; each method returns the expression for the value, or "" for a skipped value

    def _read(self, layout: Layout, wanted: Wanted) -> str:
        match layout:
            case Primitive():
                return self._number(layout.code, wanted)
            case Text():
                return self._text(layout, wanted)
            case Record():
                return self._record(layout, wanted)
            case Array():
                return self._array(layout, wanted)

    def _number(self, code: str, wanted: Wanted) -> str:
        self._align(SIZES[code])
        if not wanted:
            self._skip(SIZES[code])
            return ""
        name = self._name()
        self._parts.append(code)
        self._names.append(name)
        if code in "fd":
            self._floats.append(name)
        self._size += SIZES[code]
        self._advance(SIZES[code])
        return name

    def _record(self, layout: Record, wanted: Wanted) -> str:
        found = []
        for name, inner in layout.fields:
            part = wanted if isinstance(wanted, bool) else wanted.get(name, False)
            value = self._read(inner, part)
            if value:
                found.append(f"{name!r}: {value}")
        return "{" + ", ".join(found) + "}" if found or wanted else ""

    def _counter(self) -> str:
        """Generate the code that reads the count before a string or a sequence."""
        name = self._number("I", True)
        self._flush()
        return name

    def _text(self, layout: Text, wanted: Wanted) -> str:
        count = self._counter()
        self._lose_place()
        if layout.is_wide:
            self._emit(f"{count} *= 4")
            self._lose_place(4)
        if not wanted:
            self._emit(f"p += {count}")
            return ""
        name = self._name()
        with self._block(f"if {count} > end - p:"):
            self._emit("bad('a string is longer than its message')")
        if layout.is_wide:
            self._emit(f"{name} = wide(data[p : p + {count}], {self._order!r})")
        else:
            # In CDR, the count includes a final NUL.
            end = "" if self._is_ros1 else " - 1"
            empty = "" if self._is_ros1 else f" if {count} else ''"
            self._emit(f"{name} = data[p : p + {count}{end}].decode('utf-8', 'replace'){empty}")
        self._emit(f"p += {count}")
        return name

    def _array(self, layout: Array, wanted: Wanted) -> str:
        element = layout.element
        is_packed = isinstance(wanted, dict) and PACKED in wanted
        is_few = isinstance(wanted, dict) and FEW in wanted
        if isinstance(wanted, dict):
            wanted = is_packed or wanted.get(FEW if is_few else EACH, False)
        count = str(layout.length) if layout.length else self._counter()
        if is_few:
            with self._block(f"if {count} > MAX_TRANSFORMS:"):
                self._emit(
                    f"bad(f'a message with {{{count}}} transforms; the limit is {MAX_TRANSFORMS}')"
                )
        if isinstance(element, Primitive):
            code = "B" if is_packed and element.code == "b" else element.code
            return self._number_array(code, layout.length, count, wanted)
        if not layout.length:
            self._has_room = True
        stride = self._stride(element, wanted) if isinstance(element, Record) else None
        if stride is not None:
            return self._records_in_place(element, stride, layout.length, count, wanted)
        return self._loop(element, layout.length, count, wanted)

    def _number_array(self, code: str, length: int, count: str, wanted: Wanted) -> str:
        size = SIZES[code]
        if length:
            self._align(size)
            if not wanted:
                self._skip(length * size)
                return ""
            self._flush()
            return self._slice(code, str(length), wanted, after=length * size)
        name = self._name() if wanted else ""
        with self._block(f"if {count}:"):
            if size > 4 and self._widest > 4:
                self._emit(f"p += ({_HEADER} - p) & 7")
            with self._block(f"if {count} > (end - p) // {size}:"):
                self._emit("bad('an array is longer than its message')")
            if wanted:
                self._take_numbers(name, code, count)
            self._emit(f"p += {count} * {size}" if size > 1 else f"p += {count}")
        if wanted:
            with self._block("else:"):
                self._emit(f"{name} = b''" if code == "B" else f"{name} = []")
        self._lose_place(1 if self._is_ros1 else min(size, 4))
        return name

    def _slice(self, code: str, count: str, wanted: Wanted, after: int) -> str:
        name = self._name()
        with self._block(f"if {after} > end - p:"):
            self._emit("bad('the message ends too early')")
        self._take_numbers(name, code, count)
        self._emit(f"p += {after}")
        self._advance(after)
        return name

    def _take_numbers(self, name: str, code: str, count: str) -> None:
        size = SIZES[code]
        end = f"{count} * {size}" if size > 1 else count
        part = f"data[p : p + {end}]"
        if code == "B":
            self._emit(f"{name} = bytes({part})")
            return
        with self._block(f"if {count} > MAX_NUMBERS:"):
            self._emit("bad('an array has too many numbers')")
        if code == "?":
            self._emit(f"{name} = [one != 0 for one in {part}]")
            return
        taken = f"numbers({code!r}, {part}, {self._is_swapped})"
        self._emit(f"{name} = all_finite({taken})" if code in "fd" else f"{name} = {taken}")

    def _stride(self, element: Record, wanted: Wanted) -> int | None:
        """Return the bytes from one array element to the next; None if the number varies."""
        sizes = list(_sizes(element))
        if not sizes or any(one is None or (wanted and one[1] > 1) for one in sizes):
            return None
        at, widest = 0, 1
        for one in sizes:
            assert one is not None  # noqa: S101 - see above
            align = min(one[0], self._widest)
            widest = max(widest, align)
            at += -at % align + one[0] * one[1]
        first = sizes[0]
        is_aligned = first is not None and min(first[0], self._widest) == widest
        return at if is_aligned and at % widest == 0 else None

    def _records_in_place(
        self, element: Layout, stride: int, length: int, count: str, wanted: Wanted
    ) -> str:
        first = next(_sizes(element))
        align = min(first[0] if first else 1, self._widest)
        name = self._name() if wanted else ""
        if length:
            self._align(align)
            self._flush()
            self._records(element, stride, str(length), wanted, name)
            self._advance(length * stride)
            return name
        self._flush()
        with self._block(f"if {count}:"):
            if align > 4:
                self._emit(f"p += ({_HEADER} - p) & 7")
            self._records(element, stride, count, wanted, name)
        if wanted:
            with self._block("else:"):
                self._emit(f"{name} = []")
        self._lose_place(1 if self._is_ros1 else min(align, 4))
        return name

    def _records(self, element: Layout, stride: int, count: str, wanted: Wanted, name: str) -> None:
        """Generate the code that reads an array of elements of constant size with one iterator."""
        with self._block(f"if {count} > (end - p) // {stride}:"):
            self._emit("bad('an array is longer than its message')")
        if wanted:
            if not count.isdecimal():
                self._emit(f"room -= {count}")
                with self._block("if room < 0:"):
                    self._emit("bad('the arrays have too many elements')")
            inner = _ReadGenerator(self._order, self._is_ros1, self._widest)
            inner._count = self._count + 1000
            value = inner._read(element, wanted)
            if inner._lines or not inner._names:
                raise AssertionError("an element of constant size needs no separate code")
            for one in inner._floats:
                value = _with_check(value, one)
            form = "".join(inner._parts)
            each = ", ".join(inner._names) + ("," if len(inner._names) == 1 else "")
            unpack = self._struct(form, "iter_unpack")
            part = f"data[p : p + {count} * {stride}]"
            self._emit(f"{name} = [{value} for {each} in {unpack}({part})]")
        self._emit(f"p += {count} * {stride}")

    def _loop(self, element: Layout, length: int, count: str, wanted: Wanted) -> str:
        self._flush()
        name, item = self._name() if wanted else "", ""
        if not length:
            least = max(1, _least(element, self._is_ros1))
            with self._block(f"if {count} > (end - p) // {least}:"):
                self._emit("bad('an array is longer than its message')")
            self._emit(f"room -= {count}")
            with self._block("if room < 0:"):
                self._emit("bad('the arrays have too many elements')")
        if wanted:
            self._emit(f"{name} = []")
        self._lose_place()
        with self._block(f"for _ in range({count}):"):
            at = len(self._lines)
            item = self._read(element, wanted)
            self._flush()
            if wanted:
                self._emit(f"{name}.append({item})")
            if len(self._lines) == at:
                self._emit("pass")
            with self._block("if p > end:"):
                self._emit("bad('the message ends too early')")
        self._lose_place()
        return name


def _with_check(value: str, name: str) -> str:
    """Return a record expression in which the number `name` becomes None if it is not finite."""
    checked = f"({name} if {name} - {name} == 0 else None)"
    return value.replace(f": {name},", f": {checked},").replace(f": {name}}}", f": {checked}}}")


def _sizes(layout: Layout) -> Iterator[tuple[int, int] | None]:
    """Yield the size and count of the numbers in a layout; None for a variable-size part."""
    match layout:
        case Primitive():
            yield SIZES[layout.code], 1
        case Record():
            for _, inner in layout.fields:
                yield from _sizes(inner)
        case Array(element=Primitive(code=code), length=length) if length:
            yield SIZES[code], length
        case _:
            yield None


def _least(layout: Layout, is_ros1: bool) -> int:
    """Return the minimum size of a layout in bytes, without padding."""
    match layout:
        case Primitive():
            return SIZES[layout.code]
        case Text():
            return 4
        case Record():
            return sum(_least(inner, is_ros1) for _, inner in layout.fields)
        case Array():
            return 4 if not layout.length else layout.length * _least(layout.element, is_ros1)
