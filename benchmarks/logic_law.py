"""Do the rules in Python and the rules as logic programs give the same verdict on every simulation?

    python benchmarks/logic_law.py                          # 10,000 simulations of three profiles
    python benchmarks/logic_law.py --simulations 1000 --seed 7
    python benchmarks/logic_law.py --data data/us101        # a data set, of recordings too
    python benchmarks/logic_law.py --law de                 # German law

Every verdict of the rules that exist in both forms is compared, and the first frame of every
breach. Simulations are drawn, judged and dropped in groups, so that memory is flat. Exits with 1 if
there is a difference.
"""

import argparse
import json
import resource
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # The programs' oracle is a test's.

from tests.support.logic_law import CODES, law_reasoner, program_verdicts

import overtaking as ot
from overtaking.analysis.logic.reasoner import Reasoner
from overtaking.analysis.logic.simulation_groups import SimulationGroup, read_groups
from overtaking.labels.event_detection import case_from_trajectories
from overtaking.labels.law.judging import LAWS, judge_pack
from overtaking.model.verdicts import Verdict
from overtaking.recordings.roads import load_road
from overtaking.scenarios.profiles import load_specification
from overtaking.scenarios.sampler import ScenarioSource
from overtaking.sim import engine

PROFILE_SHARES = {"pinto2023-physical": 0.94, "motorway-risk": 0.03, "motorway": 0.03}
"""Share of each profile in the simulations."""

GROUP_SIZE = 64
"""Simulations in memory at a time."""

_KIB_PER_MIB = 1024


@dataclass(kw_only=True)
class Tally:
    """Counts of the comparison.

    Attributes:
        num_simulations: Number of compared simulations.
        verdicts: Number of simulations for each rule and verdict.
        differences: Descriptions of the verdicts that differ.
    """

    num_simulations: int = 0
    verdicts: Counter[tuple[str, str]] = field(default_factory=Counter[tuple[str, str]])
    differences: list[str] = field(default_factory=list[str])


def simulate_profile(profile: str, num_simulations: int, seed: int) -> Iterator[SimulationGroup]:
    """Simulations of a profile, one group after the other."""
    specification = load_specification(profile)
    road = load_road(specification.road)
    scenarios = ScenarioSource(specification, road, seed)
    for first in range(0, num_simulations, GROUP_SIZE):
        simulation_ids = np.arange(first, min(first + GROUP_SIZE, num_simulations))
        trajectories = engine.simulate(scenarios.sample(simulation_ids.astype(np.uint64)))
        yield SimulationGroup(
            simulation_ids=simulation_ids,
            case=case_from_trajectories(trajectories),
        )


def compare(
    reasoner: Reasoner, group: SimulationGroup, tally: Tally, source_name: str, law: str
) -> None:
    """Compare all verdicts of a group, and the first frames of breaches."""
    findings, logic = judge_pack(LAWS[law], group.case), program_verdicts(reasoner, group, law)
    codes = CODES[law]
    columns = [findings.rule_codes.index(code) for code in codes]
    verdict, first_frame = findings.verdict[:, columns], findings.first_frame[:, columns]
    tally.num_simulations += len(verdict)
    for column, code in enumerate(codes):
        for value, count in zip(*np.unique(verdict[:, column], return_counts=True), strict=True):
            tally.verdicts[code, Verdict(int(value)).name.lower()] += int(count)
    is_illegal = verdict == Verdict.ILLEGAL
    differs = (verdict != logic.verdict) | (is_illegal & (first_frame != logic.first_frame))
    for row, column in np.argwhere(differs).tolist():
        python = f"{verdict[row, column]} from frame {first_frame[row, column]}"
        program = f"{logic.verdict[row, column]} from frame {logic.first_frame[row, column]}"
        simulation = f"{source_name} {group.simulation_ids[row]}"
        tally.differences.append(f"{simulation}, {codes[column]}: Python {python}, ASP {program}")


def main() -> int:
    """Compare, and print the counts and the differences."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--simulations", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--data", help="a data set instead of simulations that are drawn")
    parser.add_argument("--law", choices=CODES, default="pt")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    begin, tally = time.perf_counter(), Tally()
    if arguments.data:
        sources = {arguments.data: read_groups(ot.load_dataset(arguments.data), size=GROUP_SIZE)}
    else:
        sources = {
            profile: simulate_profile(profile, round(arguments.simulations * share), arguments.seed)
            for profile, share in PROFILE_SHARES.items()
        }
    with law_reasoner(arguments.law, timeout_s=1e6) as reasoner:
        for source_name, groups in sources.items():
            for group in groups:
                compare(reasoner, group, tally, source_name, arguments.law)
                num_compared = int(group.simulation_ids[-1]) + 1
                progress = (
                    f"\r{source_name}: {num_compared:,}, {len(tally.differences)} differences"
                )
                print(progress, end="", file=sys.stderr, flush=True)
    seconds = time.perf_counter() - begin
    values = {
        "simulations": tally.num_simulations,
        "verdicts": sum(tally.verdicts.values()),
        "differences": tally.differences,
        "seconds": round(seconds, 1),
        "memory_mib": round(_peak_memory_mib()),
        "by_rule": {" ".join(key): count for key, count in sorted(tally.verdicts.items())},
    }
    print(json.dumps(values, indent=2) if arguments.json else _page(values, tally, arguments.law))
    return 1 if tally.differences else 0


def _page(values: Mapping[str, object], tally: Tally, law: str) -> str:
    """The result as a table of rules and verdicts, and the differences."""
    names = [verdict.name.lower() for verdict in Verdict]
    lines = ["", f"{'rule':<6}" + "".join(f"{name:>16}" for name in names)]
    for code in CODES[law]:
        counts = (tally.verdicts[code, name] for name in names)
        lines.append(f"{code:<6}" + "".join(f"{count:>16,}" for count in counts))
    lines.append(
        f"{values['simulations']:,} simulations, {values['verdicts']:,} verdicts, "
        f"{len(tally.differences)} differences; {values['seconds']} s, at most "
        f"{values['memory_mib']} MiB in either process"
    )
    return "\n".join(lines + tally.differences)


def _peak_memory_mib() -> float:
    """Peak memory of this process or the reasoner, the larger of the two [MiB]."""
    processes = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return max(resource.getrusage(process).ru_maxrss for process in processes) / _KIB_PER_MIB


if __name__ == "__main__":
    sys.exit(main())
