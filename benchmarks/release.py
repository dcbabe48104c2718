"""Makes a release of data sets to learn from, and checks it by content hash.

    python benchmarks/release.py --out build/release          # 100,000 simulations of each profile
    python benchmarks/release.py --out build/small -n 500 --profiles pinto2023
    python benchmarks/release.py --out build/release --write  # after the model has changed

Makes or completes a data set of each profile, verifies the checksum of every file, and compares the
content hashes with those in `release.json`; --write writes them there instead. Beside the tables
of each data set come `tasks.parquet` (part and answers of each simulation), the tasks with their
baselines in its README.md, and both in its croissant.json. Exits with 1 if a hash differs or is not
known. What the tasks are, and what they do not tell: docs/how-to/release-data-sets.md.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import overtaking
from overtaking.analysis.learning.baselines import Baseline, baselines
from overtaking.analysis.learning.examples import Examples, examples_of, roots_of
from overtaking.analysis.learning.tasks import PARTS, TASKS, Names, Task, parts_of
from overtaking.data.card import README_NAME
from overtaking.data.croissant import CROISSANT_NAME
from overtaking.data.load import Dataset
from overtaking.data.manifest import FILE_NAME

PROFILES = ("pinto2023", "motorway", "motorway-risk")
SEED = 2023
POLICY = "paper"
TASKS_NAME = "tasks.parquet"
EXPECTED = Path(__file__).with_suffix(".json")
CARD = Path(__file__).with_name("release.md")
"""The chapter that is added to the README.md of each data set."""


def progress(what: str) -> Callable[[int, int], None]:
    """Says how much is done."""

    def say(done: int, total: int) -> None:
        print(f"\r{what}: {done:,} of {total:,}", end="", file=sys.stderr, flush=True)

    return say


def made(folder: Path, profile: str, simulations: int) -> Dataset:
    """The data set of a profile, made or completed, with every file verified."""
    data = overtaking.generate_dataset(
        profile,
        num_simulations=simulations,
        seed=SEED,
        out=folder,
        keep="features",
        executor="auto",
        resume=(folder / FILE_NAME).exists(),
        progress=progress(profile),
    )
    print(file=sys.stderr)
    data.verify()
    return data


def answers_of(task: Task, examples: Examples) -> list[str | None]:
    """The answer of each example, None where the task is not asked."""
    found = zip(task.is_asked(examples), task.answers(examples), strict=True)
    return [str(answer) if asked else None for asked, answer in found]


def tasks_table(examples: Examples, roots: Names) -> pa.Table:
    """Scene, part and answers of each simulation."""
    columns: dict[str, Any] = {
        "simulation": examples.simulations,
        "scene": roots,
        "part": parts_of(roots),
    }
    return pa.table(columns | {task.name: answers_of(task, examples) for task in TASKS})


def judged(task: Task, examples: Examples, parts: Names) -> list[Baseline]:
    """The baselines of a task, learned from the training part, on the test part."""
    asked, answers = task.is_asked(examples), task.answers(examples)
    known, kept = (asked & (parts == part) for part in ("train", "test"))
    return baselines(examples.where(known), answers[known], examples.where(kept), answers[kept])


def share(numbers: tuple[float, float, float]) -> str:
    """A share with its interval, in percent."""
    value, low, high = (100.0 * number for number in numbers)
    return f"{value:.1f} % ({low:.1f} to {high:.1f})"


def described(task: Task, examples: Examples, parts: Names) -> str:
    """The chapter of a task: how often each answer is given, and what baselines reach."""
    asked = task.is_asked(examples)
    names, counts = np.unique(task.answers(examples)[asked], return_counts=True)
    given = ", ".join(f"{name} {count:,}" for name, count in zip(names, counts, strict=True))
    rows = [
        f"| {one.name} | {one.num:,} | {share(one.accuracy)} | {share(one.balanced)} |"
        for one in judged(task, examples, parts)
    ]
    head = "| baseline | test examples | accuracy | balanced accuracy |\n|---|--:|---|---|"
    table = "\n".join([head, *rows]) if rows else "Too few examples for baselines."
    return f"### {task.name}: {task.question}\n\n{given or 'No example'}.\n\n{table}\n"


def chapter(examples: Examples, parts: Names) -> str:
    """What the README.md of a data set says about split and tasks."""
    counts = ", ".join(f"{int((parts == part).sum()):,} {part}" for part in PARTS)
    tasks = "\n".join(described(task, examples, parts) for task in TASKS)
    return CARD.read_text(encoding="utf-8").format(counts=counts, policy=POLICY, tasks=tasks)


def add_to_croissant(folder: Path) -> None:
    """Add the file of the tasks, and its columns, to the data set's croissant.json."""
    path, file = folder / CROISSANT_NAME, folder / TASKS_NAME
    content = json.loads(path.read_text(encoding="utf-8"))
    content["distribution"].append(
        {
            "@type": "cr:FileObject",
            "@id": TASKS_NAME,
            "name": TASKS_NAME,
            "contentUrl": TASKS_NAME,
            "contentSize": f"{file.stat().st_size} B",
            "encodingFormat": "application/x-parquet",
            "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
        }
    )
    told = {"simulation": "number of the simulation", "scene": "seed and number of the scene"}
    told |= {"part": f"part of the split by scene: {', '.join(PARTS)}"}
    told |= {task.name: f"{task.question} Null where it is not asked" for task in TASKS}
    content["recordSet"].append(
        {
            "@type": "cr:RecordSet",
            "@id": "tasks",
            "name": "tasks",
            "description": "Part and answers of each simulation.",
            "key": [{"@id": "tasks/simulation"}],
            "field": [
                {
                    "@type": "cr:Field",
                    "@id": f"tasks/{name}",
                    "name": name,
                    "description": meaning,
                    "dataType": "sc:Integer" if name == "simulation" else "sc:Text",
                    "source": {"fileObject": {"@id": TASKS_NAME}, "extract": {"column": name}},
                }
                for name, meaning in told.items()
            ],
        }
    )
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def released(folder: Path, profile: str, simulations: int) -> str:
    """Make the data set of a profile with its tasks; its content hash."""
    # Resuming writes README.md and croissant.json anew, so chapters never come twice.
    data = made(folder, profile, simulations)
    examples = examples_of(data, POLICY)
    rows = data.simulations().set_index("simulation").reindex(examples.simulations)
    roots = roots_of(rows)
    pq.write_table(tasks_table(examples, roots), folder / TASKS_NAME)
    readme = folder / README_NAME
    text = readme.read_text(encoding="utf-8") + chapter(examples, parts_of(roots))
    readme.write_text(text, encoding="utf-8")
    add_to_croissant(folder)
    return str(data.content_hash)


def main() -> int:
    """Make, check and print."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("--out", type=Path, required=True, help="folder of the release")
    options.add_argument("-n", type=int, default=100_000, help="simulations of each profile")
    options.add_argument("--profiles", nargs="+", default=PROFILES, help="only these")
    options.add_argument("--write", action="store_true", help="write the hashes instead")
    given = options.parse_args()
    expected = json.loads(EXPECTED.read_text(encoding="utf-8"))
    known = expected.setdefault(str(given.n), {})
    wrong = 0
    for profile in given.profiles:
        found = released(given.out / profile, profile, given.n)
        if given.write:
            known[profile] = found
        is_right = known.get(profile) == found
        wrong += not is_right
        verdict = "as expected" if is_right else f"NOT as expected: {known.get(profile)}"
        print(f"{profile}, {given.n:,} simulations, content hash {found}: {verdict}")
    if given.write:
        EXPECTED.write_text(json.dumps(expected, indent=2) + "\n", encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
