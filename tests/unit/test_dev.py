"""`./dev`: when it sets up, when it does nothing, and what it says when it can't."""

import ast
import json
import shutil
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from subprocess import CompletedProcess
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
LOCKS = tuple(f"requirements/{name}.txt" for name in ("demo", "build", "dev", "node"))
INPUTS = (
    "dev", "pyproject.toml", "hatch_build.py", "package.json", "package-lock.json", *LOCKS
)  # fmt: skip
URC = "install --no-deps --no-build-isolation --editable ."


@pytest.fixture
def dev(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, standing in a checkout of its own, with pip and venv written down, not run."""
    (tmp_path / "requirements").mkdir()
    for name in INPUTS:
        shutil.copy(ROOT / name, tmp_path / name)
    loader = SourceFileLoader("dev_script", str(tmp_path / "dev"))
    spec = spec_from_loader("dev_script", loader)
    assert spec
    module = module_from_spec(spec)
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    loader.exec_module(module)
    done: list[str] = []
    module.done = done  # type: ignore[attr-defined]

    def make_venv() -> None:
        done.append("venv")
        module.venv_python().parent.mkdir(parents=True, exist_ok=True)
        module.venv_python().touch()

    monkeypatch.setattr(module, "make_venv", make_venv)
    monkeypatch.setattr(module.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(module.platform, "python_implementation", lambda: "CPython")
    monkeypatch.setattr(module.shutil, "which", lambda name: f"bin/{name}")
    monkeypatch.delenv("URC_DEV_UNLOCKED", raising=False)
    monkeypatch.setattr(module, "pip", lambda *arguments: done.append(" ".join(arguments)))
    return module


def test_the_first_run_makes_everything(dev: ModuleType) -> None:
    """A fresh clone gets an environment and an editable URC."""
    dev.set_up([])
    assert dev.done == ["venv", locked("demo", "build"), URC]


def locked(*names: str) -> str:
    """Return the command that installs lock files."""
    files = " ".join(f"--requirement=requirements/{name}.txt" for name in names)
    return f"install --require-hashes {files}"


def test_the_build_without_npm_takes_node_from_its_lock(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dev.shutil, "which", lambda name: None)
    dev.set_up(["dev", "node"])
    assert dev.done == ["venv", locked("dev", "node"), URC]


def test_tools_without_a_lock_are_added_by_their_group(dev: ModuleType) -> None:
    """Mutation tests are for developers of URC alone; an old pip knows no groups."""
    dev.set_up(["dev", "mutate"])
    assert dev.done == [
        "venv", locked("dev"), "install --upgrade pip", "install --group=mutate", URC
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("machine", "armv7l"), "no packages are locked for armv7l"),
        (("python_implementation", "PyPy"), "no packages are locked for PyPy 3."),
        (None, "URC_DEV_UNLOCKED is set"),
    ],
)
def test_where_no_lock_fits_one_line_says_so(
    dev: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    change: tuple[str, str] | None,
    said: str,
) -> None:
    """URC is set up all the same, with the newest packages."""
    if change is None:
        monkeypatch.setenv("URC_DEV_UNLOCKED", "1")
    else:
        monkeypatch.setattr(dev.platform, change[0], lambda: change[1])
    dev.set_up(["dev"])
    assert dev.done == ["venv", "install --upgrade pip", "install --editable .[demo] --group=dev"]
    (line,) = [one for one in capsys.readouterr().err.splitlines() if "locked" in one.lower()]
    assert said in line
    assert "without checking the hashes in requirements/" in line


def test_a_python_newer_than_the_locks_takes_the_newest_packages(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dev.sys, "version_info", (3, 15, 0))
    assert dev.reason_without_lock() == "no packages are locked for CPython 3.15"


def test_a_changed_file_is_never_installed_without_asking(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The line names the way to go on, but nothing goes on by itself."""
    spec = spec_from_loader("again", SourceFileLoader("again", str(dev.ROOT / "dev")))
    assert spec
    assert spec.loader
    again = module_from_spec(spec)
    spec.loader.exec_module(again)
    monkeypatch.setattr(
        again.subprocess, "run", lambda *_, **__: CompletedProcess(args=(), returncode=1)
    )
    with pytest.raises(
        again.SetupError, match=r"could not install the locked packages .*; URC_DEV_UNLOCKED=1"
    ):
        again.install([])


def test_the_second_run_does_nothing(dev: ModuleType) -> None:
    """Nothing changed, so nothing is made, and nothing fetched."""
    dev.set_up(["dev"])
    dev.done.clear()
    dev.set_up(["dev"])
    dev.set_up([])
    assert dev.done == []


def test_tools_are_added_to_an_environment_without(dev: ModuleType) -> None:
    """`./dev test` after `./dev demo` keeps the environment and adds the tools."""
    dev.set_up([])
    dev.done.clear()
    dev.set_up(["dev"])
    assert dev.done == [locked("dev"), URC]


@pytest.mark.parametrize("name", [*INPUTS[1:3], "package-lock.json", *LOCKS])
def test_a_changed_input_installs_again(dev: ModuleType, name: str) -> None:
    """A pulled change of the dependencies reaches the environment, tools included."""
    dev.set_up(["dev"])
    dev.done.clear()
    (dev.ROOT / name).write_text((dev.ROOT / name).read_text("utf-8") + "\n", encoding="utf-8")
    dev.set_up([])
    assert dev.done == [locked("dev"), URC]


@pytest.mark.parametrize("stamp", [None, "half a st", json.dumps({"python": "3.9, elsewhere"})])
def test_an_unfinished_or_foreign_environment_is_made_anew(
    dev: ModuleType, stamp: str | None
) -> None:
    """An interrupted set-up, another Python and a moved checkout all start over."""
    dev.set_up([])
    dev.done.clear()
    if stamp is None:
        dev.STAMP.unlink()
    else:
        dev.STAMP.write_text(stamp, encoding="utf-8")
    dev.set_up([])
    assert dev.done == ["venv", locked("demo", "build"), URC]


def test_node_is_asked_for_only_where_npm_is_missing(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The demo needs no group; the tests need Node from somewhere."""
    monkeypatch.setattr(dev.shutil, "which", lambda name: None)
    assert (dev.groups_for("demo"), dev.groups_for("test")) == ([], ["dev", "node"])
    monkeypatch.setattr(dev.shutil, "which", lambda name: f"bin/{name}")
    assert dev.groups_for("test") == ["dev"]
    assert dev.groups_for("mutate") == ["dev", "mutate"]


def test_a_python_that_is_too_old_is_told_in_one_line(
    dev: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No traceback, no half-made environment."""
    monkeypatch.setattr(dev.sys, "version_info", (3, 9, 2))
    monkeypatch.setattr(dev.sys, "argv", ["dev", "demo"])
    monkeypatch.setattr(dev.shutil, "which", lambda name: None)
    assert dev.main() == 1
    said = capsys.readouterr().err
    assert said.startswith("dev: URC needs Python 3.11 or newer; this is 3.9 (")
    assert said.count("\n") == 1
    assert dev.done == []


@pytest.mark.parametrize(
    ("arguments", "code"), [([], 2), (["dance"], 2), (["--help"], 0), (["help"], 0)]
)
def test_wrong_use_shows_the_verbs(
    dev: ModuleType,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    code: int,
) -> None:
    """Without a known verb nothing is set up."""
    monkeypatch.setattr(dev.sys, "argv", ["dev", *arguments])
    assert dev.main() == code
    shown = capsys.readouterr()
    assert all(f"\n  {verb} " in shown.out + shown.err for verb in dev.VERBS)
    assert dev.done == []


def test_old_pythons_can_read_the_script() -> None:
    """A Python that is too old must get as far as saying so."""
    ast.parse((ROOT / "dev").read_text("utf-8"), feature_version=(3, 7))
