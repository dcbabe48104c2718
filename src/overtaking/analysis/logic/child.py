"""Clingo in a worker process, with limits that a program cannot exceed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import clingo

from overtaking.core.process_limits import limit_process

if TYPE_CHECKING:
    from overtaking.core.worker_process import ParentConnection


def main(parent: ParentConnection) -> None:
    """Answer groups of facts. The first message is what `_rows` needs, each further one facts.

    The answers are dictionaries, with `rows` or with `error`, after which the process ends.
    """
    messages = iter(parent)
    asked = next(messages)
    limit_process(asked["memory_mib"], open_files=3)  # Standard input, output and error are open.
    for facts in messages:
        answer = _answer(asked, facts)
        parent.send(answer)
        if "error" in answer:
            return


def _answer(asked: dict[str, Any], facts: bytes) -> dict[str, Any]:
    said: list[str] = []
    try:
        return {"rows": _rows(asked, facts.decode(), said)}
    except MemoryError:
        return {"error": "memory"}
    except RuntimeError as error:
        return {"error": "memory" if "bad_alloc" in str(error) else "program", "said": said}


def _rows(asked: dict[str, Any], facts: str, said: list[str]) -> list[list[Any]]:
    """The arguments of all atoms of the predicates that are asked for."""
    control = clingo.Control(logger=lambda _, line: said.append(line))
    control.add("base", [], asked["program"])
    control.add("base", [], facts)
    control.ground([("base", [])])
    rows: list[list[Any]] = []
    for name, arity in asked["predicates"]:
        for atom in control.symbolic_atoms.by_signature(name, arity):
            rows.append([_value(one) for one in atom.symbol.arguments])
            if len(rows) > asked["max_rows"]:
                return rows
    return rows


def _value(symbol: Any) -> Any:
    """A number or a name; of a tuple the list, of a function the list with its name first."""
    if symbol.type == clingo.SymbolType.Number:
        return symbol.number
    if symbol.type == clingo.SymbolType.Function and symbol.arguments:
        rest = [_value(one) for one in symbol.arguments]
        return [symbol.name, *rest] if symbol.name else rest
    return str(symbol) if symbol.type != clingo.SymbolType.Function or symbol.name else []
