"""Label recordings: events of the overtake, findings of each rule, classes and features.

A pack holds the rules of one law. A policy selects the rules that a legal overtake must not break,
and the classes in use.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from overtaking.core.arrays import I64, U8
from overtaking.labels.attempt_features import attempt_features
from overtaking.labels.event_detection import (
    case_from_trajectories,
    first_that_holds,
    outcome_details,
    outcomes,
)
from overtaking.labels.law.judging import (
    STORED_POLICIES,
    Legality,
    Policy,
    assess_legality,
    judge_pack,
)
from overtaking.labels.law.measurement_errors import MeasurementErrors
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Pack
from overtaking.labels.paper_features import matched_features, paper_features
from overtaking.labels.safety_features import safety_features
from overtaking.labels.signals import target_signals
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
        signals: Time series of the ego and its neighbours.
        events: Frames of the events of the overtake.
        findings: Result of each rule for each simulation.
        labels: Outcome of each simulation, and its class under each policy.
        paper_features: Features of the reproduced paper (Pinto, Dutra and Fonseca, 2023), measured
            as there: when the overtake begins; in a simulation without one, by means over frames.
        matched_features: The same features, measured at a single frame in every simulation.
        attempt_features: State of the ego and its surroundings when the overtake began, or could
            have begun.
        safety: Surrogate measures of safety, such as the smallest time to collision.
    """

    # Only this package creates the class, from checked parts: its values need no check.
    IS_INTERNAL: ClassVar = True

    trajectories: Trajectories
    signals: EgoSignals
    events: OvertakeEvents
    findings: Findings
    labels: Labels
    paper_features: PaperFeatures
    matched_features: PaperFeatures
    attempt_features: AttemptFeatures
    safety: SafetyMeasures

    def summary(self) -> Mapping[str, object]:
        """Summary of the trajectories."""
        return self.trajectories.summary()

    def to_pandas(self) -> Any:
        """The labels in words: a pandas DataFrame.

        Returns:
            One row per simulation and policy, with the columns of the table `labels` of a data set,
            less `balance_weight`. The column `simulation` holds positions in the batch, from 0.
        """
        # The import waits for the call, because labels must load without a library for tables.
        return import_module("overtaking.data.tables.data_frames").labels_frame(self)

    def case(self) -> Case:
        """The input of the rules: recording, signals, events and target."""
        # Signals of the target are computed again, because they are not stored with the labels.
        target = target_signals(self.trajectories, self.signals, self.events.target_slot)
        return Case(
            trajectories=self.trajectories,
            signals=self.signals,
            events=self.events,
            target=target,
        )


@dataclass(frozen=True, eq=False)
class JudgedBatch:
    """Some simulations of a data set with their labels by one or more laws.

    Attributes:
        simulation_ids: Numbers of the simulations in the data set, shape (simulation,).
        labelled: Labels of the simulations by each law.
    """

    simulation_ids: I64
    labelled: tuple[LabelledTrajectories, ...]

    @cached_property
    def case(self) -> Case:
        """The input of the rules, which is the same for all laws."""
        return self.labelled[0].case()


def label(
    trajectories: Trajectories,
    *,
    pack: Pack = PORTUGAL,
    policies: Sequence[Policy] = STORED_POLICIES,
    errors: MeasurementErrors | None = None,
) -> LabelledTrajectories:
    """Label a recording of any origin.

    Args:
        trajectories: The recording.
        pack: The rules of a law.
        policies: Policies under which to classify, in the order of the columns of `labels.classes`.
        errors: Standard errors of measured positions and speeds; None for exact values.

    Raises:
        ConfigError: A policy requires a rule that the pack does not have.
    """
    case = case_from_trajectories(trajectories)
    findings = judge_pack(pack, case, errors)
    return LabelledTrajectories(
        trajectories=trajectories,
        signals=case.signals,
        events=case.events,
        findings=findings,
        labels=_labels(case, findings, pack, policies),
        paper_features=paper_features(case),
        matched_features=matched_features(case),
        attempt_features=attempt_features(case),
        safety=safety_features(case),
    )


def _labels(case: Case, findings: Findings, pack: Pack, policies: Sequence[Policy]) -> Labels:
    """Outcome of each simulation, and its class under each policy."""
    outcome = outcomes(case.events)
    detail = outcome_details(case.events, case.signals.frame_interval_ms)
    legality_by_policy = [assess_legality(findings, policy, pack, case) for policy in policies]
    classes = [
        _overtake_classes(outcome, detail, legality, policy)
        for legality, policy in zip(legality_by_policy, policies, strict=True)
    ]
    legality_columns = {
        name: np.stack([getattr(legality, name) for legality in legality_by_policy], axis=1)
        for name in ("is_legal", "num_broken", "num_undecidable")
    }
    return Labels(
        policies=tuple(policy.name for policy in policies),
        outcome=outcome,
        detail=detail,
        classes=np.stack(classes, axis=1),
        **legality_columns,
    )


def _overtake_classes(outcome: U8, detail: U8, legality: Legality, policy: Policy) -> U8:
    """`OvertakeClass` of each simulation under one policy.

    Suffixes of the classes: I illegal, L legal, U undecided, COL collision, NCOL no collision, DEP
    departure from the road.
    """
    is_undecided = (legality.num_undecidable > 0) & (not policy.allows_undecided)
    is_completed = outcome == Outcome.COMPLETED
    # `OPEN_AT_HORIZON`: the recording ends during the overtake.
    is_censored = (detail == OutcomeDetail.OPEN_AT_HORIZON) & policy.censors_open
    has_departed = (
        np.isin(detail, (OutcomeDetail.DEPARTED, OutcomeDetail.SPUN)) & policy.names_departures
    )
    # The first condition that holds decides. A departure comes before `NO_ATTEMPT`, because an ego
    # that has begun no overtake can leave the road. A broken rule comes before undecided rules: the
    # overtake is illegal whatever their verdicts would be.
    classes_by_condition = [
        (outcome == Outcome.COLLISION, OvertakeClass.UNSUCCESS_COL),
        (has_departed, OvertakeClass.UNSUCCESS_DEP),
        (outcome == Outcome.NO_ATTEMPT, OvertakeClass.NO_ATTEMPT),
        (is_completed & (legality.num_broken > 0), OvertakeClass.SUCCESS_I),
        (is_completed & is_undecided, OvertakeClass.SUCCESS_U),
        (is_completed, OvertakeClass.SUCCESS_L),
        (is_censored, OvertakeClass.CENSORED),
    ]
    return first_that_holds(classes_by_condition, OvertakeClass.UNSUCCESS_NCOL)
