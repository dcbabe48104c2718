"""No part of the project has more vague names and clauses than its limit.

    python tests/contract/test_language.py                 check the limits, as `make check` does
    python tests/contract/test_language.py FILES           list all places in files or folders
    python tests/contract/test_language.py --since COMMIT  list those on lines added since a commit

The words and limits are in `language.toml`. A low count proves little, but where the count is high,
readers stop often. Renaming `one` to `item` lowers the count and helps no reader.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from functools import cache
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

ROOT = Path(__file__).resolve().parents[2]
SETTINGS: dict[str, Any] = tomllib.loads(
    Path(__file__).with_name("language.toml").read_text("utf-8")
)
LIMITS: dict[str, dict[str, int]] = SETTINGS["limits"]
VAGUE_WORDS, FUNCTIONS, FUNCTIONS_IN_ED, CLASSES, MESSAGE_PARTS = (
    frozenset(SETTINGS["names"][key].split())
    for key in ("any", "functions", "functions_in_ed", "classes", "message_parts")
)
CLAUSES = [(re.compile(entry["pattern"], re.IGNORECASE), entry) for entry in SETTINGS["clauses"]]

SUFFIXES = {".md", ".py", ".pyi", ".rs", ".ts"}
# The pages of docs/reference are generated from sources that are counted. The changelog is history.
SKIPPED = ("CHANGELOG.md", "docs/reference/", "viewer/node_modules/")
MIN_SPACES_OF_A_SENTENCE = 2
MAX_SHOWN_PLACES = 12
MAX_SHOWN_CHARACTERS = 100

LEAVES = (ast.Name, ast.Constant, ast.expr_context, ast.operator)
# Python itself says `other` in its special methods.
SPECIAL_METHOD = re.compile(r"__\w+__$")
PYTHON_COMMENT = re.compile(r"(?:^|\s)# ?([^\"'\n]*)$", re.MULTILINE)
# A comment to the end of the line, or a line of a block comment.
C_COMMENT = re.compile(r"(?:^|[ \t])//[/!]? ?(.*)$|^[ \t]*/?\*+ (.*)$", re.MULTILINE)
C_STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"')
# Functions, then variables, loops, parameters and fields.
C_FUNCTION = re.compile(r"\b(?:fn|function) (\w+)")
C_BINDING = re.compile(
    r"\b(?:let(?: mut)?|const|var|for) (\w+)\b"
    r"|[(,{|]\s*(?:mut |pub )?(\w+)\??: |\b(\w+)\)? =>|\|(\w+)\|"
)
MARKER_ON_A_PAGE = re.compile(r"\s*(?:[-*>|]|#+|\d+\.)\s+")
CODE_ON_A_PAGE = re.compile(r"^```.*?^```|`[^`\n]*`|<!--.*?-->", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True, order=True)
class Place:
    """A vague name, or a sentence with a vague clause, with the repair that a message advises."""

    path: str
    line: int
    kind: str
    words: str
    advice: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.words}: {self.advice}"


@dataclass(frozen=True)
class Count:
    """The places of some files, and how many lines the files have."""

    places: list[Place]
    num_lines: int

    def rate(self, kind: str) -> float:
        """Places of a kind, `names` or `clauses`, per 10,000 lines that are not blank."""
        return 10_000 * sum(place.kind == kind for place in self.places) / max(self.num_lines, 1)


def split_name(name: str) -> list[str]:
    """The words of a name in lower case: `_the_other` and `TheOther` have two."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().replace("_", " ").split()


def is_vague(name: str, *others: frozenset[str]) -> bool:
    """Whether all words of a name are vague or in other lists; single letters are symbols."""
    words = split_name(name)
    vague_words = VAGUE_WORDS.union(*others)
    return len(name.strip("_")) > 1 and bool(words) and all(word in vague_words for word in words)


def is_vague_function(name: str) -> bool:
    words = split_name(name)
    is_participle = len(words) == 1 and words[0].endswith("ed") and words[0] not in FUNCTIONS_IN_ED
    return is_participle or is_vague(name, FUNCTIONS)


