"""Write the stub of the compiled engine, `src/overtaking/_core.pyi`, from its Rust sources.

    python crates/engine_stub.py            write the stub
    python crates/engine_stub.py --check    fail if the stub is out of date

PyO3 records signatures and documentation in the compiled library, where maturin reads them.
"""

from __future__ import annotations

import ast
import inspect
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
BINARIES = Path(sys.executable).parent
TARGET = ROOT / "src" / "overtaking" / "_core.pyi"
ENGINE_LEVELS = ROOT / ".venv" / ".engine"
"""The SIMD levels that `make` built; building the same ones compiles the binding alone."""

IMPORTS = """\
from collections.abc import Mapping, Sequence
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray
"""

FIELD_NAMES = "FIELD_NAMES: Final[dict[str, tuple[str, ...]]]"
"""A dictionary is made when the module is loaded, so PyO3 cannot record its type."""


class AnnotationReader(ast.NodeTransformer):
    """Removes the quotes of annotations and the indentation of documentation."""

    def visit_arg(self, node: ast.arg) -> ast.arg:
        """The annotation of one parameter."""
        node.annotation = self._unquoted(node.annotation)
        return node

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.FunctionDef:
        """The annotation of the result, and the documentation."""
        self.generic_visit(node)
        node.returns = self._unquoted(node.returns)
        indent_documentation(node, depth=2 if node.args.args or node.args.posonlyargs else 1)
        return node

    @staticmethod
    def _unquoted(annotation: ast.expr | None) -> ast.expr | None:
        if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
            return ast.parse(annotation.value, mode="eval").body
        return annotation


def indent_documentation(node: ast.FunctionDef | ast.ClassDef, depth: int) -> None:
    """Let the documentation of a node begin behind its quotes, not on the next line."""
    first = node.body[0]
    assert isinstance(first, ast.Expr)
    assert isinstance(first.value, ast.Constant)
    lines = inspect.cleandoc(str(first.value.value)).split("\n")
    indent = "    " * depth
    text = "\n".join([lines[0], *(indent + line if line else "" for line in lines[1:])])
    first.value.value = text if len(lines) == 1 else f"{text}\n{indent}"


def generate() -> str:
    """Compile the binding with PyO3's feature, and return the formatted stub."""
    environment = os.environ | {"PATH": f"{BINARIES}{os.pathsep}{os.environ['PATH']}"}
    environment["PYO3_CONFIG_FILE"] = str(ROOT / "crates" / "overtaking-py" / "pyo3-config.txt")
    if ENGINE_LEVELS.exists() and "OVERTAKING_LEVELS" not in environment:
        environment["OVERTAKING_LEVELS"] = ENGINE_LEVELS.read_text(encoding="utf-8").strip()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(
            [
                *(ROOT / "setup" / "with_rust.sh", "maturin", "generate-stubs", "--locked"),
                *("--profile", "release", "--out", folder),
                *("--features", "pyo3/extension-module,pyo3/experimental-inspect"),
            ],
            cwd=ROOT,
            env=environment,
            check=True,
            stdout=subprocess.DEVNULL,
        )
        stub = (Path(folder) / "overtaking" / "_core.pyi").read_text(encoding="utf-8")
    return formatted(stub)


def formatted(stub: str) -> str:
    """The stub with imports, annotations without quotes, and the format of the project."""
    module = ast.parse(stub)
    _, *statements = [AnnotationReader().visit(node) for node in module.body]
    for node in statements:
        if isinstance(node, ast.ClassDef):
            indent_documentation(node, depth=1)
    is_import = (ast.Import, ast.ImportFrom)
    statements = [
        node
        for node in statements
        if not isinstance(node, is_import) and getattr(node, "name", "") != "__getattr__"
    ]
    constants = [node for node in statements if isinstance(node, ast.AnnAssign)]
    definitions = [node for node in statements if not isinstance(node, ast.AnnAssign)]
    text = "\n\n".join(
        [
            f'"""{ast.get_docstring(module)}"""',
            IMPORTS,
            "\n".join([*map(ast.unparse, constants), FIELD_NAMES]),
            *map(ast.unparse, definitions),
        ]
    )
    command = [str(BINARIES / "ruff"), "format", f"--stdin-filename={TARGET}", "-"]
    return subprocess.run(
        command, input=text, cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def main(arguments: list[str]) -> int:
    """Write or check the file."""
    if arguments != ["--check"]:
        TARGET.write_text(generate(), encoding="utf-8", newline="\n")
    elif TARGET.read_text(encoding="utf-8") != generate():
        print(f"{TARGET.name} is out of date: run python crates/engine_stub.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
