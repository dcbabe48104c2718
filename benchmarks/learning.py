"""The rules and the factors of a data set, as the page about learning shows them.

Makes the data sets that are missing in a folder, learns from them, and prints tables; with --into
they replace what stands between two marks in a page.

    python benchmarks/learning.py --folder build/learning --into docs/explanation/learning.md
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import overtaking
from overtaking.analysis.learning.factors import FactorsFound
from overtaking.analysis.learning.rules import RulesFound
from overtaking.analysis.learning.tables import (
    comparison_table,
    confusion_table,
    leakage_table,
    model_table,
    ranking_table,
    rule_table,
)
from overtaking.analysis.stats.table import Table
from overtaking.core.errors import DatasetError

BEGIN = "<!-- begin: benchmarks/learning.py -->"
END = "<!-- end: benchmarks/learning.py -->"
SIZES = {"pinto2023-physical": 20_000, "motorway-risk": 5_000}
TARGETS = ("legal", "collision", "start")


def data_set(folder: Path, profile: str, simulations: int) -> Path:
    """The folder of a data set, made if it is not there."""
    path = folder / f"{profile}-{simulations}"
    if not path.exists():
        overtaking.generate_dataset(
            profile, num_simulations=simulations, seed=1, out=path, keep="features"
        )
    return path


def progress(what: str) -> Callable[[int, int], None]:
    """Says how much is done."""

    def say(done: int, total: int) -> None:
        print(f"\r{what}: {done} of {total}   ", end="", file=sys.stderr, flush=True)

    return say


def markdown(table: Table) -> str:
    """A table with its title and its note."""
    header = [name or "#" for name in table.header]
    rows = [header, ["---"] * len(header), *table.cells()]
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return f"**{table.title}**\n\n" + "\n".join(lines) + f"\n\n{table.note}\n"


def rules_page(found: RulesFound) -> str:
    """What was learned about a target."""
    overlooked = ", ".join(str(one) for one in found.missed) or "none"
    return "\n".join(
        [
            markdown(rule_table(found)),
            markdown(comparison_table(found)),
            f"Learned from {found.num_learned_from:,} simulations. On all "
            f"{found.everywhere.num:,} the accuracy of the rules is "
            f"{100.0 * found.everywhere.accuracy:.1f} %, with {found.num_missed:,} false "
            f"negatives, such as {overlooked}.\n",
        ]
    )


def factors_page(found: FactorsFound) -> str:
    """What was found out about the factors."""
    tables = [model_table(found), confusion_table(found), ranking_table(found)]
    tables += [leakage_table(found)] if found.leakage else []
    return "\n".join(markdown(one) for one in tables)


def page(folder: Path, sizes: dict[str, int], asked: str, repeats: int) -> str:
    """All of it; the factors of what is asked, none if they are to be ranked 0 times."""
    parts: list[str] = []
    for profile, simulations in sizes.items():
        path = data_set(folder, profile, simulations)
        content = overtaking.load_dataset(path).content_hash
        parts.append(f"### {profile}, {simulations:,} simulations\n")
        parts.append(f"Seed 1, content hash `{content[:16]}`.\n")
        for about in TARGETS:
            told = progress(f"{profile}, {about}")
            try:
                parts.append(
                    rules_page(overtaking.learning.learn_rules(path, about, progress=told))
                )
            except DatasetError as lacking:
                parts.append(f"No rules about *{about}*: {lacking}\n")
        if not repeats:
            continue
        told = progress(f"{profile}, factors")
        found = overtaking.learning.learn_factors(
            path, asked, repeats=repeats, show_leakage=True, progress=told
        )
        parts.append(factors_page(found))
    return "\n".join(parts)


def replaced(text: str, new: str) -> str:
    """A page with something else between the marks."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{new}\n{END}{after}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("build/learning"))
    parser.add_argument("--profile", choices=SIZES, help="only this one")
    parser.add_argument("--simulations", type=int, help="in place of the usual number")
    parser.add_argument("--repeats", type=int, default=1, help="rank so often; 0: only rules")
    parser.add_argument("--factors-of", default="outcome", choices=("outcome", *TARGETS))
    parser.add_argument("--into", type=Path, help="page to write the tables into")
    given = parser.parse_args()
    names = [given.profile] if given.profile else list(SIZES)
    sizes = {name: given.simulations or SIZES[name] for name in names}
    text = page(given.folder, sizes, given.factors_of, given.repeats)
    if given.into:
        given.into.write_text(replaced(given.into.read_text("utf-8"), text), "utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