def vague_parameters(function: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[tuple[int, str]]:
    """Line and name of each vague parameter."""
    if SPECIAL_METHOD.match(function.name) and function.name != "__init__":
        return
    positional = [*function.args.posonlyargs, *function.args.args]
    keywords = function.args.kwonlyargs
    makes_message = any(parameter.arg == "expected" for parameter in [*positional, *keywords])
    for parameter in [*positional, *keywords]:
        is_part = parameter.arg in MESSAGE_PARTS and (makes_message or parameter in keywords)
        if is_vague(parameter.arg) and not is_part:
            yield parameter.lineno, parameter.arg


def walk(tree: ast.AST) -> list[ast.AST]:
    """All nodes of a tree, in half the time of `ast.walk` because leaves are not taken apart."""
    nodes = [tree]
    for node in nodes:
        if isinstance(node, LEAVES):
            continue
        for field in node._fields:
            child = getattr(node, field, None)
            if isinstance(child, ast.AST):
                nodes.append(child)
            elif isinstance(child, list):
                nodes += [item for item in child if isinstance(item, ast.AST)]
    return nodes


def vague_names_of_python(nodes: Iterable[ast.AST]) -> Iterator[tuple[int, str]]:
    """Line and name of each definition, parameter, variable and attribute with a vague name."""
    for node in nodes:
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            name = node.id if isinstance(node, ast.Name) else node.attr
            if is_vague(name):
                yield node.lineno, name
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if is_vague_function(node.name):
                yield node.lineno, node.name
            yield from vague_parameters(node)
        elif isinstance(node, ast.ClassDef) and is_vague(node.name, CLASSES):
            yield node.lineno, node.name


def vague_names_of_c(code: str) -> Iterator[tuple[int, str]]:
    """Line and name of each vague binding of Rust or TypeScript without comments and strings."""
    for number, line in enumerate(code.splitlines(), 1):
        for match in C_FUNCTION.finditer(line):
            if is_vague_function(match[1]):
                yield number, match[1]
        for match in C_BINDING.finditer(line):
            name = next(group for group in match.groups() if group)
            if is_vague(name) and not name[0].isupper():  # `None =>` is a pattern.
                yield number, name


def strings(nodes: Iterable[ast.AST]) -> Iterator[tuple[int, str]]:
    """Line and text of each string, with `{}` for the values of an f-string."""
    parts_of_others = set[ast.AST]()
    for node in nodes:  # `walk` visits an f-string before its parts
        if isinstance(node, ast.JoinedStr):
            parts = node.values
            parts_of_others.update(parts)
            texts = (str(part.value) if isinstance(part, ast.Constant) else "{}" for part in parts)
            yield node.lineno, "".join(texts)
        elif node not in parts_of_others and isinstance(node, ast.Constant):
            yield node.lineno, node.value if isinstance(node.value, str) else ""


def comments(pattern: re.Pattern[str], text: str) -> Iterator[tuple[int, str]]:
    """First line and text of each comment, with consecutive lines as one comment."""
    first, lines = 1, list[str]()
    for match in pattern.finditer(text):
        number = text.count("\n", 0, match.end()) + 1
        if number != first + len(lines):
            yield first, "\n".join(lines)
            first, lines = number, []
        lines.append(next((group for group in match.groups() if group), ""))
    yield first, "\n".join(lines)


def paragraphs(page: str) -> Iterator[tuple[int, str]]:
    """First line and text of each paragraph, heading, item and row of a page."""
    text = CODE_ON_A_PAGE.sub(lambda match: "`" + "\n" * match[0].count("\n"), page)
    first, lines = 1, list[str]()
    for number, line in enumerate(text.splitlines(), 1):
        marker = MARKER_ON_A_PAGE.match(line)
        if marker or not line.strip():
            yield first, "\n".join(lines)
            first, lines = number, []
        lines.append(line[marker.end() :] if marker else line)
    yield first, "\n".join(lines)


def vague_clauses(path: str, first: int, sentence: str) -> Iterator[Place]:
    """The vague clauses of a text that begins on line `first`."""
    for pattern, clause in CLAUSES:
        for match in pattern.finditer(sentence):
            start, end = sentence.rfind("\n", 0, match.end()) + 1, sentence.find("\n", match.end())
            line = sentence[start : end if end >= 0 else None].strip()
            words = f'"{" ".join(match[0].split())}" in "{line[:MAX_SHOWN_CHARACTERS]}"'
            number = first + sentence.count("\n", 0, match.end())
            yield Place(path, number, "clauses", words, clause["advice"])


def find_places(path: str, text: str) -> list[Place]:
    """The places of one file in the order of its lines.

    Args:
        path: Path from the root of the checkout, whose suffix tells the language.
        text: Content of the file.
    """
    names: Iterable[tuple[int, str]] = ()
    if path.endswith((".py", ".pyi")):
        nodes = walk(ast.parse(text))
        names = vague_names_of_python(nodes)
        sentences = [*strings(nodes), *comments(PYTHON_COMMENT, text)]
    elif path.endswith(".md"):
        sentences = list(paragraphs(text))
    else:
        names = vague_names_of_c(C_COMMENT.sub("", C_STRING.sub('""', text)))
        sentences = list(comments(C_COMMENT, text))
    places = {
        Place(path, line, "names", f"`{name}`", "name it after what it holds or does")
        for line, name in names
    }
    for first, sentence in sentences:
        if sentence.count(" ") >= MIN_SPACES_OF_A_SENTENCE:
            places.update(vague_clauses(path, first, sentence))
    return sorted(places)


def count_files(paths: Iterable[Path]) -> Count:
    """Count the places of some files."""
    places: list[Place] = []
    num_lines = 0
    for path in paths:
        text = path.read_text("utf-8")
        places += find_places(path.relative_to(ROOT).as_posix(), text)
        num_lines += sum(1 for line in text.splitlines() if line.strip())
    return Count(places, num_lines)


def files_below(folder: Path) -> list[Path]:
    """The sources and pages below a folder; of the root of the checkout only the pages in it."""
    candidates = folder.glob("*.md") if folder == ROOT else folder.rglob("*")
    return sorted(
        path
        for path in candidates
        if path.suffix in SUFFIXES and not path.relative_to(ROOT).as_posix().startswith(SKIPPED)
    )


def files_of_part(part: str) -> list[Path]:
    """The files below the folder of a part that belong to no smaller part."""
    nested = [
        ROOT / name for name in LIMITS if name != part and (ROOT / name).is_relative_to(ROOT / part)
    ]
    return [
        path
        for path in files_below(ROOT / part)
        if part == "." or not any(path.is_relative_to(folder) for folder in nested)
    ]


@cache
def count_part(part: str) -> Count:
    """Count the places of one part of the project."""
    return count_files(files_of_part(part))


def describe_excess(part: str, kind: str) -> str:
    """A message if a part has more places of a kind than its limit allows; empty if not."""
    limit, target = LIMITS[part][kind], SETTINGS["targets"][kind]
    count = count_part(part)
    places = [place for place in count.places if place.kind == kind]
    if len(places) <= ceil(limit * count.num_lines / 10_000):
        return ""
    first_places = "\n".join(f"  {place}" for place in places[:MAX_SHOWN_PLACES])
    return (
        f"{part}: vague {kind}: expected at most {limit} per 10,000 lines (target {target}), got "
        f"{count.rate(kind):.1f}; list the places of your change with "
        f"`python tests/contract/test_language.py --since main` and rewrite them. The first of "
        f"{len(places)}:\n{first_places}"
    )


def lines_added_since(commit: str) -> dict[str, set[int]]:
    """Numbers of the lines that the working tree adds to a commit, by path."""
    command = ["git", "diff", "--unified=0", "--no-color", "--no-ext-diff", "--merge-base", commit]
    diff = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    added: dict[str, set[int]] = {}
    path = ""
    for line in diff.splitlines():
        if line.startswith("+++ "):
            path = line.removeprefix("+++ b/")
        elif match := re.match(r"@@ \S+ \+(\d+)(?:,(\d+))? @@", line):
            first, length = int(match[1]), int(match[2] or 1)
            added.setdefault(path, set()).update(range(first, first + length))
    return added


def find_added_places(commit: str) -> list[Place]:
    """The places on lines that the working tree adds to a commit."""
    added = lines_added_since(commit)
    measured = {path for part in LIMITS for path in files_of_part(part)}
    changed = sorted(measured.intersection(ROOT / path for path in added))
    return [place for place in count_files(changed).places if place.line in added[place.path]]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", type=Path, metavar="FILES")
    parser.add_argument("--since", metavar="COMMIT")
    options = parser.parse_args()
    if options.since or options.files:
        paths = [
            path
            for file in options.files
            for path in (files_below(file.resolve()) if file.is_dir() else [file.resolve()])
        ]
        places = find_added_places(options.since) if options.since else count_files(paths).places
        print(*places, sep="\n", end="\n" if places else "")
        return 0
    messages = [
        message
        for part in LIMITS
        for kind in SETTINGS["targets"]
        if (message := describe_excess(part, kind))
    ]
    print(*messages, sep="\n", end="\n" if messages else "", file=sys.stderr)
    return int(bool(messages))


@pytest.mark.parametrize("kind", SETTINGS["targets"])
@pytest.mark.parametrize("part", LIMITS)
def test_no_part_has_more_vague_words_than_its_limit(part: str, kind: str):
    message = describe_excess(part, kind)
    assert not message, message


def test_a_limit_is_the_target_or_a_multiple_of_five_above_it():
    for limits in LIMITS.values():
        for kind, target in SETTINGS["targets"].items():
            assert limits[kind] == target or (limits[kind] > target and limits[kind] % 5 == 0)


def test_every_package_has_a_limit():
    folders = {
        f"src/overtaking/{path.parent.name}" for path in ROOT.glob("src/overtaking/*/__init__.py")
    }
    assert folders
    assert folders <= set(LIMITS)


@pytest.mark.parametrize("entry", SETTINGS["clauses"], ids=lambda entry: entry["advice"])
@pytest.mark.parametrize(
    ("path", "form"),
    [
        ("page.md", "Text.\n{}"),
        ("module.py", '"""Text.\n{}"""'),
        ("module.py", "x = 1\ny = 2  # {}"),
        ("module.py", 'x = 1\nraise ValueError("{}")'),
        ("module.py", 'x = 1\nraise ValueError(f"{{x}}; {}")'),
        ("module.py", 'x = 1\nOption("--name", help="{}")'),
        ("module.rs", "let x = 1;\n/// {}"),
        ("module.ts", "/**\n * {}\n */"),
    ],
)
def test_a_vague_clause_is_found_in(path: str, form: str, entry: dict[str, str]):
    (place,) = find_places(path, form.format(entry["example"]))
    assert (place.kind, place.line, place.advice) == ("clauses", 2, entry["advice"])


@pytest.mark.parametrize(
    ("path", "text", "names"),
    [
        ("a.py", "def found(lane): pass", ["found"]),
        ("a.py", "def _opened(path): pass\ndef read_speed(): pass\ndef speed(): pass", ["_opened"]),
        ("a.py", "def find(one, *, what, got): pass", ["one"]),
        ("a.py", "def find(what, *others): pass", ["what"]),
        ("a.py", "def error(what, expected, got): pass", []),
        ("a.py", "class A:\n    def __eq__(self, other): pass", []),
        ("a.py", "class Plight: pass\nclass PlightOfDriver: pass", ["Plight"]),
        ("a.py", "for one in lanes: pass", ["one"]),
        ("a.py", "[each_one for each_one in lanes]", ["each_one"]),
        ("a.py", "_found, found_gap, x, _ = row", ["_found"]),
        ("a.py", "self.known = self.told", ["known"]),
        ("a.rs", "fn told(one: f32) {}\nlet mut found = 1; // let said", ["told", "one", "found"]),
        ("a.rs", 'lanes.map(|one| one.width)\nprint("let found")', ["one"]),
        ("a.rs", "match lane { None => 1, Some(lane) => 2 }", []),
        ("a.ts", "const found = (one) => one.s;\nfunction asked(known: number) {}", None),
    ],
)
def test_vague_names_are_found(path: str, text: str, names: list[str] | None):
    expected = ["found", "one", "asked", "known"] if names is None else names
    places = find_places(path, text)
    assert sorted(place.words.strip("`") for place in places) == sorted(expected)


@pytest.mark.parametrize(
    "sentence",
    [
        "The driver, who is the ego, brakes.",
        "The road has no lanes; what is missing?",
        "Every vehicle that has not been recorded is left out.",
    ],
)
def test_a_sentence_with_a_subject_is_not_counted(sentence: str):
    assert find_places("page.md", sentence) == []


def test_comments_above_a_name_do_not_shift_its_line():
    (place,) = find_places(
        "a.rs", "let x = 1;\n\n/// Text.\n// Text.\n\n/*\n * Text.\n */\nlet found = 1;"
    )
    assert place.line == 9


def test_code_on_a_page_is_not_counted():
    assert find_places("page.md", "Call `the one that is none`.\n```\nif nobody is told\n```") == []


if __name__ == "__main__":
    raise SystemExit(main())
