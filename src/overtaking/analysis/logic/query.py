"""Queries of a data set: parse a condition, refuse an invalid one, and answer it.

A query is the body of a rule for the solver clingo: atoms and comparisons that hold together. An
atom is a predicate with its arguments, such as `target(S,2)`; capitals begin variables. The answers
are the values of the variables. For a misspelt constant clingo would return no answer, and
it would wrap a large number without a message, so both are refused before it runs.
"""

# clingo's syntax trees are typed as nodes of any kind.
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from itertools import permutations
from typing import TYPE_CHECKING, Any

from overtaking.analysis.logic.fact_files import (
    DEFAULT_FRAME_STEP,
    check_frame_step,
    pooled_facts,
)
from overtaking.analysis.logic.programs import (
    PREDICATES,
    argument_types,
    children,
    import_clingo,
    node_kind,
    overflows,
    parse_rules,
    possible_constants,
    rules_for_queries,
    rules_needed_by,
    term_range,
    variable_ranges,
    walk,
)
from overtaking.analysis.logic.reasoner import (
    MAX_ROWS,
    MEMORY_MIB,
    TIMEOUT_S,
    ProgramError,
    Reasoner,
)
from overtaking.analysis.logic.simulation_groups import read_groups
from overtaking.analysis.logic.vocabulary import MAX_INT, ArgumentType
from overtaking.core.equality import ContentEquality
from overtaking.core.errors import ConfigError
from overtaking.core.process_limits import remaining_answer_bytes
from overtaking.core.representation import ShownAsTable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pandas as pd

    from overtaking.analysis.logic.fact_files import RequestedFacts
    from overtaking.analysis.logic.vocabulary import Predicate
    from overtaking.core.arrays import I64
    from overtaking.core.progress import ProgressCallback
    from overtaking.data.load import Dataset

ANSWER_PREDICATE = "answer__"
"""The predicate that a query concludes. No predicate of `PREDICATES` ends with underscores."""

MAX_CHARACTERS = 2000
"""Longest query [characters].

A choice, far longer than any query that people write. It bounds the time of the checks in this
process, to which the time limit of the reasoner does not apply.
"""

MAX_DEPTH = 40
"""Deepest nesting of brackets in a query.

clingo's parser and `walk` call themselves for each level, and Python stops at 1,000 nested calls. A
choice, deeper than any query that people write; a depth of 400 still works.
"""

# Texts and patterns of checks. After `#` a query may have only the words in `_AGGREGATES`.
_WITHIN_MAX_INT = f"numbers up to {MAX_INT}, which is all that clingo's integers hold"
_AGGREGATES = ("count", "sum", "min", "max", "true", "false")
_STRING = re.compile(r'"(?:[^"\\\n]|\\.)*"')
_DIRECTIVE = re.compile(r"#\s*(\w*)")
_NUMBER = re.compile(r"\d+")
# Line, column and text of a message such as `<string>:2:5-9: error: syntax error`.
_ERROR_POSITION = re.compile(r":(\d+):(\d+)(?:-[\d:]+)?: error: (.*)", re.DOTALL)
_UNSAFE_VARIABLE = re.compile(r"'(\w+)' is unsafe")
# Longest part of a message of clingo that an error repeats [characters]: a choice, about a line.
_MAX_MESSAGE_LENGTH = 120
# Values of enumerations of clingo.ast. They are numbers here, because clingo is an optional package
# that this module must not import before the first query.
_NOT_EQUAL, _EQUAL = 4, 5  # ComparisonOperator
_SUMS = (1, 2)  # AggregateFunction: Sum and SumPlus
# Suggestions for a misspelt name: the largest number, and the smallest similarity by `difflib`,
# 0 to 1. Both are choices; the defaults of difflib are 3 and 0.6.
_MAX_SUGGESTIONS, _MIN_SIMILARITY = 3, 0.5

_MAX_SUMMED_VALUE = 2000
"""Largest value that a query may sum.

A sum of a million such values, one in each frame (`vocabulary.MAX_FRAME`), stays within 32 bits. A
sum over the frames of several vehicles or simulations may still leave them.
"""


