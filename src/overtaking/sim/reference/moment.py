"""What drivers know at a decision."""

from dataclasses import dataclass

from overtaking.core.arrays import Mask
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
        waits: Who would let somebody first who signals for the same place, (vehicle, simulation).
        met: Whom they meet; None on roads of one direction.
    """

    near: Neighbours
    believed: Beliefs
    looks: Mask
    waits: Mask
    met: Encounters | None
