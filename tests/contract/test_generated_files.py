"""Files about the engine agree with their sources: names for Rust, and the stub of the binding."""

from __future__ import annotations

import ast
import inspect
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from overtaking import _core
from overtaking.world.constants import CONSTANT_NAMES
from overtaking.world.step_parameters import SIMULATION_FIELDS, VEHICLE_FIELDS

ROOT = Path(__file__).parents[2]
STUB = ast.parse((ROOT / "src" / "overtaking" / "_core.pyi").read_text(encoding="utf-8"))
FUNCTIONS = {node.name: node for node in STUB.body if isinstance(node, ast.FunctionDef)}
CLASSES = {node.name: node for node in STUB.body if isinstance(node, ast.ClassDef)}
CONSTANTS = {
    node.target.id
    for node in STUB.body
    if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name)
}
METHODS = {
    f"{name}.{node.name}": node
    for name, cls in CLASSES.items()
    for node in cls.body
    if isinstance(node, ast.FunctionDef)
}

CONSTRUCTORS = {f"{name}.__new__" for name in CLASSES}
"""PyO3 keeps no documentation of these at run time."""


def public(names: Any) -> set[str]:
    """The names without a leading underscore."""
    return {name for name in names if not name.startswith("_")}


def stub_signature(node: ast.FunctionDef) -> list[tuple[str, str, str | None]]:
    """Name, kind and default (or None) of each parameter of a function in the stub."""
    arguments = node.args
    positional = [*arguments.posonlyargs, *arguments.args]
    defaults = [None] * (len(positional) - len(arguments.defaults)) + list(arguments.defaults)
    groups = [
        ("positional", positional, defaults),
        ("keyword", arguments.kwonlyargs, arguments.kw_defaults),
    ]
    return [
        (argument.arg, kind, None if default is None else ast.unparse(default))
        for kind, parameters, values in groups
        for argument, default in zip(parameters, values, strict=True)
    ]


def engine_signature(function: Any) -> list[tuple[str, str, str | None]]:
    """The same of a compiled function; `...` stands for a default that is not a Python literal."""
    kinds = {
        inspect.Parameter.POSITIONAL_ONLY: "positional",
        inspect.Parameter.POSITIONAL_OR_KEYWORD: "positional",
        inspect.Parameter.KEYWORD_ONLY: "keyword",
    }
    parameters = inspect.signature(function).parameters.values()
    return [
        (
            parameter.name,
            kinds[parameter.kind],
            None
            if parameter.default is inspect.Parameter.empty
            else "..."
            if parameter.default is ...
            else repr(parameter.default),
        )
        for parameter in parameters
    ]


def test_the_names_of_the_engine_are_generated():
    generator = runpy.run_path(str(ROOT / "crates" / "engine_names.py"))
    assert generator["TARGET"].read_text(encoding="utf-8") == generator["content"]()


def test_the_engine_was_built_with_these_names():
    assert _core.FIELD_NAMES["vehicle"] == VEHICLE_FIELDS
    assert _core.FIELD_NAMES["simulation"] == SIMULATION_FIELDS
    assert _core.FIELD_NAMES["constants"] == CONSTANT_NAMES


@pytest.mark.soak  # It compiles the binding once more, for a minute.
def test_the_stub_is_generated():
    """It compiles the binding once more, for the feature of PyO3 that records signatures."""
    subprocess.run([sys.executable, ROOT / "crates" / "engine_stub.py", "--check"], check=True)


def test_the_stub_declares_all_public_names():
    assert public(vars(_core)) == public({*FUNCTIONS, *CLASSES, *CONSTANTS})


@pytest.mark.parametrize("name", CLASSES)
def test_the_stub_declares_all_methods(name: str):
    declared = {method.partition(".")[2] for method in METHODS if method.startswith(f"{name}.")}
    assert public(declared) == public(vars(getattr(_core, name)))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_has_the_signature_of_the_stub(name: str):
    assert engine_signature(getattr(_core, name)) == stub_signature(FUNCTIONS[name])


@pytest.mark.parametrize("name", METHODS)
def test_a_method_has_the_signature_of_the_stub(name: str):
    cls, _, method = name.partition(".")
    declared = stub_signature(METHODS[name])
    if method == "__new__":
        # The signature of a class does not list `cls`.
        assert engine_signature(getattr(_core, cls)) == declared[1:]
    else:
        assert engine_signature(getattr(getattr(_core, cls), method)) == declared


@pytest.mark.parametrize("name", [*FUNCTIONS, *CLASSES, *sorted(METHODS.keys() - CONSTRUCTORS)])
def test_the_stub_and_the_engine_have_one_summary(name: str):
    cls, _, method = name.partition(".")
    node = {**FUNCTIONS, **CLASSES, **METHODS}[name]
    compiled = getattr(getattr(_core, cls), method) if method else getattr(_core, cls)
    declared = ast.get_docstring(node) or ""
    assert (inspect.getdoc(compiled) or "").partition("\n")[0] == declared.partition("\n")[0]
