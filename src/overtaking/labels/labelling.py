"""Signals, events, findings, labels and features of a recording, one after the other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from overtaking.core.arrays import U8
from overtaking.labels.attempt_features import attempt_features
from overtaking.labels.event_detection import case_of, detail, first_case, outcome
from overtaking.labels.law.judging import POLICIES, Legality, Policy, check, legality
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Pack
from overtaking.labels.paper_features import matched_features, paper_features
from overtaking.labels.safety_features import safety_measures
from overtaking.model.batch import IdentityBatch
from overtaking.model.ego_signals import EgoSignals
from overtaking.model.overtake_events import Outcome, OutcomeDetail, OvertakeEvents
from overtaking.model.overtake_features import AttemptFeatures, PaperFeatures
from overtaking.model.safety_measures import SafetyMeasures
from overtaking.model.trajectories import Trajectories
from overtaking.model.verdicts import Case, Findings, Labels, OvertakeClass


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelledTrajectories(IdentityBatch):
    """A recording and its labels.

    Attributes:
        trajectories: The recording.
        signals: What was around the ego.
        events: What happened when.
        findings: What each rule says.
        labels: How it ended, and its class under each policy.
        paper: The paper's features as it measures them.
        matched: The same features, measured alike in every class.
        attempt_features: State of the ego and its surroundings when the overtake began, or could
            have begun.
        safety: How near it came to a collision.
    """

    IS_INTERNAL: ClassVar = True

    trajectories: Trajectories
    signals: EgoSignals
    events: OvertakeEvents
    findings: Findings
    labels: Labels
    paper: PaperFeatures
    matched: PaperFeatures
    attempt_features: AttemptFeatures
    safety: SafetyMeasures

    def summary(self) -> Mapping[str, object]:
        """That of the recording."""
        return self.trajectories.summary()

    def to_pandas(self) -> Any:
        """The labels in words: a pandas DataFrame.

        Returns:
            One row per simulation and policy, with the columns of the table `labels` of a data set,
            less `balance_weight`. The column `simulation` holds positions in the batch, from 0.
        """
        # By name, because this package loads no table library.
        return import_module("overtaking.data.tables.data_frames").labels_frame(self)

    @property
    def features(self) -> tuple[PaperFeatures, PaperFeatures]:
        """Both readings of the features."""
        return self.paper, self.matched


def label(
    trajectories: Trajectories,
    *,
    pack: Pack = PORTUGAL,
    policies: Sequence[Policy] = POLICIES,
    errors: MeasurementErrors | None = None,
) -> LabelledTrajectories:
    """Label a recording of any origin.

    Args:
        trajectories: The recording.
        pack: The rules of a jurisdiction.
        policies: Which of its rules decide about the classes.
        errors: Of the measurement of positions and speeds; None if there are none.

    Raises:
        ConfigError: A policy requires a rule that the pack does not have.
    """
    case = case_of(trajectories)
    findings = check(pack, case, errors)
    return LabelledTrajectories(
        trajectories=trajectories,
        signals=case.signals,
        events=case.events,
        findings=findings,
        labels=_labels(case, findings, pack, policies),
        paper=paper_features(case),
        matched=matched_features(case),
        attempt_features=attempt_features(case),
        safety=safety_measures(case),
    )


def _labels(case: Case, findings: Findings, pack: Pack, policies: Sequence[Policy]) -> Labels:
    """How each simulation ended, and its class under each policy."""
    how, way = outcome(case.events), detail(case.events, case.signals.frame_interval_ms)
    laws = [legality(findings, each, pack, case) for each in policies]
    classes = [_classes(how, way, law, each) for law, each in zip(laws, policies, strict=True)]
    judged = {
        name: np.stack([getattr(law, name) for law in laws], axis=1)
        for name in ("is_legal", "num_broken", "num_undecidable")
    }
    return Labels(
        policies=tuple(each.name for each in policies),
        outcome=how,
        detail=way,
        classes=np.stack(classes, axis=1),
        **judged,
    )


def _classes(how: U8, way: U8, law: Legality, policy: Policy) -> U8:
    """The class of each simulation under one policy."""
    undecided = (law.num_undecidable > 0) & (not policy.allows_undecided)
    completed = how == Outcome.COMPLETED
    cut_off = (way == OutcomeDetail.OPEN_AT_HORIZON) & policy.censors_open
    lost = np.isin(way, (OutcomeDetail.DEPARTED, OutcomeDetail.SPUN)) & policy.names_departures
    cases = [
        (how == Outcome.COLLISION, OvertakeClass.UNSUCCESS_COL),
        (lost, OvertakeClass.UNSUCCESS_DEP),
        (how == Outcome.NO_ATTEMPT, OvertakeClass.NO_ATTEMPT),
        (completed & (law.num_broken > 0), OvertakeClass.SUCCESS_I),
        (completed & undecided, OvertakeClass.SUCCESS_U),
        (completed, OvertakeClass.SUCCESS_L),
        (cut_off, OvertakeClass.CENSORED),
    ]
    return first_case(cases, OvertakeClass.UNSUCCESS_NCOL)
