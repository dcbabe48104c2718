"""The commands that begin with `overtaking sumo`."""

from overtaking.cli import options
from overtaking.cli.output import Output


def run(
    output: Output,
    out: options.OutFolder,
    profile: options.ProfileWord = None,
    simulations: options.Simulations = None,
    seed: options.Seed = None,
    map_file: options.Map = None,
    road: options.Road = None,
    keep: options.Keep = None,
    resume: options.Resume = False,
    yes: options.Yes = False,
    changes: options.Changes = None,
    frame_interval_ms: options.FrameInterval = None,
) -> None:
    """Simulate scenarios of a profile on SUMO and write them as a data set."""
    from overtaking.cli import arguments, making

    recipe = arguments.given(
        profile=profile,
        simulations=simulations,
        seed=seed,
        keep=keep,
        road=arguments.road(map_file, road),
        overrides=arguments.overrides(changes or [], frame_interval_ms),
    )
    making.make(output, out, recipe, resume=resume, yes=yes, simulator="sumo")


COMMANDS: dict[options.Body, str] = {
    run: "overtaking sumo run pinto2023 -n 20 --seed 1 --out data/sumo",
}
