"""Builds the documentation as a site: all pages, and an API reference from the docstrings.

python docs/site.py    writes target/docs/site; fails if a link or an anchor leads nowhere

The pages lie in the build as they lie in the repository, so their links hold in both. Formulas
become MathML, which browsers draw without a script.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from itertools import takewhile
from pathlib import Path
from types import ModuleType

from latex2mathml.converter import convert

import overtaking

ROOT = Path(__file__).resolve().parents[1]
BUILD = ROOT / "target" / "docs"
SECTIONS = {
    "Tutorial": "docs/tutorials",
    "How to": "docs/how-to",
    "Explanation": "docs/explanation",
    "Reference": "docs/reference",
    "Decisions": "docs/adr",
}
PROJECT = [
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "benchmarks/README.md",
    "calibration/README.md",
]
FOLDERS = ["docs/adr", "examples", "benchmarks/oracles"]
API = "docs/reference/api.md"
LIVE = "<!-- Here the site has the page itself. -->"
VIEW = "docs/figures/view.html"
FRAME = (
    '<iframe src="../figures/view.html#sim=7&t=2" title="The page of overtaking view"'
    ' loading="lazy" style="width: 100%; height: 46rem; border: 1px solid #8888"></iframe>'
)
"""In the place of the comment, which GitHub does not show."""

FENCE = re.compile(r"^ *```", re.MULTILINE)


def main() -> int:
    """Write the site."""
    pages = BUILD / "pages"
    shutil.rmtree(BUILD, ignore_errors=True)
    for path in files():
        target = pages / path
        target.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".md":
            target.write_text(page((ROOT / path).read_text("utf-8")), "utf-8")
        else:
            shutil.copy(ROOT / path, target)
    for name in FOLDERS:
        (pages / name / "README.md").write_text(index(ROOT / name), "utf-8")
    (pages / API).write_text(api(), "utf-8")
    view(pages / VIEW)
    settings = BUILD / "mkdocs.yml"
    settings.write_text((ROOT / "docs" / "site.yml").read_text("utf-8") + nav(pages), "utf-8")
    program = Path(sys.executable).with_name("zensical")
    return subprocess.call([program, "build", "--strict", "--clean", "-f", settings])


def view(path: Path) -> None:
    """The page of `overtaking view`, with the first simulations of a profile."""
    runs = overtaking.simulate(overtaking.sample("pinto2023-physical", num_simulations=12, seed=1))
    overtaking.write_viewer_page(runs, path, simulation_ids="all")


def files() -> list[Path]:
    """What the site consists of, and what its pages link to, relative to the repository."""
    kinds = (
        "docs/**/*.md",
        "docs/figures/*",
        *(f"{name}/*" for name in FOLDERS),
        *PROJECT,
        "README.md",
        "LICENSE",
    )
    found = {
        path for kind in (*kinds, "benchmarks/*.py", "CITATION.cff") for path in ROOT.glob(kind)
    }
    return sorted(path.relative_to(ROOT) for path in found if path.is_file())


def page(text: str) -> str:
    """A page as Python-Markdown reads it.

    It wants an indent of four where GitHub takes two or three, and a file where GitHub shows a
    folder. Formulas become MathML.
    """
    lines = [""]
    blocks = iter(text.split("\n"))
    for line in blocks:
        indent = len(line) - len(line.lstrip(" "))
        if line.startswith("- ") and lines[-1].startswith(" "):
            lines.append("")  # Else an item after a paragraph would continue the paragraph.
        if line == LIVE:
            line = FRAME
        deeper = " " * (-(-indent // 4) * 4 - indent)
        if not FENCE.match(line):
            lines.append(deeper + prose(line))
            continue
        inside = list(takewhile(lambda one: not FENCE.match(one), blocks))
        if line.endswith("```math"):
            formula = " ".join(one.strip() for one in inside)
            lines.append(deeper + " " * indent + convert(formula, display="block"))
        else:
            lines += [deeper + one for one in (line, *inside, " " * indent + "```")]
    return "\n".join(lines)


def prose(line: str) -> str:
    """A line of text; what stands in backticks stays."""
    parts = line.split("`")
    for at in range(0, len(parts), 2):
        formulas = re.sub(r"\$([^$]+)\$", lambda found: convert(found[1]), parts[at])
        parts[at] = re.sub(r"(\]\([^)#:]*/)\)", r"\1README.md)", formulas)
    return "`".join(parts)


def index(folder: Path) -> str:
    """The page of a folder: its pages by title, and its scripts in full."""
    lines = [f"# {folder.name.upper() if len(folder.name) == 3 else folder.name.capitalize()}", ""]
    lines += [f"- [{title(one)}]({one.name})" for one in sorted(folder.glob("*.md"))]
    for script in sorted(folder.glob("*.py")):
        lines += ["", f"## {script.name}", "", "```python", script.read_text("utf-8"), "```"]
    return "\n".join(lines)


def api() -> str:
    """The page of the public names: functions first, then classes, each from its docstring."""
    lines = ["# Python API", "", "Every public name: `import overtaking as ot`.", ""]
    public = {name: getattr(overtaking, name) for name in vars(overtaking)["__all__"]}
    for heading, classes in (("Functions", False), ("Classes", True)):
        lines += [f"## {heading}", ""]
        for name, one in public.items():
            if isinstance(one, type) == classes:
                home = one.__name__ if isinstance(one, ModuleType) else f"{one.__module__}.{name}"
                lines += [f"::: {home}", ""]
    return "\n".join(lines)


def nav(pages: Path) -> str:
    """The menu, as YAML: each section lists its pages by their titles."""
    lines = ["nav:", "  - Start: README.md"]
    for section, folder in SECTIONS.items():
        lines.append(f"  - {section}:")
        lines += [
            f'    - "{title(path)}": {path.relative_to(pages)}'
            for path in sorted((pages / folder).glob("*.md"))
        ]
    lines.append("  - Project:")
    lines += [f'    - "{title(pages / name)}": {name}' for name in PROJECT]
    return "\n".join(lines)


def title(path: Path) -> str:
    """The first heading of a page."""
    return path.read_text("utf-8").partition("\n")[0].lstrip("# ").replace("`", "")


if __name__ == "__main__":
    sys.exit(main())
