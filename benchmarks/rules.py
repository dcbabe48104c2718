"""What each rule of law costs, beside the simulations that it judges.

    python benchmarks/rules.py

Processor time of one core for each simulation, the shortest of some runs over a batch as data sets
use it, and the time that signals and the engine took for the same batch.
"""

import sys
import time
from collections.abc import Callable
from functools import partial

import overtaking as ot
from measure import Measure, number, parser, report
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.judging import judge_pack, judge_rule
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Rule
from overtaking.model.verdicts import Case

BATCH, REPEATS = 512, 7
LIMIT = 60.0
"""All rules together [microseconds of a core a simulation]."""


def case() -> Case:
    """A batch of the study's profile with everything that rules look at."""
    return case_from_trajectories(
        ot.simulate(ot.sample("pinto2023-physical", num_simulations=BATCH, seed=1))
    )


def cost(action: Callable[[], object]) -> float:
    """The shortest of some runs [microseconds of processor time a simulation]."""
    times: list[float] = []
    for _ in range(REPEATS):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return min(times) / BATCH * 1e6


def measures() -> list[Measure]:
    """Each rule, and all of them."""
    batch = case()
    scenarios = batch.trajectories.scenario

    def one(rule: Rule) -> object:
        return judge_rule(rule, batch.replace())

    made = cost(lambda: ot.simulate(scenarios))
    # What many rules ask of a case is answered once, so each run has a case of its own.
    everything = cost(lambda: judge_pack(PORTUGAL, batch.replace()))
    each = [
        Measure(name=rule.title, value=cost(partial(one, rule)), unit="us", note=rule.code)
        for rule in PORTUGAL.rules
    ]
    share = Measure(
        name="rules / engine",
        value=everything / made,
        unit="1",
        note=f"the engine takes {number(made)} us a simulation",
    )
    whole = Measure(name="all rules", value=everything, unit="us", at_most=LIMIT)
    return [*each, whole, share]


if __name__ == "__main__":
    options = parser(__doc__).parse_args()
    sys.exit(report(measures(), as_json=options.json))
