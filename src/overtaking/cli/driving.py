"""The command that lets a driver of one's own drive every ego."""

from typing import Annotated

from overtaking.cli import options
from overtaking.cli.output import Output

DriverName = Annotated[
    str,
    options.option(
        "--driver MODULE:NAME",
        "Driver of the ego: a function in a module or in a .py file, whose code is executed, or a "
        ".onnx file.",
    ),
]
Observation = Annotated[
    str,
    options.option(
        "--observation human|truth|FILE",
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
ActionRepeat = Annotated[
    int,
    options.option("--action-repeat N", "Decisions for which an action holds, 20 a second.", min=1),
]


def drive(
    output: Output,
    driver: DriverName,
    observation: Observation,
    out: options.OutPlace,
    made: options.Making,
    road: options.RoadChoice,
    profile: options.ProfileWord = None,
    action: Action = "accel_lane",
    action_repeat: ActionRepeat = 1,
) -> None:
    """Let a driver of your own drive every ego, and write a labelled data set."""
    from overtaking.api import evaluation
    from overtaking.cli import making

    loaded = evaluation.load_driver(driver, observation, action=action, action_repeat=action_repeat)
    recipe = making.recipe(made, profile, road)
    making.make(output, out, recipe | {"driver": loaded}, made)
