"""Modules that the package names in strings exist, and can be imported.

A type checker does not see such a name: it is imported when it is first used, often in another
process, so a renamed module would fail only there.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import re
from functools import cache
from pathlib import Path

import pytest

from overtaking.core.errors import MissingExtraError

SOURCE = Path(__file__).parents[2] / "src" / "overtaking"
MODULE_NAME = re.compile(r"overtaking(\.[a-z_][a-z0-9_]*)+")

OTHER_NAMES = {
    "overtaking.clipped": "key in the metadata of a Parquet file",
    "overtaking.dataset": "format of a data set",
    "overtaking.facts": "key in the metadata of a Parquet file",
    "overtaking.plain": "handler of encoding errors",
    "overtaking.seal": "key in the metadata of a Parquet file",
}
"""Strings that look like modules, and what they are."""


@cache
def trees() -> dict[Path, ast.Module]:
    """The syntax tree of every source file."""
    return {path: ast.parse(path.read_bytes()) for path in sorted(SOURCE.rglob("*.py"))}


def names_in_strings() -> set[str]:
    """Every string of the package that looks like one of its modules."""
    return {
        node.value
        for tree in trees().values()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and MODULE_NAME.fullmatch(node.value)
    }


def attributes_of_imported_modules() -> set[tuple[str, str]]:
    """Module and attribute of each `import_module("...").attribute`, also by way of a variable."""
    pairs: set[tuple[str, str]] = set()
    for tree in trees().values():
        for function in ast.walk(tree):
            if not isinstance(function, ast.FunctionDef):
                continue
            module_of_variable = {
                target.id: module
                for node in ast.walk(function)
                if isinstance(node, ast.Assign) and (module := imported_module(node.value))
                for target in node.targets
                if isinstance(target, ast.Name)
            }
            for node in ast.walk(function):
                if isinstance(node, ast.Attribute):
                    module = imported_module(node.value)
                    if module is None and isinstance(node.value, ast.Name):
                        module = module_of_variable.get(node.value.id)
                    if module is not None:
                        pairs.add((module, node.attr))
    return pairs


def imported_module(node: ast.expr) -> str | None:
    """The module of ours that a call of `import_module` imports by its literal name."""
    if not (isinstance(node, ast.Call) and node.args):
        return None
    is_import = isinstance(node.func, ast.Name) and node.func.id == "import_module"
    is_import |= isinstance(node.func, ast.Attribute) and node.func.attr == "import_module"
    name = node.args[0]
    if is_import and isinstance(name, ast.Constant) and MODULE_NAME.fullmatch(str(name.value)):
        return str(name.value)
    return None


@pytest.mark.parametrize("name", sorted(names_in_strings() - set(OTHER_NAMES)))
def test_a_module_that_a_string_names_can_be_imported(name: str):
    assert importlib.util.find_spec(name) is not None
    try:
        importlib.import_module(name)
    except MissingExtraError:
        pass  # It states itself what is missing.
    except ModuleNotFoundError as error:
        # An extra that is not installed here may be missing, but no module of this package.
        if (error.name or "overtaking").partition(".")[0] == "overtaking":
            raise


@pytest.mark.parametrize(("module", "attribute"), sorted(attributes_of_imported_modules()))
def test_a_module_imported_by_its_name_has_the_attribute_that_is_used(module: str, attribute: str):
    assert hasattr(importlib.import_module(module), attribute)


def test_every_other_name_still_occurs():
    assert set(OTHER_NAMES) <= names_in_strings()


def test_the_processes_that_are_started_by_name_are_among_them():
    assert {
        "overtaking.analysis.logic.reasoner_process",
        "overtaking.sim.network_process",
    } <= names_in_strings()
