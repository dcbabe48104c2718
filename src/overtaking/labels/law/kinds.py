"""What kinds of vehicle a recording holds, or may hold where it does not say."""

import numpy as np

from overtaking.core.elementary import Mask
from overtaking.model.labels import Case
from overtaking.model.trajectory import NO_VEHICLE
from overtaking.model.vehicles import Role, VehicleKind


def ego_may_be(case: Case, kind: VehicleKind) -> Mask:
    """Whether the ego is of a kind, or its kind is unknown, shape (simulation,)."""
    return (case.trajectories.scenario.vehicles.kind[:, Role.EGO] == kind) | _unknown(case)


def target_may_be_bicycle(case: Case) -> Mask:
    """Whether there is a target that is a bicycle, or may be one, shape (simulation,)."""
    return _has_target(case) & (_target_is_bicycle(case) | _unknown(case))


def target_may_be_motor(case: Case) -> Mask:
    """Whether there is a target that is a motor vehicle, or may be one, shape (simulation,)."""
    return _has_target(case) & (~_target_is_bicycle(case) | _unknown(case))


def _unknown(case: Case) -> bool:
    return "kinds" in case.trajectories.unknown


def _has_target(case: Case) -> Mask:
    return case.target.vehicle != NO_VEHICLE


def _target_is_bicycle(case: Case) -> Mask:
    slot = np.where(_has_target(case), case.target.vehicle, 0)
    kind = case.trajectories.scenario.vehicles.kind
    return kind[np.arange(len(slot)), slot] == VehicleKind.B
