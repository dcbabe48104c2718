"""Writes a tutorial as a notebook: its blocks of Python are cells."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path

HERE = Path(__file__).parents[1]
BLOCK = re.compile(
    r"^(<!-- run: by rl/[^\n]+ -->\n)?```(python)\n(.*?)^```$", re.DOTALL | re.MULTILINE
)
"""A block of Python, and the comment above it if it needs the packages of training."""


def content(page: str) -> str:
    """The notebook of a page below docs; cells that need the packages of training have a tag."""
    text = (HERE / page).read_text(encoding="utf-8")
    parts = BLOCK.split(text)
    cells = [_cell(parts[0])]
    for comment, language, code, prose in zip(*(parts[k::4] for k in (1, 2, 3, 4)), strict=True):
        cells += [_cell(code, language, needs_training=bool(comment)), _cell(prose)]
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    notebook = {
        "cells": [cell for cell in cells if cell["source"]],
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def _cell(text: str, language: str = "", *, needs_training: bool = False) -> dict[str, object]:
    """A cell of prose, or of code in a language."""
    source = text.strip("\n")
    cell: dict[str, object] = {
        "cell_type": "code" if language else "markdown",
        "id": hashlib.sha256(source.encode()).hexdigest()[:8],
        "metadata": {"tags": ["training"]} if needs_training else {},
        "source": source.splitlines(keepends=True),
    }
    return cell | ({"execution_count": None, "outputs": []} if language else {})
