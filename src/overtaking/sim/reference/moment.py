"""What drivers know at a decision."""

from dataclasses import dataclass

from overtaking.core.elementary import Mask
from overtaking.sim.reference.mobil import Claims
from overtaking.sim.reference.neighbours import Neighbours
from overtaking.sim.reference.oncoming import Encounters
from overtaking.sim.reference.perception import Beliefs


@dataclass(slots=True, kw_only=True)
class Moment:
    """What drivers know at a decision.

    Attributes:
        near: Their neighbours.
        believed: What they believe of them.
        looks: Who looks around, (vehicle, simulation).
        claims: `mobil.claimed` before anyone decides.
        met: Whom they meet; None on roads of one direction.
    """

    near: Neighbours
    believed: Beliefs
    looks: Mask
    claims: Claims
    met: Encounters | None
