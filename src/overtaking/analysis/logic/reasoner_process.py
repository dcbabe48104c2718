"""clingo in a worker process, with limits that a program cannot exceed.

clingo grounds a program: it replaces the variables of each rule by values, and thus finds the atoms
that follow. An atom is a predicate with its arguments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypedDict

import clingo

from overtaking.core.process_limits import limit_process

if TYPE_CHECKING:
    from overtaking.core.worker_process import ParentConnection


class ReasonerSettings(TypedDict):
    """The first message to the process.

    Attributes:
        program: Rules.
        predicates: Name and number of arguments of the predicates whose atoms are returned.
        max_rows: Largest number of rows of a group. At most `max_rows + 1` rows are returned, so
            that the parent sees that there are more.
        memory_mib: Memory limit [MiB].
    """

    program: str
    predicates: tuple[tuple[str, int], ...]
    max_rows: int
    memory_mib: int


def main(parent: ParentConnection) -> None:
    """Answer groups of facts.

    The first message is a `ReasonerSettings`, each later message has the facts of one group. An
    answer is a dictionary with `rows`, or with `error`, after which the process ends.
    """
    messages = iter(parent)
    settings: ReasonerSettings = next(messages)
    limit_process(settings["memory_mib"], open_files=3)  # Standard input, output and error.
    for facts in messages:
        answer = _answer(settings, facts)
        parent.send(answer)
        if "error" in answer:
            return


def _answer(settings: ReasonerSettings, facts: bytes) -> dict[str, Any]:
    """The rows that follow from the facts, or the error."""
    messages: list[str] = []
    try:
        return {"rows": _solve(settings, facts.decode(), messages)}
    except MemoryError:
        return {"error": "memory"}
    except RuntimeError as error:
        # clingo reports a failed allocation of C++ as a `RuntimeError`.
        kind = "memory" if "bad_alloc" in str(error) else "program"
        return {"error": kind, "messages": messages}


def _solve(settings: ReasonerSettings, facts: str, messages: list[str]) -> list[list[Any]]:
    """The arguments of all atoms of the predicates; clingo's messages are added to `messages`."""
    control = clingo.Control(logger=lambda _, message: messages.append(message))
    control.add("base", [], settings["program"])
    control.add("base", [], facts)
    # The programs have no choices, so all atoms are known after grounding.
    control.ground([("base", [])])
    rows: list[list[Any]] = []
    for name, arity in settings["predicates"]:
        for atom in control.symbolic_atoms.by_signature(name, arity):
            rows.append([_plain_value(argument) for argument in atom.symbol.arguments])
            if len(rows) > settings["max_rows"]:
                return rows
    return rows


def _plain_value(symbol: Any) -> Any:
    """A number or a name; a tuple as a list, a function as a list with its name first."""
    if symbol.type == clingo.SymbolType.Number:
        return symbol.number
    if symbol.type == clingo.SymbolType.Function and symbol.arguments:
        arguments = [_plain_value(argument) for argument in symbol.arguments]
        return [symbol.name, *arguments] if symbol.name else arguments
    is_empty_tuple = symbol.type == clingo.SymbolType.Function and not symbol.name
    return [] if is_empty_tuple else str(symbol)
