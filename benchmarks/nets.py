"""Does every safety net of the drivers catch something, and is an impaired ego dangerous?

Nets: the same simulations of `motorway-risk`, with the same random numbers, are run with all nets
and with one of them off. Without it there must be more near-crashes and a smaller least time to
collision (mean over simulations). The intervals of the paired changes hold for all nets together.

Impaired egos: the ego alone reacts late, sees 30 m, or has a friction of 0.1, and does not know of
it: speeds, gaps and decisions are those of the normal one. Weighted as they are met, they must
collide ten times as often as the normal ego.

Nets that act only where another one fails can be tried beside it: `--without NET` switches that one
off in both arms.

    python benchmarks/nets.py                          # 4,000 simulations: 12 minutes of a core
    python benchmarks/nets.py --simulations 20000      # an hour of a core
    python benchmarks/nets.py --only retreat ties --without "look over the shoulder"

Exits with 1 if a net or an ego does not do what it should.
"""

import dataclasses
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from conflicts import Conflicts, conflicts, gamma_interval
from measure import load_note, parser
from overtaking.core.arrays import Buffers
from overtaking.model.vehicles import EGO_SLOT
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine
from overtaking.world.step_parameters import (
    VEHICLE_FIELDS,
    StepParameters,
    VehicleParameters,
    step_parameters,
)

Row = Callable[[VehicleParameters], Any]
Values = NDArray[np.float64]

PIECE = 64
"""Simulations at a time: their frames stay in the caches."""

LEVEL = 0.05
DECISIONS_PER_SECOND = 20.0
OFF = 1e6
"""A threshold that nothing reaches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What differs from the model as published.

    Attributes:
        constants: Constants of the step with other values.
        rows: Parameters of the vehicles with other values, from those that they have.
        of_ego: Whether only the ego has them.
    """

    constants: Mapping[str, float] = field(default_factory=dict[str, float])
    rows: Mapping[str, Row] = field(default_factory=dict[str, Row])
    of_ego: bool = False

    def of(self, given: StepParameters) -> StepParameters:
        """The parameters with the change."""
        vehicle = given.vehicle_table.copy()
        slots = slice(EGO_SLOT, EGO_SLOT + 1) if self.of_ego else slice(None)
        for name, row in self.rows.items():
            values = np.broadcast_to(row(given.vehicles), vehicle.shape[1:])
            vehicle[VEHICLE_FIELDS.index(name), slots] = values[slots]
        c = given.constants.replace(**self.constants) if self.constants else given.constants
        return dataclasses.replace(given, vehicle_table=vehicle, constants=c)


NO_LOOKS: Mapping[str, Row] = {"checks_blind_spot": lambda p: 0.0 * p.valid}

NETS: dict[str, Change] = {
    "stop lamps": Change(constants={"stop_lamp_decel": OFF}),
    "errors fade near contact": Change(constants={"error_fade_time": 0.0}),
    "urgency of braking": Change(constants={"brake_ramp": OFF}),
    # Drivers limit braking to the friction that they believe in.
    "emergency braking": Change(
        rows={
            "max_brake_force": lambda p: np.minimum(p.max_brake_force, p.max_assumed_decel * p.mass)
        }
    ),
    "moment to spare": Change(constants={"lane_clearance_time": 0.0}),
    "last look": Change(constants={"foresight": 0.0}),
    "look over the shoulder": Change(rows=NO_LOOKS),
    "alongside": Change(constants={"alongside": -OFF}, rows=NO_LOOKS),
    "retreat": Change(constants={"abort_imposed_factor": OFF, "abort_factor": OFF}),
    "ties": Change(constants={"claim_time": 0.0}),
    "limit of what is imposed": Change(constants={"max_imposed_decel": OFF}),
    "stability control": Change(constants={"stability_threshold": OFF}),
    "traction control": Change(constants={"traction_share": 1.0}),
}
"""Each net, switched off."""

BESIDE = {"alongside": "look over the shoulder"}
"""Nets that act only where another one fails: both arms are without that."""

EGOS: dict[str, Change] = {
    "reaction time 2.5 s": Change(
        rows={"reaction_delay": lambda _: 2.5 * DECISIONS_PER_SECOND}, of_ego=True
    ),
    "sight 30 m": Change(rows={"attention_range": lambda _: 30.0}, of_ego=True),
    "friction 0.1": Change(rows={"max_friction": lambda _: 0.1}, of_ego=True),
}
"""Impaired egos."""

TIMES = 10.0


