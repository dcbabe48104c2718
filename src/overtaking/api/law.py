"""Public functions that judge overtakes by traffic law; users import them from `overtaking.law`.

Each *rule* of a law has a *criterion*, whose method `check` takes a `Case` (recorded simulations
with their signals) and returns a `Finding` (for each simulation a verdict and a *margin*, the
distance to the limit, negative in a breach). A *pack* is the list of rules of one law; the package
has `pt` (Portugal) and `de` (Germany). A *policy*, such as `paper`, `default` or `strict`, names
the rules of a pack that a legal overtake must keep, and the amount by which the limit of each may
be exceeded. The *class* of a simulation, such as `Success_L` (completed, legal), therefore depends
on the policy. *Profile*: the named setting of road and traffic that a data set was drawn from; it
has a default policy.

A pack of the user, in a module of the user:

    from dataclasses import dataclass
    from overtaking import law

    @dataclass(frozen=True, kw_only=True)
    class OvertakingSpeed(law.Criterion):
        max_speed: law.Quantity
        unit: str = "m/s"

        def predicate(self) -> str:
            return f"During the manoeuvre: speed <= {self.max_speed}."

        def check(self, case: law.Case) -> law.Finding:
            # A margin at all frames of a span: from 3 s before the overtake to 3 s after it.
            margin = self.max_speed.f32 - case.signals.speed
            return law.finding_over_span(margin, law.manoeuvre(case))

    SLOW = law.Rule(
        id="my.1@2026",
        code="S1",
        article="none",
        title="Slowly",
        gloss="Overtake at no more than 25 m/s.",
        criterion=OvertakingSpeed(max_speed=law.quantity(25.0, "m/s", why="An example")),
        grade=law.Grade.LIGHT,
    )
    PACK = law.Pack(name="mine", version="mine-1", rules=(SLOW,))

`overtaking.label(trajectories, law=PACK)` and `overtaking label DATA --law module:PACK` apply it.
`code` names the rule in tables and policies; `article`, `title`, `gloss` and `grade` (the severity
of a breach) appear in reports, and so do the `predicate` and `unit` of the criterion. `id` and
`version` are stored with the verdicts, so that a reader knows which text of the rule decided them.
Their form is free; the packs of this package write the year of the law after "@".
"""

import importlib
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from overtaking.core.errors import ConfigError, check_choice
from overtaking.core.progress import ProgressCallback
from overtaking.labels.labelling import JudgedBatch, LabelledTrajectories, label
from overtaking.labels.law.judging import (
    LAWS,
    STORED_POLICIES,
    STORED_POLICY_NAMES,
    Policy,
    choose_policy,
)
from overtaking.labels.law.judging import policies_of_law as policies_of_package
from overtaking.labels.law.judging import undecidable_rules as undecidable_rules_of
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Pack
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.law_statistics import ToleranceCurve
    from overtaking.data.load import Dataset

    DatasetSource = Dataset | str | Path
    """A data set, or its folder or URL."""
else:
    # `overtaking.label` loads this module. Data sets need pandas and Arrow, which are slow to load,
    # so their type is known to type checkers only, and at run time any argument passes the check.
    DatasetSource = Any


def load_pack(law: str | Pack) -> Pack:
    """Load a pack of rules.

    Args:
        law: A pack, which is checked and returned; `pt` or `de`; or `module:NAME` for the variable
            NAME of a Python module that is installed or in the working folder. The module is
            executed.

    Raises:
        ConfigError: The module or pack does not exist, or the pack has no rules or two rules with
            the same code.
    """
    if isinstance(law, Pack):
        return _check_pack(law)
    if law in LAWS:
        return LAWS[law]
    module, colon, name = law.partition(":")
    if not (module and colon and name):
        raise _law_error(law, "pt, de, or MODULE:NAME", "another form")
    # At the end, so that installed modules come first. The folder stays in the list, because rules
    # may import other modules of the folder later.
    working_folder = str(Path.cwd())
    if working_folder not in sys.path:
        sys.path.append(working_folder)
    try:
        pack = getattr(importlib.import_module(module), name, None)
    except Exception as error:  # The module of another author may raise anything.
        raise _law_error(law, "a module that can be imported", f"{error!r}") from None
    if not isinstance(pack, Pack):
        raise _law_error(law, f"a Pack called {name}", type(pack).__name__)
    return _check_pack(pack)


