"""Writes the pages and pictures of the documentation that are made from the project itself.

python docs/generate.py            writes them
python docs/generate.py --check    says which are out of date, and fails if any is
"""

from __future__ import annotations

import sys
from pathlib import Path

from figures import overtake, ten
from generators import commands, driving, glossary, knowledge, notebook, numbers, rules, tables

HERE = Path(__file__).parent


def generated() -> dict[str, str]:
    """Every generated file: its path below this folder, and its content."""
    pages = {
        "reference/tables.md": tables.content(),
        "reference/commands.md": commands.content(),
        "reference/constants.md": knowledge.constants(),
        "reference/drivers.md": knowledge.drivers(),
        "reference/driving.md": driving.content(),
        "reference/figures.md": knowledge.figures(),
        "reference/glossary.md": glossary.content(),
        "reference/rules.md": rules.content(),
        "reference/sources.md": knowledge.bibliography(),
        "reference/vehicles.md": knowledge.vehicles(),
        "tutorials/train-a-driver.ipynb": notebook.content("tutorials/train-a-driver.md"),
    }
    model = HERE / "explanation" / "model.md"
    pages["explanation/model.md"] = numbers.filled(model.read_text(encoding="utf-8"))
    pictures = overtake.pictures() | ten.pictures()
    return pages | {f"figures/{name}": picture for name, picture in pictures.items()}


def stale(files: dict[str, str]) -> list[str]:
    """The files whose content is another, or which are missing."""
    return [
        name
        for name, content in files.items()
        if not (HERE / name).exists() or (HERE / name).read_text(encoding="utf-8") != content
    ]


def main(arguments: list[str]) -> int:
    """Write or check all files."""
    files = generated()
    names = stale(files)
    if arguments == ["--check"]:
        for name in names:
            print(f"docs/{name} is out of date: run make docs", file=sys.stderr)
        return 1 if names else 0
    for name in names:
        (HERE / name).write_text(files[name], encoding="utf-8", newline="\n")
        print(f"docs/{name}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
