"""The command that puts a policy at the wheel."""

from typing import Annotated

from overtaking.cli import options
from overtaking.cli.output import Output

Policy = Annotated[
    str,
    options.option(
        "--policy MODULE:NAME",
        "Policy: a function in a module or in a .py file, whose code is executed, or a .onnx file.",
    ),
]
Observe = Annotated[
    str,
    options.option(
        "--observe human|truth|FILE",
        "What it observes: what a human driver believes, the truth, or a sensor in a TOML file.",
    ),
]
Action = Annotated[
    str,
    options.option(
        "--action NAME",
        "Form of answers: accel_lane, speed_lane, accel_steer, trajectory, decision; accel_move "
        "and accel_steer_signal have the indicator as a part.",
    ),
]
Hold = Annotated[
    int, options.option("--hold N", "Decisions for which an answer holds, 20 a second.", min=1)
]


def drive(
    output: Output,
    policy: Policy,
    observe: Observe,
    out: options.OutPlace,
    made: options.Making,
    road: options.RoadChoice,
    profile: options.ProfileWord = None,
    action: Action = "accel_lane",
    hold: Hold = 1,
) -> None:
    """Let a policy drive every ego, and write a labelled data set."""
    from overtaking import api
    from overtaking.cli import making

    driver = api.driver_of(policy, observe, action=action, hold=hold)
    recipe = making.recipe(made, profile, road)
    making.make(output, out, recipe | {"driver": driver}, made)
