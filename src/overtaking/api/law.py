"""Rules of law, packs of rules, and the functions that rules call.

A rule is a function of a case, with its description; a pack is a list of rules:

    import numpy as np
    from overtaking import law

    def slow(case: law.Case) -> law.Finding:
        return law.always(np.float32(25.0) - case.signals.speed, law.manoeuvre(case))

    SLOW = law.Rule(
        id="my.1@2026",
        code="S1",
        law="none",
        title="Slowly",
        gloss="Overtake at no more than 25 m/s.",
        predicate="During the manoeuvre: speed <= 25 m/s.",
        unit="m/s",
        grade=law.Grade.LIGHT,
        check=slow,
    )
    PACK = law.Pack(name="mine", version="mine-1", rules=(SLOW,))

`overtaking.label(trajectories, law=PACK)` and `overtaking label DATA --law module:PACK` apply it.
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
from overtaking.labels.explain.explanation import case_of
from overtaking.labels.label import LabelledTrajectories, label
from overtaking.labels.law import (
    PACKS,
    PORTUGAL,
    Policy,
    choose_policy,
)
from overtaking.labels.law import lacking as rules_lacking
from overtaking.labels.law import policies_for as policies_of_package
from overtaking.labels.law.policies import POLICIES, STORED
from overtaking.labels.law.rule import (
    MeasurementErrors,
    Pack,
)
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.law.curve import Curve
    from overtaking.analysis.law.parting import Judged
    from overtaking.data.load import Dataset

    DatasetSource = Dataset | str | Path
else:
    DatasetSource = Any  # `label` loads this module without the module of data sets.


def load_pack(law: str | Pack) -> Pack:
    """Load a pack of rules.

    Args:
        law: A pack; `pt` for the Portuguese pack, `de` for the German one; or `module:NAME` of a
            pack in a Python module that is installed or in the working folder. The module is run.

    Raises:
        ConfigError: The module or pack does not exist, or two of its rules have the same code.
    """
    if isinstance(law, Pack):
        return _check_pack(law)
    if law in PACKS:
        return PACKS[law]
    module, colon, name = law.partition(":")
    if not (module and colon and name):
        raise _law_error(law, "pt, de, or MODULE:NAME", "another form")
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
    """The policies that decide about classes.

    A pack of this package has policies of its own. Another pack gets each Portuguese policy whose
    rules it has. Without such a policy it gets one, `all`, that requires every rule about a duty of
    the ego.

    Args:
        pack: The pack.
        names: Names of policies of the pack; None for the policies that data sets store.

    Raises:
        ConfigError: The pack has no policy of a name.
    """
    package_policies = policies_of_package(pack.name) if pack.name in PACKS else ()
    applicable = package_policies or tuple(
        policy for policy in POLICIES if {*policy.required} <= {*pack.codes}
    )
    duties = tuple(rule.code for rule in pack.rules if rule.of_ego)
    policies = applicable or (Policy(name="all", required=duties),)
    by_name = {policy.name: policy for policy in policies}
    if names is None:
        return tuple(policy for policy in policies if policy.name in STORED or not package_policies)
    for name in names:
        check_choice(name, by_name, what="policy", where=pack.name)
    return tuple(by_name[name] for name in names)


def _check_pack(pack: Pack) -> Pack:
    """The pack, after a check that it has rules and that their codes differ."""
    if not pack.rules or len({*pack.codes}) < len(pack.rules):
        codes = ", ".join(pack.codes) or "no rules"
        raise _law_error(pack.name, "one rule or more, each with a code of its own", codes)
    return pack


def _law_error(law: str, expected: str, got: str) -> ConfigError:
    return ConfigError(
        what="law",
        where=law,
        expected=expected,
        got=got,
        next_step="correct the name, or the module",
    )


DEFAULT_LAWS = ("pt", "de")
"""Laws that `compare` compares unless others are named."""


@check_arguments
def tolerance_curve(
    dataset: DatasetSource,
    *,
    law: str = DEFAULT_LAWS[0],
    policy: str | None = None,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> "Curve":
    """Count the completed overtakes that are legal as tolerances grow; nothing is written.

    Args:
        dataset: The data set, its folder or its URL.
        law: `pt`, `de` or `module:NAME`, as in `load_pack`.
        policy: Name of a policy of the law; None for the default of the profile.
        errors: As in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law.curve import curve
    from overtaking.api.datasets import load_dataset

    pack, source = load_pack(law), load_dataset(dataset)
    (law_policy,) = policies_for(pack, [choose_policy(policy, source.profile)])
    batches = _judge_batches(source, [pack], [[law_policy]], errors, progress)
    return curve(((verdicts[0], case) for _, case, verdicts in batches), pack, law_policy)


