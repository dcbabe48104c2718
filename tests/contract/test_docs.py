"""The pages are true: links lead somewhere, commands and names exist, examples run.

Blocks of pages are run in `tests/integration/test_pages.py`.
"""

from __future__ import annotations

import builtins
import dataclasses
import importlib
import re
import shlex
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from overtaking.knowledge.glossary import terms
from overtaking.knowledge.quantities import Distribution
from overtaking.knowledge.toml_reader import all_quantities

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted(
    str(path.relative_to(ROOT)) for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
)
EXAMPLES = [
    # Each step of it is one of the readable simulator: 10 s of a core.
    pytest.param(page, marks=pytest.mark.ci if page.endswith("mobil_driver.py") else ())
    for page in sorted(str(path.relative_to(ROOT)) for path in (ROOT / "examples").glob("*.py"))
]

FENCE = re.compile(r"^( *)```(\w+)\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\[[^]]*\]\(([^)\s]+)\)|(?:src|srcset)=\"([^\"]+)\"")
PACKAGES = {path.stem for path in (ROOT / "src" / "overtaking").glob("[a-z]*")}
CLASSES = {
    "Contacts": "model.trajectories",
    "Controls": "sim.reference.state",
    "Dataset": "data.load",
    "DriverTraits": "model.vehicles",
    "FrictionAndWind": "sim.reference.state",
    "Lane": "model.road",
    "Motion": "sim.reference.state",
    "OvertakeState": "sim.reference.state",
    "Percepts": "model.trajectories",
    "RandomProcesses": "sim.reference.state",
    "Road": "model.road",
    "Scenario": "model.scenario",
    "Stage": "model.trajectories",
    "Trajectories": "model.trajectories",
    "VehicleSpecs": "model.vehicles",
    "Weather": "model.weather",
}
ENTRIES = {
    entry for file in ("model", "weather", "friction") for entry in all_quantities(f"{file}.toml")
}
NOT_NAMES = (".ts", ".lp", ".py", ".rs", ".md", ".toml", ".json", ".txt", ".xml")


def wrong(check: Callable[[str], object]) -> dict[str, object]:
    """What a check finds wrong on every page where it finds anything."""
    return {page: found for page in PAGES if (found := check(page))}


def read(page: str | Path) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def blocks(text: str) -> Iterator[tuple[str, str]]:
    """The fenced blocks of a page in order, as (language, content)."""
    for indent, language, content in FENCE.findall(text):
        yield language, re.sub(f"^{indent}", "", content, flags=re.MULTILINE)


def prose(text: str) -> str:
    """A page without its fenced blocks."""
    return FENCE.sub("", text)


def words(text: str) -> list[str]:
    """The inline code of a page."""
    return re.findall(r"`([^`\n]+)`", prose(text))


def commands(text: str) -> list[str]:
    """The command lines of a page, in blocks and in its prose."""
    lines = [
        line
        for kind, block in blocks(text)
        if kind == "console"
        for line in block.replace("\\\n", " ").split("\n")
    ]
    inline = [
        word for word in words(text) if re.match(r"(?:[A-Z_]+=\S+ )?(overtaking|make) ", word)
    ]
    return [line.strip() for line in [*lines, *inline] if line.strip()]


# --- links ---


def anchors(text: str) -> set[str]:
    """What a link into a page can name: its headings as GitHub spells them, and explicit ids."""
    found = set(re.findall(r'<a id="([^"]+)"', text))
    for heading in re.findall(r"^#+ (.+)$", prose(text), re.MULTILINE):
        plain = re.sub(r"[^\w\- ]", "", heading.lower())
        found.add(plain.replace(" ", "-"))
    return found


def broken_links(text: str, folder: Path) -> list[str]:
    """The links of a page that lead nowhere; addresses of other sites are not visited."""
    broken: list[str] = []
    for pair in LINK.findall(re.sub(r"`[^`\n]*`", "", prose(text))):
        target = pair[0] or pair[1]
        if re.match(r"https://|mailto:", target):
            continue
        name, _, anchor = target.partition("#")
        path = folder / name if name else None
        content = (
            text if path is None else read(path) if path.suffix == ".md" and path.exists() else ""
        )
        if (path and not path.exists()) or (anchor and anchor not in anchors(content)):
            broken.append(target)
    return broken


def test_every_link_leads_somewhere():
    assert wrong(lambda page: broken_links(read(page), (ROOT / page).parent)) == {}


