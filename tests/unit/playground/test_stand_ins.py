"""The stand-ins behave as the compiled modules that they replace."""

import importlib.util
import itertools
from pathlib import Path
from types import ModuleType
from typing import Any

import anycrc
import pytest
import re2
import rpds

from playground.stand_ins import STAND_INS

HOME = Path(importlib.util.find_spec("playground.stand_ins").origin or "").parent  # type: ignore[union-attr]
DATA = (b"", b"\0", b"123456789", bytes(range(256)), b"\xff" * 33)


def stand_in(name: str) -> ModuleType:
    """Load a stand-in from its file, without replacing the module."""
    spec = importlib.util.spec_from_file_location(
        f"stand_in_{name.replace('.', '_')}", HOME / STAND_INS[name]
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CRC = stand_in("anycrc.crc")
RE2 = stand_in("re2")
RPDS = stand_in("rpds")


@pytest.mark.parametrize("name", sorted(anycrc.models))
def test_every_crc_gives_its_published_check_value(name: str) -> None:
    """The check value of the catalogue is the CRC of ``123456789``."""
    model = anycrc.models[name]
    assert CRC.CRC(*model[:6]).calc(b"123456789") == model.check


@pytest.mark.parametrize("name", sorted(anycrc.models))
def test_every_crc_gives_what_anycrc_gives(name: str) -> None:
    """Over empty data, all bytes, and repeated bytes."""
    model = anycrc.models[name][:6]
    assert [CRC.CRC(*model).calc(one) for one in DATA] == [
        anycrc.CRC(*model).calc(one) for one in DATA
    ]


def test_a_crc_by_name_follows_aliases() -> None:
    """As `anycrc.Model`."""
    alias = next(iter(anycrc.aliases))
    assert CRC.Model(alias).calc(b"x") == anycrc.Model(alias).calc(b"x")


PATTERNS = (
    "a|b$", r"x\d+$", r"\w+", "(?P<n>[0-9]+)$", "(?i)ok", "a.c", r"\bend\b", "(a|ab)(c|bcd)$",
    "^a$", "(?m)^a$", "[^\n]*$", "(?:a$|b)", r"\s*$", "(?s)a.b", "é+",
)  # fmt: skip
TEXTS = ("a\n", "b", "x12\n", "x12", "٣", "OK ok", "a\nc", "end.", "abcd", "a\nb\na", "", "éé")


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_finds_what_re2_finds(pattern: str) -> None:
    """Also at the end of a line, where `re` alone finds more."""

    def found(module: Any, text: str) -> Any:
        match = module.compile(pattern, module.Options()).search(text)
        return None if match is None else (match.group(0), match.groupdict())

    assert [found(RE2, text) for text in TEXTS] == [found(re2, text) for text in TEXTS]


def test_bytes_are_searched_as_latin_1() -> None:
    """Framings search in bytes."""
    assert RE2.compile(b"\xe9[^\n]*$", RE2.Options()).search(b"a\xe9b").span() == (1, 3)


@pytest.mark.parametrize("pattern", [r"a\Z", "(?a)b", "(?x) b", "(?#note)", "(", "a{2,1}"])
def test_what_re2_refuses_is_refused(pattern: str) -> None:
    """With an error of the module, whose reason is bytes."""
    with pytest.raises(re2.error):
        re2.compile(pattern, quiet())
    with pytest.raises(RE2.error) as caught:
        RE2.compile(pattern, RE2.Options())
    assert isinstance(caught.value.args[0], bytes)


def quiet() -> Any:
    """Return options with which RE2 prints nothing."""
    options = re2.Options()
    options.log_errors = False
    return options


def test_maps_are_persistent_as_those_of_rpds() -> None:
    """Every change returns another map."""
    for module in (RPDS, rpds):
        one = module.HashTrieMap({"a": 1})
        two = one.insert("b", 2).update({"c": 3}, {"a": 4})
        assert dict(one) == {"a": 1}
        assert dict(two) == {"a": 4, "b": 2, "c": 3}
        assert dict(two.remove("a")) == dict(two.discard("a")) == {"b": 2, "c": 3}
        assert two.discard("x") == two
        assert module.HashTrieMap.convert(two) is two
        assert (len(two), "b" in two, two.get("x")) == (3, True, None)
        with pytest.raises(KeyError):
            two.remove("x")


def test_sets_and_lists_are_persistent_as_those_of_rpds() -> None:
    """In content, order and equality."""
    for module in (RPDS, rpds):
        one = module.HashTrieSet(["a"])
        assert set(one.insert("b").update(["c"])) == {"a", "b", "c"}
        assert set(one.discard("x")) == set(one) == {"a"}
        assert len(one.remove("a")) == 0
        first = module.List(["b", "c"])
        assert list(first.push_front("a")) == ["a", "b", "c"]
        assert first == module.List("b", "c")
        assert list(first) == ["b", "c"]


def test_stand_ins_and_hidden_modules_are_different() -> None:
    """A module is replaced or hidden."""
    from playground.stand_ins import HIDDEN

    assert not set(STAND_INS) & HIDDEN
    assert all((HOME / name).is_file() for name in STAND_INS.values())
    assert len(set(itertools.chain(STAND_INS, HIDDEN))) == len(STAND_INS) + len(HIDDEN)