def policies_for(pack: Pack, names: Sequence[str] | None = None) -> tuple[Policy, ...]:
    """Find the policies that can be applied to a pack.

    The packs of this package have policies of their own, found by the name of the pack. A pack of
    another name gets each Portuguese policy of which it has all rules, matched by code. If there is
    no such policy, a policy `all` requires every rule about a duty of the ego (the vehicle whose
    overtaking is studied).

    Args:
        pack: The pack. A pack of the user must not be called `pt` or `de`: it would get the
            policies of that law.
        names: Names of policies; None for the policies that data sets store (`paper`, `default` and
            `strict`), or for all policies of a pack of the user.

    Returns:
        The policies, in the order of `names`.

    Raises:
        ConfigError: The pack has no policy of such a name.
    """
    package_policies = policies_of_package(pack.name) if pack.name in LAWS else ()
    matching_policies = tuple(  # `STORED_POLICIES` are policies of the Portuguese law.
        policy for policy in STORED_POLICIES if set(policy.required) <= set(pack.codes)
    )
    duties_of_ego = tuple(rule.code for rule in pack.rules if rule.is_duty_of_ego)
    fallback = (Policy(name="all", required=duties_of_ego),)
    policies = package_policies or matching_policies or fallback
    if names is None:
        if not package_policies:
            return policies
        # `STORED_POLICY_NAMES` are the names of the policies that data sets store.
        return tuple(policy for policy in policies if policy.name in STORED_POLICY_NAMES)
    by_name = {policy.name: policy for policy in policies}
    for name in names:
        check_choice(name, by_name, what="policy", where=pack.name)
    return tuple(by_name[name] for name in names)


def _check_pack(pack: Pack) -> Pack:
    """Return the pack if it has rules and all their codes differ; else raise a `ConfigError`."""
    if not pack.rules or len({*pack.codes}) < len(pack.rules):
        codes = ", ".join(pack.codes) or "no rules"
        raise _law_error(pack.name, "one rule or more, each with a code of its own", codes)
    return pack


def _law_error(law: str, expected: str, got: str) -> ConfigError:
    """The error for a law that cannot be loaded."""
    return ConfigError(
        what="law",
        where=law,
        expected=expected,
        got=got,
        next_step="correct the name, or the module",
    )


DEFAULT_LAWS = ("pt", "de")
"""Laws that `compare` compares by default; the first is the default of the other functions."""