def test_a_broken_link_is_seen():
    text = "# One\n[a](missing.md) [b](README.md#nowhere) [c](#two) [d](#one) `[e](x.md)`"
    assert broken_links(text, ROOT) == ["missing.md", "README.md#nowhere", "#two"]


# --- the table of extensions ---

BASES = ("", "src", "src/overtaking", "crates/overtaking-core/src", "crates/overtaking-labels/src")
"""The folders to which ARCHITECTURE's paths are relative."""


def missing_paths(text: str) -> list[str]:
    """The files and folders of the table "To add" that do not exist."""
    table = text.partition("## To add")[2].partition("\n## ")[0]
    cells = "".join(part for row in table.split("\n") for part in row.split("|")[1:-1])
    paths = re.findall(r"`([\w./-]+(?:/|\.(?:py|rs|toml|lp|pl|ts)))`", cells)
    return [path for path in paths if not any((ROOT / base / path).exists() for base in BASES)]


def test_the_table_of_extensions_names_files_that_exist():
    assert missing_paths(read("ARCHITECTURE.md")) == []


def test_a_file_that_does_not_exist_is_seen():
    table = "## To add\n| a | `cli/app.py`, `nowhere/` and `lost.rs` | |\n\n## Next\n`gone.py`"
    assert missing_paths(table) == ["nowhere/", "lost.rs"]


# --- commands ---


@cache
def command_line() -> Any:
    """The commands with their options."""
    import typer.main

    from overtaking.cli.app import build

    return typer.main.get_command(build())


def faults(line: str) -> list[str]:
    """What is wrong with a command line: an unknown command or option, or an unknown target."""
    words = shlex.split(line, comments=True)
    program, *arguments = [word for word in words if not re.match(r"[A-Z_]+=", word)]
    if program == "make":
        return [word for word in arguments if not re.search(rf"^{word}:", read("Makefile"), re.M)]
    if Path(program).name != "overtaking":  # The page that runs it says what it is.
        return []
    group = command_line()
    options = {option for one in group.params for option in one.opts} | {"--help"}
    verb, given = arguments[0], arguments[1:]
    if not verb.startswith("-"):
        if verb not in group.commands:
            return [verb]
        group = group.commands[verb]
        if getattr(group, "commands", None):  # A command of two words.
            if not given or given[0] not in group.commands:
                return given[:1] or [verb]
            group, given = group.commands[given[0]], given[1:]
        parameters = group.params
        options = {option for one in parameters for option in [*one.opts, *one.secondary_opts]}
    else:
        given = arguments
    return [word for word in given if re.match(r"--?[a-z]", word) and word not in options]


def test_every_command_exists():
    assert wrong(lambda page: [one for line in commands(read(page)) for one in faults(line)]) == {}


def test_a_command_that_does_not_exist_is_seen():
    assert faults("overtaking generate -n 5 --out x --seeds 1") == ["--seeds"]
    assert faults("overtaking fly away") == ["fly"]
    assert faults("overtaking sumo fly") == ["fly"]
    assert faults("overtaking sumo run -n 5 --out x --seeds 1") == ["--seeds"]
    assert faults("make coffee") == ["coffee"]
    assert faults("OVERTAKING_SIMD=avx2 overtaking doctor --json") == []
    assert commands("`overtaking a b`\n```console\nmake c\n```\n") == ["make c", "overtaking a b"]


# --- queries ---

CHOICES = {"labels": "policy", "findings": "verdict"}
"""Tables with several rows for a simulation, and the column by which a query chooses among them."""


def queries(text: str) -> list[str]:
    """The SQL of a page: in blocks, in strings of Python, and behind `overtaking sql DATA`."""
    found = [block for kind, block in blocks(text) if kind == "sql"]
    found += [
        query
        for kind, block in blocks(text)
        if kind == "python"
        for query in re.findall(r'"(select [^"]+)"', block, re.I)
    ]
    lines = [shlex.split(line) for line in commands(text) if line.startswith("overtaking sql")]
    return [*found, *(line[3] for line in lines if len(line) > 3)]


def repeated(query: str) -> list[str]:
    """The tables of which a query counts several rows for the same simulation."""
    return [
        name
        for name, column in CHOICES.items()
        if re.search(rf"\b(from|join)\s+\S*\b{name}\b", query, re.I)
        and "count(" in query.lower()
        and column not in query.lower()
    ]


def test_no_query_counts_a_simulation_more_than_once():
    assert wrong(lambda page: [one for one in queries(read(page)) if repeated(one)]) == {}


