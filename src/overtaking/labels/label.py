"""Signals, events, findings, labels and features of a recording, one after the other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from overtaking.labels.events import Judgement, case_of, classify
from overtaking.labels.features import (
    decision_features,
    matched_features,
    paper_features,
    safety_measures,
)
from overtaking.labels.law import POLICIES, PORTUGAL, Pack, Policy, check, legality
from overtaking.model.batch import Batch
from overtaking.model.decisions import Decisions
from overtaking.model.events import Events
from overtaking.model.features import Features
from overtaking.model.labels import Findings, Labels
from overtaking.model.safety import Safety
from overtaking.model.signals import Signals
from overtaking.model.trajectory import Trajectories


@dataclass(frozen=True, slots=True, kw_only=True)
class Labelled(Batch):
    """A recording and what is said of it.

    Attributes:
        trajectories: The recording.
        signals: What was around the ego.
        events: What happened when.
        findings: What each rule says.
        labels: How it ended, and its class under each policy.
        paper: The paper's features as it measures them.
        matched: The same features, measured alike in every class.
        decisions: What there was to know when the overtake began, or might have.
        safety: How near it came to a collision.
    """

    IS_DERIVED: ClassVar = True

    trajectories: Trajectories
    signals: Signals
    events: Events
    findings: Findings
    labels: Labels
    paper: Features
    matched: Features
    decisions: Decisions
    safety: Safety

    def summary(self) -> Mapping[str, object]:
        """That of the recording."""
        return self.trajectories.summary()

    @property
    def features(self) -> tuple[Features, Features]:
        """Both readings of the features."""
        return self.paper, self.matched


def label(
    trajectories: Trajectories, *, pack: Pack = PORTUGAL, policies: Sequence[Policy] = POLICIES
) -> Labelled:
    """Label a recording of any origin.

    Args:
        trajectories: The recording.
        pack: The rules of a jurisdiction.
        policies: Which of its rules decide about the classes.

    Raises:
        ConfigError: A policy requires a rule that the pack does not have.
    """
    case = case_of(trajectories)
    findings = check(pack, case)
    judgements = [_judgement(findings, policy) for policy in policies]
    return Labelled(
        trajectories=trajectories,
        signals=case.signals,
        events=case.events,
        findings=findings,
        labels=classify(case.events, judgements, case.signals.frame_interval_ms),
        paper=paper_features(case),
        matched=matched_features(case),
        decisions=decision_features(case),
        safety=safety_measures(case),
    )


def _judgement(findings: Findings, policy: Policy) -> Judgement:
    law = legality(findings, policy)
    return Judgement(
        policy=policy.name,
        allows_undecided=policy.allows_undecided,
        censors_open=policy.censors_open,
        is_legal=law.is_legal,
        num_broken=law.num_broken,
        num_undecidable=law.num_undecidable,
    )