@dataclass(frozen=True, slots=True)
class QueryVariable:
    """A variable of a query.

    Attributes:
        name: Its name.
        argument_type: Its type; None for a variable that is no argument of a predicate, such as
            `N` in `N = #count{…}`.
    """

    name: str
    argument_type: ArgumentType | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Query:
    """A valid query.

    Attributes:
        columns: Its variables, in the order in which they occur.
        requested_facts: The facts on which the answers may depend.
        program: The rules on which the answers may depend, and the query as a rule that concludes
            `ANSWER_PREDICATE`.
    """

    columns: tuple[QueryVariable, ...]
    requested_facts: RequestedFacts
    program: str


def parse_query(text: str) -> Query:
    """Parse a query: the body of a rule, in clingo's language.

    Args:
        text: Such as `overtakes(S,ego,P,F), collides(S,ego,_,_)`.

    Raises:
        ConfigError: The text is no condition, or the condition cannot be true.
        MissingExtraError: clingo is not installed.
    """
    condition = text.strip().removesuffix(".").strip()
    _check_text(condition)
    tree = _parse_condition(condition)
    types = _variable_types(tree)
    for term in overflows([tree.head, *tree.body], argument_types()):
        largest = f"{max(term.high, -term.low):.3g}"
        raise query_error(f"{term.text}, which may be {largest}", _WITHIN_MAX_INT)
    _check_sums(tree)
    names = list(answer_variables(tree.body))
    head = f"{ANSWER_PREDICATE}({','.join(names)})" if names else ANSWER_PREDICATE
    # The condition has lines of its own, as in `_parse_condition`, so that a column in clingo's
    # messages is a column of the query.
    rules = (*rules_for_queries(), *parse_rules(f"{head} :-\n{condition}\n."))
    any_values = (None,) * len(names)
    needed = rules_needed_by([(ANSWER_PREDICATE, any_values)], rules)
    return Query(
        columns=tuple(QueryVariable(name, types.get(name)) for name in names),
        requested_facts=needed.requested_facts,
        program=needed.program,
    )


def query_error(got: str, expected: str, next_step: str = "correct the query") -> ConfigError:
    """The error of an invalid query."""
    return ConfigError(what="query", where="ask", expected=expected, got=got, next_step=next_step)


def _check_text(text: str) -> None:
    """Refuse any text that could be more than a condition, before clingo reads it."""
    if not text:
        raise query_error("nothing", "a condition such as overtakes(S,A,B,F)")
    if len(text) > MAX_CHARACTERS:
        raise query_error(f"{len(text)} characters", f"at most {MAX_CHARACTERS} characters")
    unquoted = _STRING.sub('""', text)
    _check_depth(unquoted)
    _check_numbers(unquoted)
    for match in _DIRECTIVE.finditer(unquoted):
        if match[1] not in _AGGREGATES:
            raise query_error(
                f"#{match[1]} at column {match.start() + 1}", "no directive and no script"
            )
    for sign, meaning in (
        ("@", "an external function"),
        ("%", "a comment"),
        ("&", "a theory atom"),
    ):
        if sign in unquoted:
            raise query_error(f"{meaning} at column {unquoted.index(sign) + 1}", "a condition")


def _check_numbers(text: str) -> None:
    """Refuse numbers that clingo would wrap."""
    for match in _NUMBER.finditer(text):
        # The number of digits is compared first: Python refuses to convert very long numbers.
        if len(match[0]) > len(str(MAX_INT)) or int(match[0]) > MAX_INT:
            raise query_error(match[0], _WITHIN_MAX_INT)


def _check_depth(text: str) -> None:
    """Refuse brackets nested so deeply that a parser could fail."""
    depth = 0
    for character in text:
        # A bar of an absolute value `|X|` opens or closes it; both count as opening, to be safe.
        depth += (character in "([{|") - (character in ")]}")
        if depth > MAX_DEPTH:
            raise query_error("more", f"at most {MAX_DEPTH} brackets within each other")


def _parse_condition(condition: str) -> Any:
    """The condition as the body of one rule."""
    ast, messages, trees = import_clingo().ast, list[str](), list[Any]()
    try:
        ast.parse_string(
            f"{ANSWER_PREDICATE} :-\n{condition}\n.",
            trees.append,
            logger=lambda _, message: messages.append(message),
        )
    except RuntimeError:
        message = clingo_message(messages, condition)
        raise query_error(message, "a condition in clingo's language") from None
    # The parser adds a statement `#program base.`.
    rules = [tree for tree in trees if node_kind(tree) != "Program"]
    if len(rules) != 1 or node_kind(rules[0]) != "Rule":
        raise query_error(f"{len(rules)} statements", "one condition")
    return rules[0]


