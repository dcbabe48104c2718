"""The reasoner in a process of its own, with bounds that a program cannot leave.

Run as `python -P -m overtaking.logic.child`, it reads a program and then facts, group by group, and
answers each group with one line of JSON. It can write no file and open none, and ends with its
standard input.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from overtaking.core.confinement import confine


def main() -> None:
    """Answer groups until there are no more."""
    import clingo

    asked = json.loads(sys.stdin.buffer.readline())
    confine(int(asked["memory_mib"]), open_files=3)  # Standard input, output and error are open.
    while size := sys.stdin.buffer.readline():
        facts = sys.stdin.buffer.read(int(size)).decode()
        said: list[str] = []
        try:
            answer: dict[str, Any] = {"rows": _rows(clingo, asked, facts, said)}
        except MemoryError:
            answer = {"error": "memory"}
        except RuntimeError as error:
            is_memory = "bad_alloc" in str(error)
            answer = {"error": "memory" if is_memory else "program", "said": said}
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
        if "error" in answer:
            break


def _rows(clingo: Any, asked: dict[str, Any], facts: str, said: list[str]) -> list[list[Any]]:
    """The arguments of all atoms of the predicates that are asked for, after their names."""
    control = clingo.Control(logger=lambda _, line: said.append(line))
    control.add("base", [], asked["program"])
    control.add("base", [], facts)
    control.ground([("base", [])])
    rows: list[list[Any]] = []
    for name, arity in asked["predicates"]:
        for atom in control.symbolic_atoms.by_signature(name, arity):
            rows.append([_value(clingo, one) for one in atom.symbol.arguments])
            if len(rows) > asked["max_rows"]:
                return rows
    return rows


def _value(clingo: Any, symbol: Any) -> Any:
    """A number, a name, or the list of a tuple; of a function its name before its arguments."""
    if symbol.type == clingo.SymbolType.Number:
        return symbol.number
    if symbol.type == clingo.SymbolType.Function and symbol.arguments:
        rest = [_value(clingo, one) for one in symbol.arguments]
        return [symbol.name, *rest] if symbol.name else rest
    return str(symbol) if symbol.type != clingo.SymbolType.Function or symbol.name else []


if __name__ == "__main__":
    main()