@check_arguments
def compare(
    dataset: DatasetSource,
    laws: Sequence[str] = DEFAULT_LAWS,
    *,
    policies: Sequence[str] = ("paper", "default", "strict", "serious", "enforced"),
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Judge the same overtakes by several laws and find where they differ; nothing is written.

    Args:
        dataset: The data set, its folder or its URL.
        laws: `pt`, `de` or `module:NAME` for each law, as in `load_pack`.
        policies: Names of policies that every law has.
        errors: As in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law.parting import compared
    from overtaking.api.datasets import load_dataset

    packs = [load_pack(law) for law in laws]
    law_policies = [policies_for(pack, policies) for pack in packs]
    batches = _judge_batches(load_dataset(dataset), packs, law_policies, errors, progress)
    return compared(batches, packs, law_policies)


def _judge_batches(
    dataset: "Dataset",
    packs: Sequence[Pack],
    policies: Sequence[Sequence[Policy]],
    errors: MeasurementErrors | None,
    progress: ProgressCallback | None,
) -> "Iterator[Judged]":
    """The labels of a data set by each law, batch by batch."""
    num_done = 0
    for numbers, trajectories in dataset.batches():
        labelled = [
            label(trajectories, pack=pack, policies=law_policies, errors=errors)
            for pack, law_policies in zip(packs, policies, strict=True)
        ]
        yield numbers, case_of(labelled[0]), labelled
        num_done += len(numbers)
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
    """Explain each verdict on one simulation in a paragraph.

    Args:
        dataset: The data set, its folder or its URL.
        simulation_id: Number of the simulation.
        law: `pt`, `de` or `module:NAME`, as in `load_pack`.
        policies: As in `label`.
        rules: Codes of the rules to explain; None for all.
        errors: As in `label`.

    Returns:
        A dictionary for each rule and policy, with the code of the rule and the paragraph; see
            `show.paragraphs.paragraphs`.

    Raises:
        ConfigError: There is no such law, policy or rule.
        DatasetError: There is no such simulation, or the data set is not complete, or damaged.
    """
    from overtaking.api.datasets import load_dataset
    from overtaking.show.paragraphs import paragraphs

    pack = load_pack(law)
    for code in rules or ():
        check_choice(code, pack.codes, what="rule", where=pack.name)
    law_policies = policies_for(pack, policies)
    trajectories = load_dataset(dataset).trajectory(simulation_id)
    labelled = label(trajectories, pack=pack, policies=law_policies, errors=errors)
    explanations = paragraphs(labelled, simulation_id, pack, law_policies)
    return [row for row in explanations if rules is None or row["rule"] in rules]


def undecidable_rules(unknown: Iterable[str]) -> dict[str, list[str]]:
    """The rules that a recording cannot decide.

    Args:
        unknown: Names of quantities that the recording does not contain: `Trajectories.unknown`.

    Returns:
        Codes of rules: `always` undecidable where they apply, or `sometimes`.
    """
    return rules_lacking(PORTUGAL, unknown)


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
    """Judge a data set by another law or other policies; the data set does not change.

    Args:
        dataset: The data set, or its folder.
        law: A pack of rules, `pt`, `de` or `module:NAME`, as in `load_pack`.
        policies: Names of policies, as in `label`.
        out: Parquet file of the verdicts, written while the caller takes the batches; None for no
            file.
        errors: Errors of measurement, as in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Returns:
        Numbers of simulations and their labels, batch by batch.

    Raises:
        ConfigError: The law or a policy does not exist.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.api.datasets import load_dataset
    from overtaking.data.verdicts import written

    source, pack = load_dataset(dataset), load_pack(law)
    law_policies = policies_for(pack, policies)

    def batches() -> Iterator[tuple[NDArray[np.int64], LabelledTrajectories]]:
        num_done = 0
        for numbers, trajectories in source.batches():
            yield numbers, label(trajectories, pack=pack, policies=law_policies, errors=errors)
            num_done += len(numbers)
            if progress is not None:
                progress(num_done, len(source))

    return batches() if out is None else written(batches(), pack.name, Path(out))