def clingo_message(messages: Iterable[str], condition: str) -> str:
    """The first error of clingo, with its column in the query.

    Args:
        messages: Messages of clingo about a rule whose first line is the head, and whose further
            lines are the condition.
        condition: The query.
    """
    lines = condition.splitlines()
    for message in messages:
        match = _ERROR_POSITION.search(message)
        if match is None:
            continue
        error = " ".join(match[3].split())
        row, column = int(match[1]) - 2, int(match[2])  # The head is in the line above.
        if row >= len(lines):
            return f"{error} at its end"
        position = f"column {column}" if len(lines) == 1 else f"line {row + 1}, column {column}"
        return f"{error} at {position}"
    return "an error"


def _variable_types(tree: Any) -> dict[str, ArgumentType]:
    """The type of each variable of a query, by the arguments at which it occurs.

    A variable at several arguments can only have constants that are possible at each of them.

    Raises:
        ConfigError: A predicate is unknown, an argument cannot be a constant, or a variable has
            two types.
    """
    types, first_atoms = dict[str, ArgumentType](), dict[str, str]()
    constants = dict[str, frozenset[str]]()
    for function in _functions(tree.body):
        predicate = _predicate_of(function)
        for position, (label, argument_type) in enumerate(predicate.arguments.items()):
            argument = function.arguments[position]
            possible = possible_constants().get((*predicate.signature, position), frozenset())
            argument_text = f"{label} in {predicate.signature_text}"
            if node_kind(argument) != "Variable":
                _check_constants(argument, argument_type, possible, argument_text)
            if node_kind(argument) != "Variable" or argument.name == "_":
                continue
            name = argument.name
            constants[name] = constants.get(name, possible) & possible
            if types.setdefault(name, argument_type) != argument_type:
                conflict = (
                    f"{name}, a {types[name].name} in {first_atoms[name]}, and a "
                    f"{argument_type.name} in {predicate.signature_text}"
                )
                raise query_error(conflict, "each variable to be one kind of thing")
            first_atoms.setdefault(name, predicate.signature_text)
    comparisons = [pair for pair in _compared_terms(tree.body) if pair[0] in types]
    for name, term in comparisons:
        _check_constants(term, types[name], constants[name], f"{name} in {first_atoms[name]}")
    return types


def _functions(trees: Any) -> Iterator[Any]:
    """The atoms of a query."""
    for tree in walk(trees):
        if node_kind(tree) == "SymbolicAtom":
            # A pool `p(1;2)` stands for several atoms, but the checks read single atoms. A minus
            # `-p(1)` is the opposite of an atom, which no program concludes.
            if node_kind(tree.symbol) != "Function":
                raise query_error(str(tree), "plain atoms, without pools and without minus")
            yield tree.symbol


def _predicate_of(function: Any) -> Predicate:
    """The predicate of an atom in a query.

    Raises:
        ConfigError: The predicate is unknown.
    """
    signature = function.name, len(function.arguments)
    if signature not in PREDICATES:
        raise _unknown_predicate(*signature, function.location.begin.column)
    return PREDICATES[signature]


def _unknown_predicate(name: str, arity: int, column: int) -> ConfigError:
    """The error of an unknown predicate, with the predicates of a similar name."""
    predicates = PREDICATES.values()
    names = [predicate.name for predicate in predicates]
    similar = difflib.get_close_matches(name, names, _MAX_SUGGESTIONS, _MIN_SIMILARITY)
    same_name = [predicate.signature_text for predicate in predicates if predicate.name == name]
    guesses = same_name or [
        predicate.signature_text for predicate in predicates if predicate.name in similar
    ]
    return query_error(
        f"{name} with {arity} argument{'' if arity == 1 else 's'} at column {column}",
        " or ".join(guesses[:_MAX_SUGGESTIONS]) or "a predicate of facts, theory or law",
        "see: overtaking ask --predicates",
    )


def _alternatives(term: Any) -> Iterator[Any]:
    """The alternatives of a pool such as `(l1;l2)`; the term itself if it is no pool."""
    if node_kind(term) == "Pool":
        for part in term.arguments:
            yield from _alternatives(part)
    else:
        yield term


