"""Archives: the same bytes everywhere, and one clear line for each that is hostile or broken."""

import io
import random
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tests.unit.packages.made import files_of, write_package
from urc.packages.archive import PACKAGE, read_archive, write_archive
from urc.packages.names import PackageError
from urc.packages.package import open_package, pack_folder, sha256

FILES = files_of("widget", "dial")
GOOD = write_archive(FILES, PACKAGE, "dial")


def zipped(*entries: tuple[str | zipfile.ZipInfo, bytes], compression: int = 0) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return buffer.getvalue()


def special(path: str, mode: int) -> zipfile.ZipInfo:
    info = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))
    info.create_system = 3
    info.external_attr = mode << 16
    return info


def crowded(entries: int) -> bytes:
    """Return an archive whose directory has many entries that share no content at all."""
    one = struct.pack("<4s4B4HL2L5H2L", b"PK\1\2", 20, 3, 20, 0, 0, 0, 0, 33, 0, 0, 0, 1,
                      0, 0, 0, 0, 0, 0) + b"a"  # fmt: skip
    listing = one * entries
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, min(entries, 65535), min(entries, 65535),
                      len(listing), 0, 0)  # fmt: skip
    return b"PK\3\4" + listing + end


def bomb() -> bytes:
    """Return an archive of 10 MB that says, truly, that a file in it has 10 GB of zeros."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    piece = packer.compress(bytes(1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = piece * (10 << 10) + b"\3\0"
    size = 10 << 30
    extra = struct.pack("<HHQQ", 1, 16, size, len(packed))
    name = b"a.txt"
    head = (20, 0, 8, 0, 33, 0, 0xFFFFFFFF, 0xFFFFFFFF, len(name), len(extra))
    local = struct.pack("<4s5H3L2H", b"PK\3\4", *head) + name + extra
    central = struct.pack("<4s4B4HL2L5H2L", b"PK\1\2", 45, 3, 45, 0, *head[1:], 0, 0, 0, 0, 0)
    central += name + extra
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 1, 1, len(central), len(local) + len(packed), 0)
    return local + packed + central + end


HOSTILE: dict[str, tuple[Callable[[], bytes], str]] = {
    "absolute": (lambda: zipped(("/etc/passwd.txt", b"x")), "is an absolute path"),
    "drive": (lambda: zipped(("C:/a.txt", b"x")), "is an absolute path"),
    "back-slash": (lambda: zipped(("\\\\host\\a.txt", b"x")), "is an absolute path"),
    "up": (lambda: zipped(("../a.txt", b"x")), "points outside the package"),
    "up inside": (lambda: zipped(("a/../../b.txt", b"x")), "points outside the package"),
    "up by back-slash": (lambda: zipped(("a\\..\\b.txt", b"x")), "points outside the package"),
    "link": (lambda: zipped((special("a.txt", 0o120777), b"/etc")), "'a.txt' is a link; only"),
    "device": (lambda: zipped((special("a.txt", 0o020666), b"")), "'a.txt' is a device; only"),
    "pipe": (lambda: zipped((special("a.txt", 0o010666), b"")), "'a.txt' is a pipe; only"),
    "case": (
        lambda: zipped(("a.txt", b""), ("A.txt", b"")),
        "'A.txt' and 'a.txt' differ only in case",
    ),
    "case of folder": (
        lambda: zipped(("a/x.txt", b""), ("A/y.txt", b"")),
        "'A' and 'a' differ only in case",
    ),
    "file and folder": (
        lambda: zipped(("a.txt/b.txt", b""), ("a.txt", b"")),
        "'a.txt' is both a file and a folder",
    ),
    "folder": (lambda: zipped(("a/", b"")), "the name '' is not allowed"),
    "dot": (lambda: zipped(("./a.txt", b"")), "the name '.' is not allowed"),
    "hidden": (lambda: zipped((".bashrc", b"")), "the name '.bashrc' is not allowed"),
    "reserved": (lambda: zipped(("con.txt", b"")), "the name 'con.txt' is not allowed"),
    "control": (lambda: zipped(("a\n.txt", b"")), "is not allowed"),
    "letters": (lambda: zipped(("ä.txt", b"")), "is not allowed"),
    "deep": (lambda: zipped(("a/" * 9 + "b.txt", b"")), "too long or too deep"),
    "program": (lambda: zipped(("a.py", b"")), "files of this type are not allowed in a package"),
    "library": (lambda: zipped(("a.so", b"")), "files of this type are not allowed in a package"),
    "path file": (lambda: zipped(("a.pth", b"")), "files of this type are not allowed"),
    "bomb": (
        lambda: zipped(("a.txt", bytes(50 << 20)), compression=zipfile.ZIP_DEFLATED),
        "'a.txt' is compressed",
    ),
    "10 GB of zeros": (bomb, "'a.txt' is compressed"),
    "large entry": (
        lambda: zipped(("a.txt", bytes((5 << 20) + 1))),
        "expected at most 5242880 bytes",
    ),
    "large all": (
        lambda: zipped(*((f"{one}.txt", bytes(5 << 20)) for one in range(5))),
        "the archive is larger than 20 MiB",
    ),
    "many": (
        lambda: zipped(*((f"{one}.txt", b"") for one in range(201))),
        "at most 200 entries, found 201",
    ),
    "a million": (lambda: crowded(1_000_000), "the archive is larger than"),
    "a crowd": (lambda: crowded(60_000), "expected at most 200 entries, found 60000"),
    "told few": (
        lambda: crowded(5000)[:-14] + struct.pack("<2H2LH", 1, 1, 47 * 5000, 4, 0),
        "its sizes are inconsistent",
    ),
    "no archive": (lambda: b"#!/bin/sh\n", "this is not a package: expected a ZIP archive"),
    "empty": (lambda: b"", "this is not a package: expected a ZIP archive"),
    "end added": (lambda: GOOD + b"more", "truncated, or has extra data at its end"),
    "twice": (lambda: _twice(), "is present twice"),
    "dated": (
        lambda: zipped(("a.txt", b"x")),
        "this archive differs from the form that URC writes",
    ),
}


def _twice() -> bytes:
    return zipped(("aa.txt", b"1"), ("ab.txt", b"2")).replace(b"ab.txt", b"aa.txt")


@cache
def hostile(name: str) -> tuple[bytes, str]:
    """Return the archive and how it is refused; packing some takes longer than refusing them."""
    make, told = HOSTILE[name]
    return make(), told


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_archive_is_refused_in_one_line(name: str) -> None:
    """Whatever it tries, nothing is written anywhere: it is read in memory, within bounds."""
    data, told = hostile(name)
    tracemalloc.start()
    try:
        with pytest.raises(PackageError) as refused:
            read_archive(data, PACKAGE, "evil.zip")
        assert tracemalloc.get_traced_memory()[1] < 32 << 20
    finally:
        tracemalloc.stop()
    assert told in str(refused.value)
    assert str(refused.value).startswith("evil.zip: ")
    assert "\n" not in str(refused.value)


def test_an_archive_cut_anywhere_is_refused() -> None:
    """At every byte."""
    for length in range(len(GOOD)):
        with pytest.raises(PackageError):
            read_archive(GOOD[:length], PACKAGE, "cut.zip")


def test_a_changed_bit_is_found_anywhere() -> None:
    """Either the archive is refused, or it is another one and its digest tells."""
    chance = random.Random(7)  # noqa: S311 (bits, not secrets)
    for at in range(len(GOOD)):
        changed = bytearray(GOOD)
        changed[at] ^= 1 << chance.randrange(8)
        try:
            found = read_archive(bytes(changed), PACKAGE, "flip.zip")
        except PackageError:
            continue
        assert found != FILES
        assert sha256(bytes(changed)) != sha256(GOOD)


def test_the_same_files_give_the_same_bytes(tmp_path: Path) -> None:
    """Neither order nor date nor mode nor what is beside them counts."""
    home = write_package(tmp_path, "widget", "dial")
    (home / ".git").mkdir()
    (home / ".DS_Store").write_bytes(b"x")
    (home / "urcpm.json").write_text("{}")
    (home / "widget.js").chmod(0o755)
    packed = pack_folder(home)
    assert packed.data == GOOD == write_archive(dict(reversed(FILES.items())), PACKAGE, "dial")
    assert packed.digest == sha256(GOOD)
    assert open_package(packed.data, "dial").files == dict(sorted(FILES.items()))


def test_the_digest_of_a_known_package_never_changes() -> None:
    """A pinned hash holds on every machine and in every later version."""
    files = {"a.txt": b"one", "b/c.txt": b"two"}
    assert sha256(write_archive(files, PACKAGE, "known")) == KNOWN


KNOWN = "8eb082f7235bfe6010c8ee07e260cbdcfa029e1aac9328d3d1486b077e829860"


def test_a_folder_with_a_link_is_not_packed(tmp_path: Path) -> None:
    """It could bring any file of the author's machine along."""
    home = write_package(tmp_path, "widget", "dial")
    (home / "notes.txt").symlink_to("/etc/hostname")
    with pytest.raises(PackageError, match="only regular files are allowed in a package"):
        pack_folder(home)


@pytest.mark.parametrize(
    ("path", "content", "told"),
    [
        ("package.yaml", None, "this is not a package: it has no package.yaml"),
        ("widget.yaml", None, "its document widget.yaml is missing"),
        ("widget.yaml", "urc: 1\nkind: driver\n", "kind: expected 'widget', as in package.yaml"),
        ("widget.yaml", "kind: widget\nname: x\n", "name: expected 'dial', as in package.yaml"),
        ("widget.yaml", "a: [", "widget.yaml"),
    ],
)
def test_a_package_must_be_what_it_says(path: str, content: str | None, told: str) -> None:
    """Manifest and document agree, or it is none."""
    files = dict(FILES)
    if content is None:
        del files[path]
    else:
        files[path] = content.encode()
    with pytest.raises(PackageError) as refused:
        open_package(write_archive(files, PACKAGE, "p"), "p.zip")
    assert told in str(refused.value)
