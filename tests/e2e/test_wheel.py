"""The wheel: what is in it, and that it runs without the checkout."""

import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import sysconfig
import venv
import zipfile
from importlib import import_module
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import urc
from urc.cli.verbs import VERBS, module_of

ROOT = Path(__file__).resolve().parents[2]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet")
TIMEOUT_S = 100
SERVING = {"demo": "dashboard http://", "serve": "dashboard http://", "simulate": "listening wire"}
"""Subcommands that run until Ctrl-C, with the start of the line that they print when ready."""
NEEDING = {
    "migrate": "there is no such file",
    "send": "there is no such file",
    "trust": "there is no such file",
    "replay": "puppet.mcap cannot be read",
    "export": "rover.mcap cannot be read",
    "restore": "urc-backup.zip: No such file",
    "publish": "token.txt: No such file",
    "watch": "nothing listens on",
    "record": "nothing listens on",
    "discover": "nothing was found",
    "repo": "connection attempts failed",
    "install": "no repository is configured",
    "update": "no repository is configured",
    "search": "no repository is configured",
    "bundle": "no repository is configured",
    "remove": "is not installed",
    "backup": "has nothing to back up",
    "audit": "start 'urc serve' to create the file",
}
"""Subcommands whose example needs a file, a robot or a server, with what they say without it."""
NOWHERE = "127.0.0.1"
"""Replaces the addresses of the examples: a test sends nothing to other computers."""


