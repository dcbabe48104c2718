"""The report on a data set: its features, its origin, and its simulations as examples."""

from pathlib import Path

from overtaking.data.load import Dataset
from overtaking.labels.labelling import LabelledTrajectories, label
from overtaking.labels.law.judging import choose_policy
from overtaking.show.report.learned import learn
from overtaking.show.report.write import Progress, Report, write_report

FOLDER = "report"
"""Where a report lies in the folder of its data set."""

_SHOWN_DIGITS = 16  # Of a hash: enough to compare, short enough to read.


def report_on(
    data: Dataset,
    out: Path | None = None,
    *,
    policy: str | None = None,
    reading: str | None = None,
    weighted: bool = False,
    is_learned: bool = False,
    progress: Progress | None = None,
) -> Report:
    """Write the report on a data set.

    Args:
        data: The data set.
        out: Folder of the report, that of the data set by default.
        policy: Which rules decide about the class; None for the default of the profile.
        reading: How features are measured.
        weighted: Whether to count each simulation by its importance weight.
        is_learned: Whether to learn rules and factors, and tell them.
        progress: Called with the number of parts that are done, and of all.

    Raises:
        ConfigError: There is no such policy or reading.
        DatasetError: A file is damaged.
        OSError: A file cannot be written.
    """
    policy = choose_policy(policy, data.profile)

    def example(simulation: int) -> LabelledTrajectories:
        return label(data.trajectory(simulation))

    return write_report(
        data.features(policy, reading=reading),
        data.path / FOLDER if out is None else out,
        title=f"Overtaking in {data.profile}",
        facts=facts_of(data),
        policy=policy,
        reading=reading,
        weighted=weighted,
        example=example,
        learned=learn(data, policy) if is_learned else None,
        findings=data.import_findings,
        progress=progress,
    )


def facts_of(data: Dataset) -> list[tuple[str, str]]:
    """What the manifest knows of the data set, as names and values."""
    identity = data.manifest.identity
    return [
        ("profile", data.profile),
        ("road", data.road.name),
        ("seed", str(identity.seed)),
        ("simulated by", f"{identity.simulator} {identity.simulator_version}"),
        ("made by overtaking", data.manifest.provenance.package),
        ("content hash", data.content_hash[:_SHOWN_DIGITS]),
    ]
