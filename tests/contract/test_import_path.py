"""Nothing in URC adds a folder to the import path: a package's files can't become modules."""

import ast
from collections.abc import Iterator

import pytest

from tests.contract.modules import MODULES, ROOT, tree_of

LOADERS = {
    "SourceFileLoader", "SourcelessFileLoader", "ExtensionFileLoader", "addsitedir",
    "path_hooks", "run_path", "spec_from_file_location", "spec_from_loader",
}  # fmt: skip


def loaders_in(tree: ast.AST) -> Iterator[str]:
    """Yield each name that leads to an import from a folder of choice."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            if node.attr in LOADERS:
                yield node.attr
            if node.attr in ("path", "meta_path") and ast.unparse(node.value) == "sys":
                yield ast.unparse(node)
        elif isinstance(node, ast.Name | ast.alias):
            name = node.id if isinstance(node, ast.Name) else node.name
            if name in LOADERS or name == "runpy":
                yield name


def test_no_module_imports_from_a_folder_of_choice() -> None:
    found = {str(path.relative_to(ROOT)): sorted(loaders_in(tree_of(path))) for path in MODULES}
    assert {path: names for path, names in found.items() if names} == {}


@pytest.mark.parametrize(
    "code",
    [
        "import sys; sys.path.insert(0, 'x')",
        "import runpy",
        "from importlib.util import spec_from_file_location",
        "importlib.machinery.SourceFileLoader('a', 'b')",
        "site.addsitedir('x')",
    ],
)
def test_the_search_finds_each_way(code: str) -> None:
    assert list(loaders_in(ast.parse(code)))