def test_a_query_that_counts_a_simulation_thrice_is_seen():
    text = '`overtaking sql d "SELECT class, count(*) FROM labels GROUP BY ALL"`'
    assert [repeated(query) for query in queries(text)] == [["labels"]]
    assert repeated("select count(*) from findings where verdict = 'illegal'") == []


# --- examples ---


@pytest.mark.ci
@pytest.mark.parametrize("script", EXAMPLES)
def test_an_example_runs(script: str, workdir: Path):
    done = subprocess.run(
        [sys.executable, "-W", "error", ROOT / script], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert len(done.stdout.splitlines()) > 3
    assert list(workdir.iterdir()) == [], "an example leaves nothing behind"


# --- names ---


def is_name(word: str) -> bool:
    """Whether a word of code looks like something of the package."""
    if not re.fullmatch(r"[A-Za-z_]\w*(\.\w+)+", word) or word.endswith(NOT_NAMES):
        return False
    if word in ENTRIES:  # Those of the section [overtaking] look like names of the package.
        return False
    first = word.removeprefix("overtaking.").split(".")[0]
    return first in PACKAGES or first in CLASSES or word.startswith("overtaking.")


def exists(word: str) -> bool:
    """Whether a dotted name leads to a module, a class, a function, or a field of a class."""
    first, *rest = word.removeprefix("overtaking.").split(".")
    if first in CLASSES:
        path = ["overtaking", *CLASSES[first].split("."), first, *rest]
    else:
        path = ["overtaking", first, *rest]
    found: Any = importlib.import_module(path.pop(0))
    for name in path:
        if dataclasses.is_dataclass(found) and name in {
            one.name for one in dataclasses.fields(found)
        }:
            return name == path[-1]
        try:
            found = getattr(found, name) if hasattr(found, name) else submodule(found, name)
        except ImportError:
            return False
    return True


def submodule(module: Any, name: str) -> Any:
    """A module inside a package."""
    if not hasattr(module, "__path__"):
        raise ImportError(name)
    return importlib.import_module(f"{module.__name__}.{name}")


def test_every_name_exists():
    def missing(page: str) -> list[str]:
        return [word for word in words(read(page)) if is_name(word) and not exists(word)]

    assert wrong(missing) == {}


FUNCTIONS_OF_OTHERS = {
    *("load_world", "reload_world", "set_simulate_physics", "shut_down"),  # CARLA's client.
    "make_vec",  # Gymnasium.
}


# Before a dot: modules that export functions of others.
PUBLIC_MODULES = {"ot", "overtaking", "gym", "law", "whatif", "logic", "learning"}


@cache
def methods() -> set[str]:
    """Names of all methods of the project, and of functions inside functions."""
    return {name for text in sources() for name in re.findall(r"^ +def (\w+)", text, re.MULTILINE)}


@cache
def functions() -> dict[str, set[str]]:
    """Modules in which there is a function or class, by its name; also those of Rust."""
    modules_by_name: dict[str, set[str]] = {name: {"builtins"} for name in dir(builtins)}
    for text, module in sources().items():
        for name in re.findall(r"^(?:def|class|    pub fn|pub fn) (\w+)", text, re.MULTILINE):
            modules_by_name.setdefault(name, set()).add(module)
    return modules_by_name


@cache
def sources() -> dict[str, str]:
    """The name of the module by the text of each source."""
    paths = [
        path
        for folder in ("src", "examples", "benchmarks", "crates")
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".rs")
    ]
    return {read(path): path.stem for path in paths}


def is_function(owner: str, name: str) -> bool:
    """Whether a called name is defined where the page says.

    Args:
        owner: The name before the dot; empty without one.
        name: The called name.
    """
    modules = functions().get(name, set())
    if name in FUNCTIONS_OF_OTHERS or name in methods():
        return True
    return bool(modules) if not owner or owner in PUBLIC_MODULES else owner in modules


def unknown_calls(text: str) -> list[str]:
    """Calls in the inline code of a page to functions that nothing defines."""
    calls = [
        (owner, name, word)
        for word in words(text)
        # In logic, `(S` begins the arguments of a predicate about the simulation S.
        if not re.search(r"\w\(S\b", word)
        for owner, name in re.findall(
            r"(?:([A-Za-z_]\w*)\.)?([A-Za-z_]\w*)\(", re.sub(r'"[^"]*"', "", word)
        )
    ]
    return [word for owner, name, word in calls if not is_function(owner, name)]