def run(*command: str | Path, cwd: Path) -> str:
    """Run a program to its end; return what it printed, or fail with all that it said."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=cwd, capture_output=True, text=True, timeout=TIMEOUT_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{command} exited with {done.returncode}:\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the wheel once. npm takes the modules from its cache, so this needs no network."""
    folder = tmp_path_factory.mktemp("wheel")
    build = ("wheel", "--no-deps", "--no-build-isolation", "--no-index", "--wheel-dir")
    run(*PIP, *build, folder, ROOT, cwd=folder)
    (made,) = folder.glob("*.whl")
    return made


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into a new environment that borrows URC's dependencies from this one."""
    home = tmp_path_factory.mktemp("installed")
    venv.create(home, with_pip=False, symlinks=True)
    scripts = sysconfig.get_path("scripts", "venv", vars={"base": str(home)})
    site = Path(sysconfig.get_path("purelib", "venv", vars={"base": str(home)}))
    python = Path(scripts) / Path(sys.executable).name
    run(*PIP, "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=home)
    # A .pth file is not followed into the .pth files there, so the checkout stays out of sight.
    (site / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return Path(scripts)


@pytest.mark.parametrize(
    "name",
    [
        "urc/_shipped/schemas/robot.schema.json",
        "urc/_shipped/robots/puppet.yaml",
        "urc/_shipped/widgets/battery/widget.yaml",
        "urc/web/static/core/tokens.css",
        "urc/py.typed",
        "urc_vendor/importmap.json",
        "urc_vendor/uplot/dist/uPlot.esm.js",
        "urc_vendor/uplot/LICENSE",
    ],
)
def test_the_wheel_carries(wheel: Path, name: str) -> None:
    """Everything that a demo without internet and without Node needs is inside."""
    assert name in zipfile.ZipFile(wheel).namelist()


@pytest.mark.parametrize("folder", ["schemas", "robots", "widgets", "templates"])
def test_the_wheel_carries_every_file_of(wheel: Path, folder: str) -> None:
    """The data folders are shipped whole."""
    here = {str(path.relative_to(ROOT)) for path in (ROOT / folder).rglob("*") if path.is_file()}
    there = {
        name.removeprefix("urc/_shipped/")
        for name in zipfile.ZipFile(wheel).namelist()
        if name.startswith(f"urc/_shipped/{folder}/")
    }
    assert here, f"{folder} is empty"
    assert there == {name.replace("\\", "/") for name in here}


def sbom_of(wheel: Path) -> str:
    """Return the SBOM, from its place by PEP 770."""
    with zipfile.ZipFile(wheel) as opened:
        return opened.read(f"urc-{urc.__version__}.dist-info/sboms/urc.cdx.json").decode()


def test_the_sbom_is_valid_by_its_official_schema(wheel: Path) -> None:
    """The schema of CycloneDX, as the project's own library has it."""
    from cyclonedx.schema import SchemaVersion
    from cyclonedx.validation.json import JsonStrictValidator

    assert JsonStrictValidator(SchemaVersion.V1_6).validate_str(sbom_of(wheel)) is None


def test_the_sbom_lists_each_bundled_file_with_its_hash(wheel: Path) -> None:
    """Each file of urc_vendor, except the two that the build writes itself."""
    components = json.loads(sbom_of(wheel))["components"]
    listed = {
        file["name"]: file["hashes"][0]["content"]
        for one in components
        for file in one.get("components", ())
    }
    with zipfile.ZipFile(wheel) as opened:
        there = {
            name: hashlib.sha256(opened.read(name)).hexdigest()
            for name in opened.namelist()
            if name.startswith("urc_vendor/")
        }
    made = {"urc_vendor/__init__.py", "urc_vendor/importmap.json"}
    assert listed == {name: digest for name, digest in there.items() if name not in made}
    assert made <= there.keys()


def test_the_sbom_names_every_dependency_of_the_wheel(wheel: Path) -> None:
    """With version, licence and hashes."""
    with zipfile.ZipFile(wheel) as opened:
        told = opened.read(f"urc-{urc.__version__}.dist-info/METADATA").decode()
    needed = {
        canonicalize_name(Requirement(one).name)
        for one in re.findall(r"^Requires-Dist: (.+)$", told, re.MULTILINE)
        if "extra ==" not in one
    }
    said = json.loads(sbom_of(wheel))
    components = said["components"]
    assert len(needed) > 20
    assert needed <= {one["name"] for one in components}
    assert {one["name"] for one in components} >= {"leaflet", "three", "uplot", "@xterm/xterm"}
    for one in components:
        assert one["version"]
        assert one["licenses"][0]["expression"]
        assert one["hashes"]
    assert said["metadata"]["component"]["version"] == urc.__version__


def test_the_wheel_carries_nothing_of_the_workshop(wheel: Path) -> None:
    """Tests, benchmarks and tools stay at home."""
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert tops == {"urc", "urc_vendor", f"urc-{urc.__version__}.dist-info"}


def test_the_installed_command_runs_elsewhere(installed: Path, tmp_path: Path) -> None:
    """`urc --version` works in any folder."""
    assert urc.__version__ in run(installed / "urc", "--version", cwd=tmp_path)


def test_the_installed_folders_are_found(installed: Path, tmp_path: Path) -> None:
    """An installed URC reads its own folders and modules, not those of a checkout."""
    question = (
        "from urc.shipped import shipped, vendored\n"
        "print(shipped('schemas'), vendored(), sep='\\n')"
    )
    answer = run(installed / Path(sys.executable).name, "-c", question, cwd=tmp_path)
    home = installed.parent.resolve()
    assert [Path(line).resolve().is_relative_to(home) for line in answer.split()] == [True, True]
    assert all(Path(line).is_dir() for line in answer.split())


def test_the_installed_urc_validates_what_it_ships(installed: Path, tmp_path: Path) -> None:
    """The schemas of the wheel serve `urc validate` outside any checkout."""
    where = "from urc.shipped import shipped; print(shipped('robots') / 'puppet.yaml')"
    robot = run(installed / Path(sys.executable).name, "-c", where, cwd=tmp_path).strip()
    run(installed / "urc", "validate", robot, cwd=tmp_path)


def test_the_installed_urc_explains_its_findings(installed: Path, tmp_path: Path) -> None:
    """The pages of the codes are inside; reading them imports nothing but the standard library."""
    assert run(installed / "urc", "explain", "tab", cwd=tmp_path).startswith("tab\n\nWhat: ")
    question = (
        "import sys; before = set(sys.modules); import urc.config.codes; urc.config.codes.pages()\n"
        "print({name.partition('.')[0] for name in set(sys.modules) - before}"
        " - sys.stdlib_module_names)"
    )
    answer = run(installed / Path(sys.executable).name, "-c", question, cwd=tmp_path)
    assert answer.strip() == "{'urc'}"


@pytest.mark.parametrize("verb", VERBS)
def test_the_example_of_help_runs_in_an_empty_folder(
    installed: Path, tmp_path: Path, verb: str
) -> None:
    """It does its work, or says in one line what it needs; never a traceback."""
    example = import_module(module_of(verb)).EXAMPLE
    example = re.sub(r"192\.168\.[0-9.]+(?::[0-9]+)?|robots\.example", NOWHERE, example)
    example = example.replace("port=6789", "port=0")
    example += {"demo": " --no-browser --port 0", "serve": " --port 0"}.get(verb, "")
    example += " --set port=9" if verb in ("watch", "record", "discover") else ""
    path = os.pathsep.join([str(installed), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "URC_DATA_DIR": str(tmp_path / "data")}
    here = tmp_path / "here"
    here.mkdir()
    with subprocess.Popen(
        ["bash", "-c", f"exec {example}"],
        cwd=here, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as running:  # fmt: skip
        try:
            if verb in SERVING:
                assert running.stdout is not None
                assert running.stdout.readline().startswith(SERVING[verb])
                running.send_signal(signal.SIGINT)
            _, errors = running.communicate(timeout=TIMEOUT_S)
        finally:
            running.kill()
    assert "Traceback" not in errors
    if verb not in NEEDING:
        assert (running.returncode, errors if verb in SERVING else "") == (0, "")
        return
    assert running.returncode in (1, 2)
    assert NEEDING[verb] in errors
