"""What would have happened: the same simulation with something changed from a frame on."""

from collections.abc import Callable

from overtaking.core.errors import ConfigError
from overtaking.model.decision import Decision
from overtaking.model.scenario import Scenario
from overtaking.model.trajectory import Trajectories
from overtaking.model.weather import Weather
from overtaking.sim import engine
from overtaking.world.parameters import parameters, with_command

__all__ = ["Decision", "Run", "branch"]

Run = Callable[..., Trajectories]
"""`engine.run`, or `reference.run`."""


def branch(
    scenario: Scenario,
    frame: int,
    *,
    decision: Decision | None = None,
    weather: Weather | None = None,
    run: Run = engine.run,
) -> Trajectories:
    """Simulate again, with a decision or the weather changed from `frame` on.

    The part before the frame is simulated too, not read from a file, so the result is exact; with
    nothing changed its trace hash is that of the undisturbed simulation.

    Args:
        scenario: A batch of scenarios.
        frame: First frame that the change can affect, 0 to the last one before the horizon.
        decision: Decision forced on every ego.
        weather: Weather of every simulation from then on, shape as in `scenario`.
        run: `engine.run`, or `reference.run` for the readable twin.

    Raises:
        ConfigError: There is no such frame.
    """
    given = parameters(scenario)
    last = max(given.num_frames - 1, 0)
    if not 0 <= frame <= last:
        raise ConfigError.of(
            what="frame",
            where="branch",
            expected=f"0 to {last}, the last one before the horizon",
            got=frame,
            next_step="choose a recorded frame",
        )
    changed = scenario if weather is None else scenario.replace(weather=weather)
    later = parameters(changed)
    if decision is not None:
        later = with_command(later, int(decision))
    return run(scenario, given, later, frame * given.record_every)