def test_every_function_that_a_page_calls_exists():
    def missing(page: str) -> list[str]:
        # Decision records and the changelog name what there was.
        is_history = page == "CHANGELOG.md" or page.startswith("docs/adr/")
        return [] if is_history else unknown_calls(read(page))

    assert wrong(missing) == {}


def test_a_call_of_a_former_function_is_noticed():
    assert unknown_calls("`road.speed_limit_at(s)` and `no_such_name(3)`") == ["no_such_name(3)"]
    # There is a function of this name, but not in a module `road`.
    assert unknown_calls("`road.limit_at(case.signals.s)`") == ["road.limit_at(case.signals.s)"]
    assert unknown_calls("`illegal(S,l4)`") == []


@pytest.mark.parametrize(
    ("name", "is_there"),
    [
        ("sim.reference.car_following.iidm_accel", True),
        ("sim.reference.car_following.idm", False),
        ("DriverTraits.time_gap", True),
        ("DriverTraits.time_gaps", False),
        ("overtaking.branch", True),
        ("overtaking.labels.events_of", False),
        ("model.vehicles.DriverTraits.patience.more", False),
    ],
)
def test_names_are_told_apart(name: str, is_there: bool):
    assert is_name(name)
    assert exists(name) == is_there


def test_every_word_of_the_glossary_has_a_home():
    rows = re.findall(r"^\| (?!name|-)(.+?) \| (.+?) \|", read("docs/reference/glossary.md"), re.M)
    assert len(rows) > 50
    homeless = [name for name, home in rows if not any(map(is_name, re.findall("`(.+?)`", home)))]
    assert homeless == []


def test_what_is_no_name_is_not_taken_for_one():
    assert not any(
        map(is_name, ["a.b", "vehicle_classes.toml", "steering.rate", "overtaking.stay_time"])
    )


def test_the_readme_explains_all_classes_as_the_terms_do():
    classes = terms("classes")
    rows = re.findall(r"^\| `(\w+)` \| (.+) \|$", read("README.md"), re.M)
    assert [(name, term.meaning) for name, term in classes.items()] == rows[: len(classes)]


# --- the map ---


def test_the_map_names_every_package_and_both_halves_of_the_model():
    text = read("ARCHITECTURE.md")
    source = ROOT / "src" / "overtaking"
    layers = text[text.index("## Packages") : text.index("## The model")]
    assert [name for name in sorted(PACKAGES) if name != "py" and f"`{name}`" not in layers] == []
    for folder, ending in (
        (source / "sim" / "reference", ".py"),
        (ROOT / "crates/overtaking-core/src", ".rs"),
        (ROOT / "crates/overtaking-labels/src", ".rs"),
    ):
        files = {path.name for path in folder.glob(f"*{ending}")} - {"__init__.py"}
        assert files - set(re.findall(rf"(\w+\{ending})", text)) == set()


def test_no_two_decisions_have_the_same_number():
    pages = sorted((ROOT / "docs" / "adr").glob("*.md"))
    numbers = [path.name[:4] for path in pages]
    assert len(set(numbers)) == len(numbers)
    for path in pages:
        assert path.read_text(encoding="utf-8").startswith(f"# {int(path.name[:4])}. ")


def test_every_decision_is_listed():
    listed = re.findall(r"\(adr/(.+?\.md)\)", read("docs/README.md"))
    assert listed == sorted(path.name for path in (ROOT / "docs" / "adr").glob("*.md"))


# --- generated pages ---


@pytest.mark.ci
def test_generated_pages_and_pictures_are_current_and_one_that_is_not_is_named(tmp_path: Path):
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    page = tmp_path / "docs" / "reference" / "constants.md"
    page.write_text(page.read_text(encoding="utf-8").replace("9.81", "9.82"), encoding="utf-8")
    command = [sys.executable, tmp_path / "docs" / "generate.py", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    # Once for both: it takes 5 s of a core.
    said = "docs/reference/constants.md is out of date: run make docs\n"
    assert (done.stderr, done.returncode) == (said, 1)


def test_the_page_of_drivers_has_the_population_of_each_profile():
    from overtaking.scenarios.profiles import load_specification, profile_names

    page = read("docs/reference/drivers.md")
    for name in profile_names():
        population = load_specification(name).drivers.population
        assert f"| `{name}` | [`{population}`](#population-{population}) |" in page
        section = page.partition(f"\n## Population {population}\n")[2].partition("\n## ")[0]
        careful = all_quantities("drivers.toml")[f"{population}.careful.min_gap"]
        assert isinstance(careful, Distribution)
        assert f"| `min_gap` | {careful.parameter('value'):g} |" in section
