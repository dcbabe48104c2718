"""Writes robustness.json: random signals, and what RTAMT says of them.

RTAMT pins an old ANTLR run time that Python 3.12 cannot import, so it runs apart, with Python 3.11:

    python3.11 -m venv rtamt && rtamt/bin/pip install rtamt==0.4.10
    rtamt/bin/python tests/reference/law/make_robustness.py

Formulas are those of the law as signal temporal logic has them (Nickovic and Yamaguchi, RTAMT:
Online robustness monitors from STL). Boolean signals are +-1e6, so that they decide and never are
the robustness themselves.
"""

import json
import random
from pathlib import Path

import rtamt  # pyright: ignore[reportMissingImports]

SIMULATIONS = 12
FRAMES = 230
SURE = 1e6
LIMIT, LEAST = 120.0 / 3.6, 50.0 / 3.6
STILL = 60  # Frames of 3 s.
DUE = 160  # Frames of 8 s.

FORMULAS = {
    "follow": f"always((lead >= 0 and not(once[0:{STILL}](cut >= 0))) implies (gap - need >= 0))",
    "limit": "always(limit - speed >= 0)",
    "minimum": "always((jam >= 0) or (slow - least >= 0))",
    "stop": "always(sight - stop >= 0)",
    "side": "always((beside >= 0) implies (aside >= 0.8))",
    "duty": f"always(not(historically[0:{DUE}](due >= 0)))",
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
    """Draw, ask and write."""
    random.seed(20)
    rows = [signals() for _ in range(SIMULATIONS)]
    said = {name: [round(robustness(name, row), 4) for row in rows] for name in FORMULAS}
    content = {"formulas": FORMULAS, "signals": [packed(row) for row in rows], "robustness": said}
    Path(__file__).with_name("robustness.json").write_text(
        json.dumps(content, separators=(",", ":")) + "\n", encoding="utf-8"
    )


def signals() -> dict[str, list[float]]:
    """Random signals of one simulation, in whole hundredths or yes and no."""
    walks = {
        "speed": wander(random.uniform(26.0, 34.0), 0.15),
        "slow": wander(random.uniform(13.0, 20.0), 0.15),
        "gap": wander(40.0, 0.8),
        "need": wander(30.0, 0.5),
        "sight": wander(160.0, 2.0),
        "stop": wander(130.0, 1.0),
        "aside": wander(1.6, 0.05),
    }
    constants = {"limit": [LIMIT] * FRAMES, "least": [LEAST] * FRAMES}
    flags = {
        "lead": spells(0.02),
        # A recording begins as if somebody had just cut in.
        "cut": [SURE, *rare(0.004)[1:]],
        "jam": spells(0.02),
        "beside": spells(0.03),
        "due": [-SURE, *spells(0.008)[1:]],
    }
    return walks | constants | flags


def packed(row: dict[str, list[float]]) -> dict[str, list[int] | str]:
    """The same in little room: hundredths, and a letter for each yes and no."""
    return {
        name: "".join("y" if value > 0 else "n" for value in values)
        if abs(values[0]) == SURE
        else [round(value * 100) for value in values]
        for name, values in row.items()
        if name not in ("limit", "least")
    }


def wander(start: float, step: float) -> list[float]:
    """A random walk."""
    values, value = [], start
    for _ in range(FRAMES):
        value += random.gauss(0.0, step)
        values.append(round(value, 2))
    return values


def spells(change: float) -> list[float]:
    """Yes and no for a while each."""
    values, value = [], random.choice([-SURE, SURE])
    for _ in range(FRAMES):
        value = -value if random.random() < change else value
        values.append(value)
    return values


def rare(chance: float) -> list[float]:
    """Yes now and then."""
    return [SURE if random.random() < chance else -SURE for _ in range(FRAMES)]


def robustness(name: str, row: dict[str, list[float]]) -> float:
    """What RTAMT says of a formula at the first frame."""
    spec = rtamt.StlDiscreteTimeSpecification()
    for variable in VARIABLES[name]:
        spec.declare_var(variable, "float")
    spec.declare_var("out", "float")
    spec.spec = f"out = {FORMULAS[name]}"
    spec.parse()
    data = {variable: row[variable] for variable in VARIABLES[name]}
    return spec.evaluate({"time": list(range(FRAMES))} | data)[0][1]


if __name__ == "__main__":
    main()
