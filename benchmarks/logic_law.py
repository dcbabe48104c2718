"""Do the law in Python and the law as a logic program say the same of every simulation?

    python benchmarks/logic_law.py                          # 10,000 simulations of three profiles
    python benchmarks/logic_law.py --simulations 1000 --seed 7
    python benchmarks/logic_law.py --data data/us101        # a data set, of recordings too
    python benchmarks/logic_law.py --law de                 # German law

Every verdict of the rules of a law that are there twice is compared, and the first frame of
every breach. Simulations are drawn, judged and forgotten in groups, so that memory is flat. Exits
with 1 if there is a difference.
"""

import argparse
import json
import resource
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

import overtaking as ot
from overtaking.analysis.logic.law import PROGRAMS, judged, lawyer
from overtaking.analysis.logic.reasoning import Reasoner
from overtaking.analysis.logic.source import Group, groups
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.judging import LAWS, judge_pack
from overtaking.model.verdicts import Verdict
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

SHARES = {"pinto2023-physical": 0.94, "motorway-risk": 0.03, "motorway": 0.03}
"""What part of the simulations is of which profile."""

PIECE = 64
"""Simulations in memory at a time."""

_KIB_PER_MIB = 1024


@dataclass(kw_only=True)
class Tally:
    """What was compared.

    Attributes:
        simulations: How many.
        verdicts: How many there are of each rule and verdict.
        differences: Descriptions of those that differ.
    """

    simulations: int = 0
    verdicts: Counter[tuple[str, str]] = field(default_factory=Counter[tuple[str, str]])
    differences: list[str] = field(default_factory=list[str])


def drawn(profile: str, number: int, seed: int) -> Iterator[Group]:
    """Simulations of a profile, a piece at a time."""
    chosen = load_specification(profile)
    road = load_road(chosen.road)
    for first in range(0, number, PIECE):
        numbers = np.arange(first, min(first + PIECE, number))
        runs = engine.simulate(ScenarioSource(chosen, road, seed).sample(numbers.astype(np.uint64)))
        yield Group(numbers=numbers, case=case_from_trajectories(runs), done=int(numbers[-1]) + 1)


def compare(reasoner: Reasoner, group: Group, tally: Tally, where: str, law: str) -> None:
    """Compare all verdicts of a group, and the first frames of breaches."""
    found, said = judge_pack(LAWS[law], group.case), judged(reasoner, group, law)
    codes = PROGRAMS[law][1]
    place = [found.rule_codes.index(code) for code in codes]
    verdict, first = found.verdict[:, place], found.first_frame[:, place]
    tally.simulations += len(verdict)
    for rule, code in enumerate(codes):
        for value, count in zip(*np.unique(verdict[:, rule], return_counts=True), strict=True):
            tally.verdicts[code, Verdict(int(value)).name.lower()] += int(count)
    is_illegal = verdict == Verdict.ILLEGAL
    differs = (verdict != said.verdict) | (is_illegal & (first != said.first))
    for row, rule in np.argwhere(differs).tolist():
        python = f"{verdict[row, rule]} from frame {first[row, rule]}"
        logic = f"{said.verdict[row, rule]} from frame {said.first[row, rule]}"
        number = group.numbers[row]
        tally.differences.append(f"{where} {number}, {codes[rule]}: Python {python}, ASP {logic}")


def main() -> int:
    """Compare, and print what was found."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--simulations", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--data", help="a data set instead of simulations that are drawn")
    parser.add_argument("--law", choices=PROGRAMS, default="pt")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    begin, tally = time.perf_counter(), Tally()
    if given.data:
        sources = {given.data: groups(ot.load_dataset(given.data), size=PIECE)}
    else:
        sources = {
            profile: drawn(profile, round(given.simulations * share), given.seed)
            for profile, share in SHARES.items()
        }
    with lawyer(given.law, timeout_s=1e6) as reasoner:
        for where, source in sources.items():
            for group in source:
                compare(reasoner, group, tally, where, given.law)
                done = f"\r{where}: {group.done:,}, {len(tally.differences)} differences"
                print(done, end="", file=sys.stderr, flush=True)
    seconds = time.perf_counter() - begin
    values = {
        "simulations": tally.simulations,
        "verdicts": sum(tally.verdicts.values()),
        "differences": tally.differences,
        "seconds": round(seconds, 1),
        "memory_mib": round(_memory_mib()),
        "by_rule": {" ".join(key): count for key, count in sorted(tally.verdicts.items())},
    }
    print(json.dumps(values, indent=2) if given.json else _page(values, tally, given.law))
    return 1 if tally.differences else 0


def _page(values: Mapping[str, object], tally: Tally, law: str) -> str:
    """The result for people."""
    names = [verdict.name.lower() for verdict in Verdict]
    lines = ["", f"{'rule':<6}" + "".join(f"{name:>16}" for name in names)]
    for code in PROGRAMS[law][1]:
        counts = (tally.verdicts[code, name] for name in names)
        lines.append(f"{code:<6}" + "".join(f"{count:>16,}" for count in counts))
    lines.append(
        f"{values['simulations']:,} simulations, {values['verdicts']:,} verdicts, "
        f"{len(tally.differences)} differences; {values['seconds']} s, at most "
        f"{values['memory_mib']} MiB in either process"
    )
    return "\n".join(lines + tally.differences)


def _memory_mib() -> float:
    """Most memory that this process or the reasoner has used [MiB]."""
    who = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return max(resource.getrusage(one).ru_maxrss for one in who) / _KIB_PER_MIB


if __name__ == "__main__":
    sys.exit(main())
