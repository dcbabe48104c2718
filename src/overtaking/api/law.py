"""The law over many overtakes: the effect of tolerances, and two laws compared."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from overtaking.api.data import load_dataset
from overtaking.api.rules import load_pack, policies_for
from overtaking.core.errors import check_choice
from overtaking.core.progress import ProgressCallback
from overtaking.data.load import Dataset
from overtaking.labels.explain.explanation import case_of
from overtaking.labels.label import label
from overtaking.labels.law import MeasurementErrors, Pack, Policy, choose_policy
from overtaking.model.checks import check_arguments

if TYPE_CHECKING:
    from overtaking.analysis.law.curve import Curve
    from overtaking.analysis.law.parting import Judged

DEFAULT_LAWS = ("pt", "de")
"""Laws that `compare` compares unless others are named."""


@check_arguments
def tolerance_curve(
    dataset: str | Path,
    *,
    law: str = DEFAULT_LAWS[0],
    policy: str | None = None,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> "Curve":
    """Count the completed overtakes that are legal as tolerances grow; nothing is written.

    Args:
        dataset: Folder of a data set, or its URL.
        law: `pt`, `de` or `module:NAME`, as in `load_pack`.
        policy: Name of a policy of the law; None for the default of the profile.
        errors: As in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law.curve import curve

    pack, source = load_pack(law), load_dataset(dataset)
    (law_policy,) = policies_for(pack, [choose_policy(policy, source.profile)])
    batches = _judge_batches(source, [pack], [[law_policy]], errors, progress)
    return curve(((verdicts[0], case) for _, case, verdicts in batches), pack, law_policy)


@check_arguments
def compare(
    dataset: str | Path,
    laws: Sequence[str] = DEFAULT_LAWS,
    *,
    policies: Sequence[str] = ("paper", "default", "strict", "serious", "enforced"),
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Judge the same overtakes by several laws and find where they differ; nothing is written.

    Args:
        dataset: Folder of a data set, or its URL.
        laws: `pt`, `de` or `module:NAME` for each law, as in `load_pack`.
        policies: Names of policies that every law has.
        errors: As in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law.parting import compared

    packs = [load_pack(law) for law in laws]
    law_policies = [policies_for(pack, policies) for pack in packs]
    batches = _judge_batches(load_dataset(dataset), packs, law_policies, errors, progress)
    return compared(batches, packs, law_policies)


def _judge_batches(
    dataset: Dataset,
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
    dataset: str | Path,
    simulation_id: int,
    *,
    law: str = DEFAULT_LAWS[0],
    policies: Sequence[str] | None = None,
    rules: Sequence[str] | None = None,
    errors: MeasurementErrors | None = None,
) -> list[dict[str, Any]]:
    """Explain each verdict on one simulation in a paragraph.

    Args:
        dataset: Folder of a data set, or its URL.
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
    from overtaking.show.paragraphs import paragraphs

    pack = load_pack(law)
    for code in rules or ():
        check_choice(code, pack.codes, what="rule", where=pack.name)
    law_policies = policies_for(pack, policies)
    trajectories = load_dataset(dataset).trajectory(simulation_id)
    labelled = label(trajectories, pack=pack, policies=law_policies, errors=errors)
    explanations = paragraphs(labelled, simulation_id, pack, law_policies)
    return [row for row in explanations if rules is None or row["rule"] in rules]