def _compared_terms(trees: Any) -> Iterator[tuple[str, Any]]:
    """Each variable that is compared by `=` or `!=`, with the term on the other side."""
    for tree in walk(trees):
        # Each term after the first is a guard; a chain such as `0 < X <= 3` has several guards. By
        # choice chains are left out: a misspelt constant in a chain is not reported.
        if node_kind(tree) == "Comparison" and len(tree.guards) == 1:
            (guard,) = tree.guards
            sides = (tree.term, guard.term) if guard.comparison in (_NOT_EQUAL, _EQUAL) else ()
            for side, opposite in permutations(sides, 2):
                if node_kind(side) == "Variable":
                    yield side.name, opposite


def _check_constants(
    term: Any, argument_type: ArgumentType, possible: frozenset[str], argument_text: str
) -> None:
    """Call `_check_constant` for each alternative of a pool, or for the term itself."""
    for alternative in _alternatives(term):
        _check_constant(alternative, argument_type, possible, argument_text)


def _check_constant(
    term: Any, argument_type: ArgumentType, possible: frozenset[str], argument_text: str
) -> None:
    """Refuse a constant that an argument can never have.

    Args:
        term: The argument, or the term with which its variable is compared.
        argument_type: Type of the argument.
        possible: Constants that the argument can have.
        argument_text: Label of the argument and its atom, for the message.

    Raises:
        ConfigError: The constant is impossible.
    """
    # The value of a term with a variable is not known before the query runs.
    if any(node_kind(part) == "Variable" for part in walk([term])):
        return
    if argument_type.constants:
        if str(term) not in possible:
            names = [name for name in argument_type.constants if name in possible]
            ordered = _nearest_first(str(term), names)
            raise query_error(str(term), f"{argument_text} to be one of {', '.join(ordered)}")
        return
    if str(term) == "ego":  # The programs define it as 0.
        return
    is_symbol = (
        node_kind(term) == "SymbolicTerm" and term.symbol.type != import_clingo().SymbolType.Number
    )
    if is_symbol or node_kind(term) == "Function":
        raise query_error(str(term), f"{argument_text} to be a number, {argument_type.meaning}")
    low, high = term_range(term, {})
    if high < argument_type.low or low > argument_type.high:
        expected_range = f"{argument_type.low} to {argument_type.high}, {argument_type.meaning}"
        raise query_error(str(term), f"{argument_text} to be {expected_range}")


def _nearest_first(unknown_name: str, names: list[str]) -> list[str]:
    """The names, beginning with the names that resemble `unknown_name`."""
    similar = difflib.get_close_matches(
        unknown_name.lower(), names, _MAX_SUGGESTIONS, _MIN_SIMILARITY
    )
    return [*similar, *(name for name in names if name not in similar)]


def answer_variables(trees: Any) -> Iterator[str]:
    """The variables outside of aggregates and conditions, each once, in order.

    Variables that occur only in negated literals are left out, because no atom binds them. So is
    the anonymous variable `_`.
    """
    names = {"_"}
    for tree in trees:
        is_negated = node_kind(tree) == "Literal" and tree.sign
        for name in () if is_negated else _variables_in(tree):
            if name not in names:
                names.add(name)
                yield name


def _variables_in(tree: Any) -> Iterator[str]:
    """The variables of a literal, without the local variables of an aggregate."""
    if node_kind(tree) == "Variable":
        yield tree.name
    elif node_kind(tree) == "BodyAggregate":
        for guard in (tree.left_guard, tree.right_guard):
            if guard is not None:
                yield from _variables_in(guard.term)
    elif node_kind(tree) not in ("ConditionalLiteral", "Aggregate"):
        for part in children(tree):
            yield from _variables_in(part)


def _check_sums(tree: Any) -> None:
    """Refuse sums of large numbers: over all frames they could wrap."""
    ranges = variable_ranges([tree.head, *tree.body], argument_types())
    for part in walk(tree.body):
        if node_kind(part) == "BodyAggregate" and part.function in _SUMS:
            for element in part.elements:
                # clingo sums the first term; the others only distinguish the summed elements.
                low, high = term_range(element.terms[0], ranges) if element.terms else (0, 0)
                if max(-low, high) > _MAX_SUMMED_VALUE:
                    expected = f"sums of numbers up to {_MAX_SUMMED_VALUE}"
                    raise query_error(str(part), expected)