@check_arguments
def tolerance_curve(
    dataset: DatasetSource,
    *,
    law: str = DEFAULT_LAWS[0],
    policy: str | None = None,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> "ToleranceCurve":
    """Count the completed overtakes that would be legal with more and more tolerance.

    A tolerance is an amount by which a rule may be exceeded: a distance, a speed, or a duration.

    Args:
        dataset: The data set, or its folder or URL; it is not changed.
        law: `pt`, `de` or `module:NAME`, as in `load_pack`. For a `Pack` object use `judge`.
        policy: Name of a policy of the law; None for the default of the data set's profile.
        errors: Standard deviations of the positions [m] and speeds [m/s] that a recording states;
            None for exact ones. A rule is undecidable where its margin, positive or negative, is
            nearer to 0 than two standard errors of the margin, which the rule computes from these
            deviations.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Number of overtakes, of legal ones, and of legal ones by tolerance, for all rules together
        and rule by rule; `plot` draws it.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law_statistics import tolerance_curve as compute_curve
    from overtaking.api.datasets import load_dataset

    pack, source = load_pack(law), load_dataset(dataset)
    policy_name = choose_policy(policy, source.profile)  # Of the profile by default.
    (law_policy,) = policies_for(pack, [policy_name])
    batches = _judge_batches(source, [pack], [[law_policy]], errors, progress)
    return compute_curve(batches, pack, law_policy)


@check_arguments
def compare(
    dataset: DatasetSource,
    laws: Sequence[str] = DEFAULT_LAWS,
    *,
    policies: Sequence[str] = ("paper", "default", "strict", "serious", "enforced"),
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Judge the same overtakes by several laws, and find those on which the laws differ.

    Args:
        dataset: The data set, or its folder or URL; it is not changed.
        laws: Two or more laws, each `pt`, `de` or `module:NAME`, as in `load_pack`.
        policies: Names of policies, which every law must have. `serious` counts serious breaches
            only, `enforced` the breaches that are fined in practice.
        errors: As in `tolerance_curve`.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Counts of classes for each law and policy; and for each pair of laws the number of overtakes
        that are legal under one and illegal under the other, with the rules and some examples.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law_statistics import compare_laws
    from overtaking.api.datasets import load_dataset

    packs = [load_pack(law) for law in laws]
    law_policies = [policies_for(pack, policies) for pack in packs]
    batches = _judge_batches(load_dataset(dataset), packs, law_policies, errors, progress)
    return compare_laws(batches, packs, law_policies)


def _judge_batches(
    dataset: "Dataset",
    packs: Sequence[Pack],
    policies: Sequence[Sequence[Policy]],
    errors: MeasurementErrors | None,
    progress: ProgressCallback | None,
) -> Iterator[JudgedBatch]:
    """Label a data set by each law, one batch of simulations after the other.

    Args:
        dataset: The data set.
        packs: The packs of rules.
        policies: Policies of each pack, in the same order.
        errors: As in `tolerance_curve`.
        progress: Called with the number of simulations that are done, and of all.

    Yields:
        The simulations with their labels by each pack.
    """
    num_done = 0
    for simulation_ids, trajectories in dataset.batches():
        labelled = tuple(
            label(trajectories, pack=pack, policies=law_policies, errors=errors)
            for pack, law_policies in zip(packs, policies, strict=True)
        )
        yield JudgedBatch(simulation_ids, labelled)
        num_done += len(simulation_ids)
        if progress is not None:
            progress(num_done, len(dataset))


@check_arguments
def explain(
    dataset: DatasetSource,
    simulation_id: int,
    *,
    law: str = DEFAULT_LAWS[0],
    policies: Sequence[str] | None = None,
    rules: Sequence[str] | None = None,
    errors: MeasurementErrors | None = None,
) -> list[dict[str, Any]]:
    """Explain each verdict on one simulation in an English paragraph.

    Args:
        dataset: The data set, or its folder or URL.
        simulation_id: Number of the simulation in the data set, from 0.
        law: `pt`, `de` or `module:NAME`, as in `load_pack`.
        policies: Names of policies, as in `policies_for`.
        rules: Codes of the rules to explain; None for all.
        errors: As in `tolerance_curve`.

    Returns:
        A dictionary for each rule, broken rules first: `rule` (its code), `law`, `verdict`,
        `margin` (None if there is no value), `unit`, `text` and `paragraph`. `text` says how the
        wording of the law is known: `read` (in the provision itself), `secondary` (as others quote
        it) or `recalled` (from memory).

    Raises:
        ConfigError: There is no such law, policy, rule or simulation.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.api.datasets import load_dataset
    from overtaking.show.paragraphs import paragraphs

    pack = load_pack(law)
    for code in rules or ():
        check_choice(code, pack.codes, what="rule", where=pack.name)
    law_policies = policies_for(pack, policies)
    trajectories = load_dataset(dataset).trajectory(simulation_id)
    labelled = label(trajectories, pack=pack, policies=law_policies, errors=errors)
    # The paragraphs state the number of the simulation.
    explanations = paragraphs(labelled, simulation_id, pack, law_policies)
    return [row for row in explanations if rules is None or row["rule"] in rules]


def undecidable_rules(unknown: Iterable[str]) -> dict[str, list[str]]:
    """The rules of the Portuguese pack, the default of labels, that a recording cannot decide.

    Args:
        unknown: Names of quantities that the recording does not contain, such as `weather` or
            `indicators`: `Trajectories.unknown`.

    Returns:
        Codes of rules that are undecidable wherever they apply (`always`), and in some simulations
        (`sometimes`).
    """
    return undecidable_rules_of(PORTUGAL, unknown)


@check_arguments
def judge(
    dataset: DatasetSource,
    law: str | Pack,
    *,
    policies: Sequence[str] | None = None,
    out: str | Path | None = None,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> Iterator[tuple[NDArray[np.int64], LabelledTrajectories]]:
    """Judge a data set by another law or other policies than its own; the data set is not changed.

    Args:
        dataset: The data set, or its folder or URL.
        law: A pack of rules, `pt`, `de` or `module:NAME`, as in `load_pack`.
        policies: Names of policies, as in `policies_for`.
        out: Parquet file for the verdicts, complete when the caller has taken the last batch; None
            for no file.
        errors: As in `tolerance_curve`.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        An iterator over batches: the numbers of some simulations, shape (simulation,), and their
        labels. Each batch is computed when it is taken.

    Raises:
        ConfigError: The law or a policy does not exist.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.api.datasets import load_dataset
    from overtaking.data.verdicts import write_while_iterating

    source, pack = load_dataset(dataset), load_pack(law)
    law_policies = policies_for(pack, policies)

    # `judge` is no generator itself: a generator checks its arguments only at the first batch.
    judged = _judge_batches(source, [pack], [law_policies], errors, progress)
    batches = ((batch.simulation_ids, batch.labelled[0]) for batch in judged)
    return batches if out is None else write_while_iterating(batches, pack.name, Path(out))
