"""A laboratory for overtaking manoeuvres: simulate, label and explain them, reproducibly.

In memory:

    sample              draw scenarios from a profile
    simulate            simulate them
    drive               simulate them with a policy of your own at the wheel
    evaluate            compare a driver with others in the same scenes
    evaluate_benchmark  the same in the scenes of a benchmark
    write_evaluation    write what evaluate found as a page, with films of the worst scenes
    branch              simulate them again with decisions, weather, drivers or vehicles changed
    label               find what happened, whether it was lawful, and features
    compare             simulate on several simulators, and say where they differ
    validate            hold the traffic of a profile against real traffic
    map_roads           list the roads of an OpenDRIVE file, and which can be simulated
    reproduce           repeat a published study
    write_reproduction  write what reproduce found as one page

Data sets on disk, each in a folder:

    generate            make one
    resume              complete one that was interrupted
    load                open one
    relabel             label one anew by the rules of this version
    statistics          count classes, features and waiting times
    write_report        write figures and tables as one page
    film                film simulations
    serve_view          show a data set in the browser of this machine
    write_view          write simulations as a page to look at in a browser
    twin                put a simulation beside the same with something changed
    fan                 tell what becomes of an overtake begun at each instant
    enough              find changes of one quantity that would have been enough
    film_twin           film a simulation above its twin
    plot                draw a figure of a data set or of a result, for a paper
    save_twin           write a simulation and its twin as a data set
    save_branches       write branches as a data set
    branch_again        simulate a saved branch again
    query               ask in SQL
    ask                 ask in logic
    prove               prove why a simulation breaks the law
    learn_rules         learn rules from the state when an overtake begins
    learn_factors       rank the factors that decide

Objects:

    Scenario            what is decided before the first frame: Road with Lane, VehicleSpecs,
                        DriverTraits, Weather
    Trajectories        recorded simulations
    Labelled            the same with labels
    Dataset             a data set on disk
    Balance             equal shares of classes, for generate
    Intervention        what is different from a frame on, for branch
    ForcedDecision      a decision to force, for branch
    Driver              a policy and what it observes and answers, for generate
    Observation         what a policy is given
    Sensor              the numbers of a sensor, for a policy that does not see like a human
    Move                a decision that a policy may answer
    OvertakingError     the base of all errors
    RecordingWarning    a warning about a recording that was read; import_report has the findings
    rules               what rules of law of one's own are made of
    weather             weather with something taken away: weather.dry and friends

`help(overtaking.simulate)` explains one of them. A name is loaded from its module when it is first
used (PEP 562), so `import overtaking` is quick; `__init__.pyi` tells editors the same names.
"""

from importlib import import_module as _import_module

_HOMES = {
    "Balance": "overtaking.data.balance",
    "Intervention": "overtaking.model.scenario",
    "Dataset": "overtaking.data.load",
    "ForcedDecision": "overtaking.model.scenario",
    "Driver": "overtaking.sim.driving",
    "DriverTraits": "overtaking.model.vehicles",
    "Labelled": "overtaking.labels.label",
    "Lane": "overtaking.model.road",
    "Move": "overtaking.model.driver_interface",
    "Observation": "overtaking.sim.observation",
    "OvertakingError": "overtaking.core.errors",
    "RecordingWarning": "overtaking.core.errors",
    "Road": "overtaking.model.road",
    "Scenario": "overtaking.model.scenario",
    "Sensor": "overtaking.sim.sensor",
    "Trajectories": "overtaking.model.trajectories",
    "VehicleSpecs": "overtaking.model.vehicles",
    "Weather": "overtaking.model.weather",
    "ask": "overtaking.api.logic",
    "branch": "overtaking.api.simulating",
    "branch_again": "overtaking.api.whatif",
    "compare": "overtaking.api.simulating",
    "drive": "overtaking.api.driving",
    "evaluate": "overtaking.api.evaluating",
    "evaluate_benchmark": "overtaking.api.evaluating",
    "enough": "overtaking.api.whatif",
    "fan": "overtaking.api.whatif",
    "film": "overtaking.api.results",
    "film_twin": "overtaking.api.whatif",
    "generate": "overtaking.api.data",
    "label": "overtaking.api.simulating",
    "learn_factors": "overtaking.api.learning",
    "learn_rules": "overtaking.api.learning",
    "load": "overtaking.api.data",
    "map_roads": "overtaking.recordings.opendrive_map",
    "plot": "overtaking.api.plotting",
    "prove": "overtaking.api.logic",
    "query": "overtaking.api.results",
    "relabel": "overtaking.api.data",
    "reproduce": "overtaking.api.results",
    "resume": "overtaking.api.data",
    "rules": "overtaking.api",
    "sample": "overtaking.api.simulating",
    "save_branches": "overtaking.api.whatif",
    "save_twin": "overtaking.api.whatif",
    "simulate": "overtaking.api.simulating",
    "statistics": "overtaking.api.results",
    "twin": "overtaking.api.whatif",
    "validate": "overtaking.api.results",
    "write_evaluation": "overtaking.api.evaluating",
    "weather": "overtaking.api",
    "write_report": "overtaking.api.results",
    "write_reproduction": "overtaking.api.results",
    "serve_view": "overtaking.api.results",
    "write_view": "overtaking.api.results",
}
"""The module that defines each public name."""

__all__ = [*_HOMES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    """Load a public name, once."""
    if name == "__version__":
        value = _import_module("importlib.metadata").version(__name__)
    elif name in _HOMES:
        if name != "OvertakingError":  # Its module loads no library.
            _import_module("overtaking.core.process_limits").check_address_space(name)
        value = getattr(_import_module(_HOMES[name]), name)
    else:
        message = f"overtaking: no public name {name!r}; dir(overtaking) lists them"
        raise AttributeError(message, name=name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted({*globals(), *_HOMES, "__version__"})
