"""Writes robustness.json: random signals, and the robustness that RTAMT computes on them.

RTAMT pins an old ANTLR run time that Python 3.12 cannot import, so it needs an environment of its
own with Python 3.11:

    python3.11 -m venv rtamt && rtamt/bin/pip install rtamt==0.4.10
    rtamt/bin/python tests/reference/law/make_robustness.py

The formulas state rules of the law in signal temporal logic (Nickovic and Yamaguchi, RTAMT: Online
robustness monitors from STL). Boolean signals are +-1e6: they decide which frames count, and are
never the smallest margin themselves.
"""

import json
import random
from pathlib import Path

import rtamt  # pyright: ignore[reportMissingImports]

NUM_SIMULATIONS = 12
NUM_FRAMES = 230
SURE = 1e6
MAX_SPEED, MIN_SPEED = 120.0 / 3.6, 50.0 / 3.6
REGAIN_FRAMES = 60  # 3 s.
DUE_FRAMES = 160  # 8 s.

FORMULAS = {
    "follow": f"always((lead >= 0 and not(once[0:{REGAIN_FRAMES}](cut >= 0))) "
    "implies (gap - need >= 0))",
    "limit": "always(limit - speed >= 0)",
    "minimum": "always((jam >= 0) or (slow - least >= 0))",
    "stop": "always(sight - stop >= 0)",
    "side": "always((beside >= 0) implies (aside >= 0.8))",
    "duty": f"always(not(historically[0:{DUE_FRAMES}](due >= 0)))",
}
VARIABLES = {
    "follow": ("lead", "cut", "gap", "need"),
    "limit": ("limit", "speed"),
    "minimum": ("jam", "slow", "least"),
    "stop": ("sight", "stop"),
    "side": ("beside", "aside"),
    "duty": ("due",),
}


def main() -> None:
    """Draw the signals, compute the robustness and write the file."""
    random.seed(20)
    signals = [random_signals() for _ in range(NUM_SIMULATIONS)]
    values = {
        name: [round(robustness(name, simulation), 4) for simulation in signals]
        for name in FORMULAS
    }
    content = {
        "formulas": FORMULAS,
        "signals": [compact(simulation) for simulation in signals],
        "robustness": values,
    }
    Path(__file__).with_name("robustness.json").write_text(
        json.dumps(content, separators=(",", ":")) + "\n", encoding="utf-8"
    )


def random_signals() -> dict[str, list[float]]:
    """Random signals of one simulation: numbers in whole hundredths, and Boolean signals."""
    numbers = {
        "speed": random_walk(random.uniform(26.0, 34.0), 0.15),
        "slow": random_walk(random.uniform(13.0, 20.0), 0.15),
        "gap": random_walk(40.0, 0.8),
        "need": random_walk(30.0, 0.5),
        "sight": random_walk(160.0, 2.0),
        "stop": random_walk(130.0, 1.0),
        "aside": random_walk(1.6, 0.05),
    }
    constants = {"limit": [MAX_SPEED] * NUM_FRAMES, "least": [MIN_SPEED] * NUM_FRAMES}
    flags = {
        "lead": random_spells(0.02),
        # The rule treats the beginning of a recording like a cut-in.
        "cut": [SURE, *rare_frames(0.004)[1:]],
        "jam": random_spells(0.02),
        "beside": random_spells(0.03),
        "due": [-SURE, *random_spells(0.008)[1:]],
    }
    return numbers | constants | flags


def compact(signals: dict[str, list[float]]) -> dict[str, list[int] | str]:
    """The random signals as hundredths, and as a letter for each Boolean value."""
    return {
        name: "".join("y" if value > 0 else "n" for value in values)
        if abs(values[0]) == SURE
        else [round(value * 100) for value in values]
        for name, values in signals.items()
        if name not in ("limit", "least")
    }


def random_walk(start: float, step_std: float) -> list[float]:
    """A random walk in whole hundredths."""
    values, value = [], start
    for _ in range(NUM_FRAMES):
        value += random.gauss(0.0, step_std)
        values.append(round(value, 2))
    return values


def random_spells(change_probability: float) -> list[float]:
    """A Boolean signal that changes at random frames."""
    values, value = [], random.choice([-SURE, SURE])
    for _ in range(NUM_FRAMES):
        value = -value if random.random() < change_probability else value
        values.append(value)
    return values


def rare_frames(probability: float) -> list[float]:
    """A Boolean signal that is true in single frames."""
    return [SURE if random.random() < probability else -SURE for _ in range(NUM_FRAMES)]


def robustness(formula: str, signals: dict[str, list[float]]) -> float:
    """The robustness of a formula at the first frame, by RTAMT."""
    spec = rtamt.StlDiscreteTimeSpecification()
    for variable in VARIABLES[formula]:
        spec.declare_var(variable, "float")
    spec.declare_var("out", "float")
    spec.spec = f"out = {FORMULAS[formula]}"
    spec.parse()
    data = {variable: signals[variable] for variable in VARIABLES[formula]}
    return spec.evaluate({"time": list(range(NUM_FRAMES))} | data)[0][1]


if __name__ == "__main__":
    main()
