"""`./dev`: when it sets up, when it does nothing, and what it says when it can't."""

import ast
import json
import shutil
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def dev(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, standing in a checkout of its own, with pip and venv written down, not run."""
    for name in ("dev", "pyproject.toml", "hatch_build.py", "package.json", "package-lock.json"):
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
    monkeypatch.setattr(module, "pip", lambda *arguments: done.append(" ".join(arguments)))
    return module


def test_the_first_run_makes_everything(dev: ModuleType) -> None:
    """A fresh clone gets an environment and an editable URC."""
    dev.set_up([])
    assert dev.done == ["venv", "install --editable ."]


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
    assert dev.done == ["install --editable . --group=dev"]


@pytest.mark.parametrize("name", ["pyproject.toml", "hatch_build.py", "package-lock.json"])
def test_a_changed_input_installs_again(dev: ModuleType, name: str) -> None:
    """A pulled change of the dependencies reaches the environment, tools included."""
    dev.set_up(["dev"])
    dev.done.clear()
    (dev.ROOT / name).write_text((dev.ROOT / name).read_text("utf-8") + "\n", encoding="utf-8")
    dev.set_up([])
    assert dev.done == ["install --editable . --group=dev"]


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
    assert dev.done == ["venv", "install --editable ."]


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
