"""Examples as the three input files of the learner Popper: bias, background and examples.

Each simulation is a constant, each condition at a supervised cut point a predicate of one argument,
and the target the predicate of the head. All of it is Datalog, without types, which the files of
one argument do not need; bias and background are syntax of clingo and of Prolog alike.

Source:
    A. Cropper and R. Morel, Learning programs by learning from failures, Machine Learning 110
    (2021) 801-856, and the conventions of its implementation.
"""

import re
from collections.abc import Iterator
from pathlib import Path

from overtaking.analysis.learning.conditions import Condition, conditions_of
from overtaking.analysis.learning.covering import MAX_CONDITIONS, MAX_RULES
from overtaking.analysis.learning.examples import Examples, refuse_too_few
from overtaking.analysis.learning.targets import Target
from overtaking.core.arrays import Mask
from overtaking.core.files import atomic_folder, write_new_file

MAX_PREDICATES = 60
"""Predicates of the body: Popper's search grows with every one."""

_LEAST = 20
_SIGNS = {True: "at_least", False: "below"}


def write_popper(examples: Examples, target: Target, out: Path) -> int:
    """Write `bias.pl`, `bk.pl` and `exs.pl`.

    Args:
        examples: The examples of a data set.
        target: The target, which is the head.
        out: Folder for the files; it must not exist, or be empty. It appears when it is complete.

    Returns:
        Number of facts in background and examples.

    Raises:
        ConfigError: The folder is taken.
        DatasetError: There are too few examples.
        OSError: A file cannot be written.
    """
    asked, positive = examples.about(target)
    refuse_too_few(
        positive, asked.groups, where="export to popper", what=f'"{target.title}"', least=_LEAST
    )
    found = _most_telling(conditions_of(asked, positive), asked, positive)
    head = head_of(target)
    background = [line for one in found for line in _facts(one, asked)]
    said = [
        f"{'pos' if is_so else 'neg'}({head}({constant(number)}))."
        for number, is_so in zip(asked.simulations, positive, strict=True)
    ]
    with atomic_folder(out) as folder:
        write_new_file(folder / "bias.pl", _lines(_bias(head, found)))
        write_new_file(folder / "bk.pl", _lines([f"% {target.question}", *background]))
        # Popper reads examples of one kind after those of the other.
        write_new_file(
            folder / "exs.pl", _lines(sorted(said, key=lambda line: line.startswith("neg")))
        )
    return sum(1 for line in background if not line.startswith("%")) + len(said)


def head_of(target: Target) -> str:
    """The predicate of a target."""
    return target.title.replace(" ", "_")


def constant(simulation: int) -> str:
    """The name of a simulation."""
    return f"s{simulation}"


def predicate(condition: Condition) -> str:
    """The name of a condition: attribute, side, and the border in hundredths of its unit of SI."""
    name = condition.attribute.name
    if condition.attribute.is_nominal:
        level = condition.attribute.levels[int(condition.value)]
        if len(condition.attribute.levels) == 2:
            return name if condition.value else f"not_{name}"
        return f"{name}_is_{level.lower()}"
    stem, unit = re.fullmatch(r"(.*?)(?:_(mps2?|m|s|mmph|radps))?", name).groups()  # type: ignore[union-attr]
    hundredths = round(abs(condition.value) * 100.0)
    minus = "minus_" if condition.value < 0.0 and hundredths else ""
    number = f"{minus}{hundredths // 100}_{hundredths % 100:02d}"
    return "_".join(filter(None, (stem, _SIGNS[condition.is_least], number, unit)))


def _most_telling(
    conditions: list[Condition], examples: Examples, positive: Mask
) -> list[Condition]:
    """The conditions that deviate most from the mean, in the order of the attributes."""
    share = float(positive.mean())

    def unusual(index: int) -> float:
        holds = conditions[index].holds(examples)
        return abs(float((holds & positive).sum()) - share * float(holds.sum()))

    order = sorted(range(len(conditions)), key=lambda index: -unusual(index))
    chosen: dict[str, int] = {}
    for index in order:  # Two borders with the same text are one predicate.
        chosen.setdefault(predicate(conditions[index]), index)
    return [conditions[index] for index in sorted(list(chosen.values())[:MAX_PREDICATES])]


def _bias(head: str, conditions: list[Condition]) -> Iterator[str]:
    """The form of the rules."""
    yield f"max_clauses({MAX_RULES})."
    yield f"max_body({MAX_CONDITIONS})."
    yield "max_vars(1)."
    yield f"head_pred({head},1)."
    for one in conditions:
        yield f"body_pred({predicate(one)},1)."


def _facts(condition: Condition, examples: Examples) -> Iterator[str]:
    """Where a condition holds."""
    yield f"% {condition.text}"
    name = predicate(condition)
    for number in examples.simulations[condition.holds(examples)]:
        yield f"{name}({constant(number)})."


def _lines(lines: Iterator[str] | list[str]) -> str:
    return "\n".join(lines) + "\n"
