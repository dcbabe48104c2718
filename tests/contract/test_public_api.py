"""The table of public names, the stub beside it and the modules that define the names agree."""

from __future__ import annotations

import ast
import importlib
import importlib.metadata
import inspect
import pkgutil
import pydoc
import re
from pathlib import Path

import pytest

import overtaking

HOMES: dict[str, str] = vars(overtaking)["_HOMES"]
MODULES: tuple[str, ...] = vars(overtaking)["_MODULES"]
NAMES = sorted(HOMES)


def names_in_stub() -> dict[str, str]:
    """What `__init__.pyi` re-exports: `from home import name as name`, as {name: home}."""
    stub = Path(overtaking.__path__[0]) / "__init__.pyi"
    imports = [
        n for n in ast.parse(stub.read_text(encoding="utf-8")).body if isinstance(n, ast.ImportFrom)
    ]
    return {
        alias.name: str(statement.module)
        for statement in imports
        for alias in statement.names
        if alias.asname == alias.name
    }


def test_the_stub_lists_the_same_names_from_the_same_modules():
    assert names_in_stub() == HOMES | dict.fromkeys(MODULES, "overtaking")


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_is_what_its_module_defines(name: str):
    home = importlib.import_module(HOMES[name])
    assert getattr(overtaking, name) is getattr(home, name)
    found = getattr(home, name)
    if inspect.ismodule(found):
        assert found.__name__ == f"{home.__name__}.{name}"
        assert set(found.__all__) <= set(dir(found))
        return
    assert found.__module__ == home.__name__, "named by a module that only imports it"


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_is_explained(name: str):
    assert inspect.getdoc(getattr(overtaking, name))


def test_help_lists_every_public_name():
    text = pydoc.render_doc(overtaking, renderer=pydoc.plaintext)  # pyright: ignore[reportAttributeAccessIssue]
    overview, listed = text.split("PACKAGE CONTENTS")
    for name in NAMES:
        assert re.search(rf"\b{name}\b", overview), "missing in the docstring of the package"
        if not inspect.ismodule(getattr(overtaking, name)):
            assert re.search(rf"^    (class )?{name}\(", listed, re.MULTILINE)


def test_no_public_name_is_hidden_by_a_package():
    """Importing `overtaking.x` sets the attribute `x`, which would then replace a public name."""
    packages = {module.name for module in pkgutil.iter_modules(overtaking.__path__)}
    assert packages & {*HOMES, "__version__"} == set()
    assert set(MODULES) <= packages


def test_dir_lists_every_public_name():
    assert {*NAMES, *MODULES, "__version__"} <= set(dir(overtaking))


def test_an_unknown_name_says_how_to_find_the_known_ones():
    unknown = "nonsense"
    with pytest.raises(AttributeError, match=r"no public name 'nonsense'; dir\(overtaking\)"):
        getattr(overtaking, unknown)


@pytest.mark.parametrize(
    ("unknown", "nearest"), [("load", "load_dataset"), ("simulat", "simulate")]
)
def test_an_unknown_name_suggests_the_nearest(unknown: str, nearest: str):
    with pytest.raises(AttributeError, match=rf"{unknown}'; did you mean {nearest}\?"):
        getattr(overtaking, unknown)


@pytest.mark.parametrize("module", MODULES)
def test_a_public_module_re_exports_what_the_package_defines(module: str):
    names = vars(importlib.import_module(f"overtaking.{module}"))
    public = {name: value for name, value in names.items() if not name.startswith("_")}
    assert public
    assert getattr(overtaking, module).__doc__
    for name, value in public.items():
        home = getattr(value, "__module__", "overtaking.")
        assert home.startswith("overtaking.") or not callable(value), name


def test_the_version_is_the_same_everywhere(repository: Path):
    version = importlib.metadata.version("overtaking")
    citation = (repository / "CITATION.cff").read_text(encoding="utf-8")
    changes = (repository / "CHANGELOG.md").read_text(encoding="utf-8")
    assert overtaking.__version__ == version
    assert re.findall(r"^version: (\S+)$", citation, re.MULTILINE) == [version]
    assert re.findall(r"^## \[(?!Unreleased)([^]]+)\]", changes, re.MULTILINE)[:1] == [version]