def arms(
    names: list[str], simulations: int, seed: int, without: Change
) -> tuple[dict[str, Conflicts], Values]:
    """The conflicts of every simulation in each arm, and the weights.

    Args:
        names: Nets that are off, or impaired egos, in an arm each; the arm "" has neither.
        simulations: How many.
        seed: Of the simulations.
        without: What differs in all arms.
    """
    given, buffers = load_specification("motorway-risk"), Buffers()
    road, changes = load_road(given.road), {"": Change()} | NETS | EGOS
    found: dict[str, list[Conflicts]] = {name: [] for name in ("", *names)}
    weights: list[Values] = []
    for first in range(0, simulations, PIECE):
        index = np.arange(first, min(first + PIECE, simulations), dtype=np.uint64)
        drawn = ScenarioSource(given, road, seed).sample(index)
        plain = without.of(step_parameters(drawn))
        weights.append(drawn.weight)
        for name, parts in found.items():
            changed = changes[name].of(plain)
            parts.append(conflicts(engine.run(drawn, changed, buffers=buffers)))
        print(f"\r{first + len(index)} of {simulations}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return {name: _joined(parts) for name, parts in found.items()}, np.concatenate(weights)


def _joined(parts: list[Conflicts]) -> Conflicts:
    names = [one.name for one in dataclasses.fields(Conflicts)]
    return Conflicts(**{n: np.concatenate([getattr(part, n) for part in parts]) for n in names})


def change(before: Values, after: Values, comparisons: int) -> tuple[float, float, float]:
    """Mean paired change and its interval, Bonferroni's for so many comparisons."""
    paired = after - before
    error = float(paired.std(ddof=1)) / len(paired) ** 0.5
    reach = float(student.ppf(1.0 - 0.5 * LEVEL / comparisons, len(paired) - 1))
    mean = float(paired.mean())
    return mean, mean - reach * error, mean + reach * error


def net_row(name: str, found: dict[str, Conflicts], comparisons: int) -> tuple[str, bool]:
    """What to print of a net, and whether it catches something by both measures."""
    full, off = found[BESIDE.get(name, "")], found[name]
    near = change(full.near, off.near, comparisons)
    ttc = change(full.least_ttc, off.least_ttc, comparisons)
    per_thousand = " ".join(f"{1e3 * number:+8.2f}" for number in near)
    seconds = " ".join(f"{number:+7.4f}" for number in ttc)
    met = near[1] > 0.0 and ttc[2] < 0.0
    counts = f"{int(full.near.sum()):6d} {int(off.near.sum()):6d}"
    contacts = f"{int(full.contact.sum()):5d} {int(off.contact.sum()):5d}"
    verdict = "catches" if met else "NOT SHOWN"
    return f"{name:<26}{counts}  {per_thousand}  {seconds}  {contacts}  {verdict}", met


def ego_row(name: str, found: dict[str, Conflicts], weight: Values) -> tuple[str, bool]:
    """What to print of an impaired ego, and whether it collides often enough."""
    normal, impaired = (gamma_interval(weight, found[arm].ego_contact) for arm in ("", name))
    texts = [f"{rate:.6f} [{low:.6f}, {high:.6f}]" for rate, low, high in (normal, impaired)]
    times = impaired[0] / normal[0] if normal[0] > 0.0 else float("inf")
    is_sure = impaired[1] >= TIMES * normal[2]
    is_met = impaired[0] > 0.0 and times >= TIMES
    verdict = "met, surely" if is_sure else "met" if is_met else "NOT MET"
    return f"{name:<26}{texts[0]}  {texts[1]}  {times:8.1f}  {verdict}", is_met


def main() -> int:
    """Measure and print."""
    options = parser(__doc__)
    options.add_argument("--simulations", type=int, default=4000)
    options.add_argument("--seed", type=int, default=6)
    options.add_argument("--only", nargs="*", choices=[*NETS, *EGOS], help="nets and egos to run")
    options.add_argument("--without", choices=NETS, help="net that is off in all arms")
    given = options.parse_args()
    names = given.only or [*NETS, *EGOS]
    needed = dict.fromkeys([*names, *(BESIDE[name] for name in names if name in BESIDE)])
    without = NETS[given.without] if given.without else Change()
    found, weight = arms(list(needed), given.simulations, given.seed, without)
    nets = [name for name in names if name in NETS]
    rows = [net_row(name, found, 2 * len(nets)) for name in nets]
    print("net off: near-crashes with and without it, change per 1,000 simulations [interval],")
    print("change of the least time to collision [s] [interval], contacts with and without it")
    for text, _ in rows:
        print(text)
    egos = [ego_row(name, found, weight) for name in names if name in EGOS]
    print("impaired ego: weighted collisions of a simulation, normal and impaired [95 %], ratio")
    for text, _ in egos:
        print(text)
    print(f"ego collisions among them: {int(found[''].ego_contact.sum())} of the normal ego")
    print(load_note())
    return 0 if all(met for _, met in (*rows, *egos)) else 1


if __name__ == "__main__":
    raise SystemExit(main())
