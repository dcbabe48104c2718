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

LAWS = ("pt", "de")
"""Laws that `compare` compares unless others are named."""


@check_arguments
def tolerance_curve(
    data: str | Path,
    *,
    law: str = LAWS[0],
    policy: str | None = None,
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> "Curve":
    """Count the completed overtakes that are legal as tolerances grow; nothing is written.

    Args:
        data: Folder of a data set, or its URL.
        law: What `rules.load_pack` takes.
        policy: Name of a policy of the law; None for the default of the profile.
        errors: As in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law.curve import curve

    pack, source = load_pack(law), load_dataset(data)
    (law_policy,) = policies_for(pack, [choose_policy(policy, source.profile)])
    judged = _judged(source, [pack], [[law_policy]], errors, progress)
    return curve(((verdicts[0], case) for _, case, verdicts in judged), pack, law_policy)


@check_arguments
def compare(
    data: str | Path,
    laws: Sequence[str] = LAWS,
    *,
    policies: Sequence[str] = ("paper", "default", "strict", "serious", "enforced"),
    errors: MeasurementErrors | None = None,
    progress: ProgressCallback | None = None,
) -> dict[str, Any]:
    """Judge the same overtakes by several laws and find where they differ; nothing is written.

    Args:
        data: Folder of a data set, or its URL.
        laws: What `rules.load_pack` takes, for each law.
        policies: Names of policies that every law has.
        errors: As in `label`.
        progress: Called with the number of simulations that are done, and of all.

    Raises:
        ConfigError: There is no such law or policy.
        DatasetError: The data set is not complete, or damaged.
    """
    from overtaking.analysis.law.parting import compared

    packs = [load_pack(one) for one in laws]
    chosen = [policies_for(pack, policies) for pack in packs]
    return compared(_judged(load_dataset(data), packs, chosen, errors, progress), packs, chosen)


def _judged(
    data: Dataset,
    packs: Sequence[Pack],
    policies: Sequence[Sequence[Policy]],
    errors: MeasurementErrors | None,
    progress: ProgressCallback | None,
) -> "Iterator[Judged]":
    """A data set under each law, batch by batch."""
    done = 0
    for numbers, run in data.batches():
        said = [
            label(run, pack=pack, policies=of, errors=errors)
            for pack, of in zip(packs, policies, strict=True)
        ]
        yield numbers, case_of(said[0]), said
        done += len(numbers)
        if progress is not None:
            progress(done, len(data))


@check_arguments
def explain(
    data: str | Path,
    simulation: int,
    *,
    law: str = LAWS[0],
    policies: Sequence[str] | None = None,
    rules: Sequence[str] | None = None,
    errors: MeasurementErrors | None = None,
) -> list[dict[str, Any]]:
    """Explain each verdict on one simulation in a paragraph.

    Args:
        data: Folder of a data set, or its URL.
        simulation: Its number.
        law: What `rules.load_pack` takes.
        policies: As in `label`.
        rules: Codes of the rules to tell of; None for all.
        errors: As in `label`.

    Returns:
        What `show.paragraphs.paragraphs` returns.

    Raises:
        ConfigError: There is no such law, policy or rule.
        DatasetError: There is no such simulation, or the data set is not complete, or damaged.
    """
    from overtaking.show.paragraphs import paragraphs

    pack = load_pack(law)
    for code in rules or ():
        check_choice(code, pack.codes, what="rule", where=pack.name)
    chosen = policies_for(pack, policies)
    run = load_dataset(data).trajectory(simulation)
    labelled = label(run, pack=pack, policies=chosen, errors=errors)
    told = paragraphs(labelled, simulation, pack, chosen)
    return [one for one in told if rules is None or one["rule"] in rules]