AnswerValue = int | str
"""A number, or the name of a constant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers(ShownAsTable, ContentEquality):
    """The answers to a query.

    Attributes:
        columns: The variables of the query.
        rows: For each answer the values of the variables, in the order of `columns`.
        is_cut: Whether answers beyond the limit were left out.
        num_simulations: Number of simulations that were queried; fewer than requested if the query
            ended at the limit.
        frame_interval_ms: Time between two frames [ms].
    """

    columns: tuple[QueryVariable, ...]
    rows: list[tuple[AnswerValue, ...]]
    is_cut: bool
    num_simulations: int
    frame_interval_ms: int

    def to_pandas(self) -> pd.DataFrame:
        """The rows as a DataFrame with a column for each variable."""
        import pandas as pd

        return pd.DataFrame(self.rows, columns=[column.name for column in self.columns])


def ask(
    dataset: Dataset,
    query: str,
    *,
    simulation_ids: I64 | None = None,
    frame_step: int = DEFAULT_FRAME_STEP,
    max_rows: int = MAX_ROWS,
    timeout_s: float = TIMEOUT_S,
    memory_mib: int = MEMORY_MIB,
    progress: ProgressCallback | None = None,
) -> Answers:
    """Answer a query of a data set, one group of simulations after the other.

    Args:
        dataset: The data set.
        query: A condition on the predicates of facts, theory and law, in clingo's language.
        simulation_ids: Numbers of the simulations in order; None for all.
        frame_step: Interval between the frames with positions [frames], as in an export.
        max_rows: Most answers.
        timeout_s: Time limit of the reasoner [s].
        memory_mib: Memory limit [MiB]; the answers may take an eighth of it, a choice: this process
            holds them several times, as rows and in formatted text.
        progress: Called with the numbers of finished and of requested simulations.

    Raises:
        ConfigError: The query is invalid, or exceeds its time or memory.
        DatasetError: A file of the data set is damaged.
        MissingExtraError: clingo is not installed.
    """
    check_frame_step(frame_step)
    parsed = parse_query(query)
    rows: list[tuple[AnswerValue, ...]] = []
    num_requested = len(dataset) if simulation_ids is None else len(simulation_ids)
    num_simulations, frame_interval_ms, bytes_left = 0, 0, None
    with Reasoner(
        parsed.program,
        ((ANSWER_PREDICATE, len(parsed.columns)),),
        max_rows=max_rows,
        timeout_s=timeout_s,
        memory_mib=memory_mib,
    ) as reasoner:
        for group in read_groups(dataset, simulation_ids):
            frame_interval_ms = group.case.signals.frame_interval_ms
            # A pool is a short way to write several facts, `night(3;7)`. Each fact names its
            # simulation, so atoms that share the variable `S` are about one simulation. Atoms with
            # different variables combine only simulations of the same group.
            facts = pooled_facts(group, parsed.requested_facts, frame_step)
            group_rows = _solve_group(reasoner, facts)
            bytes_left = remaining_answer_bytes(bytes_left, group_rows, "ask", memory_mib)
            rows += group_rows
            num_simulations += len(group.simulation_ids)
            if progress is not None:
                progress(num_simulations, num_requested)
            if len(rows) > max_rows:  # The reasoner returns up to `max_rows + 1` rows of a group.
                break
    return Answers(
        columns=parsed.columns,
        rows=rows[:max_rows],
        is_cut=len(rows) > max_rows,
        num_simulations=num_simulations,
        frame_interval_ms=frame_interval_ms,
    )


def _solve_group(reasoner: Reasoner, facts: bytes) -> list[tuple[AnswerValue, ...]]:
    """The answers of one group, sorted; numbers before names."""
    try:
        rows = [tuple(row) for row in reasoner.solve(facts)]
    except ProgramError as error:
        message = str(error)
        unsafe_names = list(dict.fromkeys(_UNSAFE_VARIABLE.findall(message)))
        if unsafe_names:
            unbound = f"{', '.join(unsafe_names)}, to which no atom gives a value"
            raise query_error(unbound, "every variable in an atom that is not negated") from None
        short_message = " ".join(message.split())[:_MAX_MESSAGE_LENGTH]
        raise query_error(short_message, "one that clingo can answer") from None
    return sorted(rows, key=lambda row: [(isinstance(value, str), value) for value in row])
