"""Queries of a data set in logic, and proofs from the law."""

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any

import typer

from overtaking.cli import options
from overtaking.cli.output import Output
from overtaking.core.errors import ConfigError
from overtaking.core.representation import format_count

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.console import Group

    from overtaking.analysis.logic.proof import Proof, ProofStep
    from overtaking.analysis.logic.query import Answers

Query = Annotated[
    str | None, typer.Argument(metavar="[QUERY]", help="Condition in clingo's language, in quotes.")
]
Why = Annotated[
    int | None, options.option("--why N", "Prove which rules simulation N breaks.", min=0)
]
Words = Annotated[bool, options.option("--predicates", "List the predicates.")]
Rows = Annotated[int, options.option("--rows N", options.ROWS, min=1)]
Seconds = Annotated[float, options.option("--timeout S", options.TIMEOUT)]
Memory = Annotated[int, options.option("--memory MIB", options.MEMORY, min=16)]

_INDENT = 2
_MS_PER_S = 1000.0


def ask(
    output: Output,
    data: options.Data,
    chosen: options.Chosen,
    query: Query = None,
    why: Why = None,
    predicates: Words = False,
    rows: Rows = 1000,
    timeout_s: Seconds = 600.0,
    memory_mib: Memory = 2048,
) -> None:
    """Query simulations in logic, or prove why one is illegal."""
    from overtaking.api import logic
    from overtaking.cli import arguments
    from overtaking.cli.tables import drawn_rows

    _check_one(query, why, predicates)
    if predicates:
        entries = list(_predicates())
        cells = [(entry["predicate"], entry["from"], entry["meaning"]) for entry in entries]
        header = ("predicate", "from", "meaning")
        output.result({"predicates": entries}, lambda _: drawn_rows(header, cells))
    elif why is not None:
        proofs = logic.prove(data, why)
        found = {"simulation": why, "proofs": [_proof(one) for one in proofs]}
        output.text(found, _proofs_page(why, proofs))
    else:
        given = arguments.chosen(chosen, "ask")
        given |= {"max_rows": rows, "timeout_s": timeout_s, "memory_mib": memory_mib}
        with output.progress("simulations") as meter:
            answers = logic.ask(data, str(query), progress=meter, **given)
        if answers.is_cut:
            output.say(f"there are more answers than these {rows}; --rows gives more")
        values = values_of(answers)
        output.result(values, lambda _: render(values))


def _check_one(query: str | None, why: int | None, predicates: bool) -> None:
    if (query is not None) + (why is not None) + predicates != 1:
        raise ConfigError(
            what="question",
            where="ask",
            expected="a query, --why N or --predicates",
            got="none" if query is None else "several",
            next_step='ask for one, such as "overtakes(S,ego,P,F)"',
        )


def values_of(answers: "Answers") -> dict[str, Any]:
    """The answers as plain values."""
    return {
        "columns": [
            {"name": column.name, "type": column.argument_type and column.argument_type.name}
            for column in answers.columns
        ],
        "rows": [list(row) for row in answers.rows],
        "is_cut": answers.is_cut,
        "simulations_asked": answers.num_simulations,
        "frame_interval_ms": answers.frame_interval_ms,
    }


def render(values: dict[str, Any]) -> "Group":
    """The answers as a table, frames with their times."""
    from rich.console import Group
    from rich.text import Text

    from overtaking.cli.tables import drawn_rows

    columns, interval_ms = values["columns"], values["frame_interval_ms"]
    rows = [
        [_cell(one, of["type"], interval_ms) for one, of in zip(row, columns, strict=True)]
        for row in values["rows"]
    ]
    asked = format_count(values["simulations_asked"], "simulation")
    line = Text(f"{format_count(len(rows), 'answer')} of {asked}")
    header = [one["name"] + (f" ({one['type']})" if one["type"] else "") for one in columns]
    return Group(drawn_rows(header, rows), line) if columns and rows else Group(line)


def _cell(value: Any, kind: str | None, interval_ms: int) -> str:
    """A value; a frame with its time."""
    if kind == "frame":
        return f"{value} ({value * interval_ms / _MS_PER_S:.2f} s)"
    if kind == "vehicle" and value == 0:
        return "0 (ego)"
    return str(value)


def _predicates() -> "Iterator[dict[str, Any]]":
    """Every predicate with its origin."""
    from overtaking.analysis.logic.fact_files import FACTS
    from overtaking.analysis.logic.programs import LAW_PREDICATES, THEORY_PREDICATES

    groups = (("fact", FACTS.values()), ("theory", THEORY_PREDICATES), ("law", LAW_PREDICATES))
    for source, predicates in groups:
        for predicate in predicates:
            yield {
                "predicate": predicate.signature_text,
                "from": source,
                "meaning": predicate.meaning,
                "arguments": [
                    {"name": label, "type": argument_type.name}
                    for label, argument_type in predicate.arguments.items()
                ],
            }


def _proof(proof: "Proof") -> dict[str, Any]:
    """A proof as plain values."""
    from overtaking.analysis.logic.proof import title_of

    return {"title": title_of(proof.rule), **dataclasses.asdict(proof)}


def _proofs_page(simulation: int, proofs: "tuple[Proof, ...]") -> str:
    """All proofs as text; a step that occurs again is not repeated."""
    from overtaking.analysis.logic.proof import title_of
    from overtaking.analysis.logic.vocabulary import RULE_CODES

    if not proofs:
        return f"Simulation {simulation} breaks none of {', '.join(RULE_CODES)}.\n"
    printed_atoms: set[str] = set()
    lines: list[str] = []
    for proof in proofs:
        frames = f"frames {proof.first_frame} to {proof.last_frame}, {proof.num_frames} in all"
        if proof.num_frames == 1:
            frames = f"frame {proof.first_frame}"
        lines += [
            f"{title_of(proof.rule)}: broken in {frames}",
            *_steps(proof.step, 1, printed_atoms),
            "",
        ]
    return "\n".join(lines)


def _steps(step: "ProofStep", depth: int, printed_atoms: set[str]) -> "Iterator[str]":
    """A step and all that it rests on, a line each."""
    indent, inner = " " * (_INDENT * depth), " " * (_INDENT * (depth + 1))
    if step.atom in printed_atoms:
        yield f"{indent}{step.sentence} (as above)"
        return
    printed_atoms.add(step.atom)
    more = f" (and so for {step.num_skipped} before)" if step.num_skipped else ""
    yield f"{indent}{step.sentence}{more}"
    for text in step.facts:
        yield f"{inner}fact: {text}"
    if step.conditions:
        yield f"{inner}where {'; '.join(step.conditions)}"
    if step.absent_literals:
        yield f"{inner}and {'; '.join(step.absent_literals)}"
    for premise in step.premises:
        yield from _steps(premise, depth + 1, printed_atoms)
