"""A laboratory for overtaking manoeuvres: simulate, label and explain them, reproducibly.

The ego is the vehicle under study; it follows a slower vehicle, the target, and may overtake it. A
profile describes a road and its traffic. A scenario is all that is decided before the simulation
begins: road, weather, vehicles and drivers, drawn from a profile. A simulation records the vehicles
frame by frame, at instants of equal distance. Its labels are computed from the recording: the
outcome, the verdicts of the rules of a law, and features, numbers that describe the overtake. Its
class combines outcome and legality, such as `Success_L` (completed and legal).

Arrays in memory (a batch of many simulations):

    sample                  draw scenarios from a profile
    simulate                simulate them
    drive                   simulate them with a driver of your own
    branch                  simulate them again with decisions, weather, drivers or vehicles changed
    label                   find outcomes, breaches of the law and features
    evaluate                compare drivers of the ego in the same scenarios
    run_benchmark           compare drivers in the published scenarios of a benchmark
    compare_simulators      simulate on several simulators and show the differences
    validate_profile        compare the traffic of a profile with measured traffic
    reproduce_study         repeat the published study that the profile pinto2023 models

Data sets on disk, each in a folder:

    generate_dataset        simulate scenarios and write them
    resume_dataset          complete a data set that was interrupted
    load_dataset            open a data set
    relabel_dataset         label a data set again by the rules of this version
    export_dataset          write a data set in another format
    import_recording        read a recording of real traffic as a data set
    label_recordings        label a folder of recordings
    list_opendrive_roads    list the roads of an OpenDRIVE file, and which can be simulated
    dataset_statistics      statistics of classes, features and times before the overtake
    sql                     query a data set in SQL

Pictures and pages:

    plot                    draw a figure of a data set or of a result
    film                    film simulations, also an original and its changed repetition in one
                            picture
    write_report            write a page about a data set, or about the result of `evaluate`,
                            `run_benchmark` or `reproduce_study`
    write_viewer_page       write simulations as a page for a browser
    serve_viewer            show a data set in the browser of this machine

Objects:

    Scenario                a batch of scenarios; it contains a Road with Lanes, VehicleSpecs,
                            DriverTraits and Weather
    Road                    a road: its lanes, markings, curvature and speed limits
    Lane                    one of its lanes
    VehicleSpecs            size and performance of the vehicles
    DriverTraits            traits of their drivers
    Weather                 rain, fog, wind and light
    Trajectories            recorded simulations
    LabelledTrajectories    the same with labels
    Dataset                 a data set on disk
    ClassBalance            equal shares of classes, for generate_dataset
    Intervention            a change that branch makes from a frame on
    ForcedDecision          a decision that an Intervention forces
    Driver                  a function that drives the ego, and how it observes and answers
    Observation             the values that a Driver observes
    Sensor                  range and errors of a sensor, through which a Driver may observe
    Move                    a decision that a Driver may answer
    MeasurementErrors       standard deviations of recorded positions and speeds, for label
    OvertakingError         the base of all errors
    RecordingWarning        a warning about implausible values in a recording

Codes in arrays, such as `labelled.labels.classes` of LabelledTrajectories:

    OvertakeClass           class of an overtake by its outcome and the verdicts of the rules
    Outcome                 end of an overtake, whatever the law says
    Verdict                 a rule is kept, broken, not applicable or undecidable in a simulation
    Stage                   stage of the ego's overtake in a frame, such as PULL_OUT
    VehicleKind             car, van, truck and the other kinds of vehicles

Modules:

    whatif                  what would have happened otherwise, and which change would have sufficed
    law                     laws compared, and rules of your own
    logic                   questions in logic, and proofs
    learning                rules and factors learned from a data set
    carla                   the simulator CARLA: handling limits, replay, a server for its clients

`help(overtaking.simulate)` explains a name. A name is loaded from its module when it is first used
(PEP 562), so that `import overtaking` is quick. `__init__.pyi` tells editors the same names. A new
public name needs an entry in `_HOMES`, in `__init__.pyi` and in the lists above.
"""

from importlib import import_module as _import_module

_HOMES = {
    "ClassBalance": "overtaking.data.balance",
    "Intervention": "overtaking.model.scenario",
    "Dataset": "overtaking.data.load",
    "ForcedDecision": "overtaking.model.scenario",
    "Driver": "overtaking.sim.external_driver",
    "DriverTraits": "overtaking.model.vehicles",
    "LabelledTrajectories": "overtaking.labels.labelling",
    "Lane": "overtaking.model.road",
    "MeasurementErrors": "overtaking.labels.law.measurement_errors",
    "Move": "overtaking.model.driver_interface",
    "Observation": "overtaking.sim.ego_observation",
    "Outcome": "overtaking.model.overtake_events",
    "OvertakeClass": "overtaking.model.verdicts",
    "OvertakingError": "overtaking.core.errors",
    "RecordingWarning": "overtaking.core.errors",
    "Road": "overtaking.model.road",
    "Scenario": "overtaking.model.scenario",
    "Sensor": "overtaking.sim.sensors",
    "Stage": "overtaking.model.trajectories",
    "Trajectories": "overtaking.model.trajectories",
    "VehicleKind": "overtaking.model.vehicles",
    "VehicleSpecs": "overtaking.model.vehicles",
    "Verdict": "overtaking.model.verdicts",
    "Weather": "overtaking.model.weather",
    "branch": "overtaking.api.simulating",
    "compare_simulators": "overtaking.api.studies",
    "drive": "overtaking.api.simulating",
    "evaluate": "overtaking.api.evaluation",
    "run_benchmark": "overtaking.api.evaluation",
    "film": "overtaking.api.reports",
    "generate_dataset": "overtaking.api.datasets",
    "export_dataset": "overtaking.api.file_formats",
    "import_recording": "overtaking.api.file_formats",
    "label_recordings": "overtaking.api.file_formats",
    "label": "overtaking.api.simulating",
    "load_dataset": "overtaking.api.datasets",
    "list_opendrive_roads": "overtaking.recordings.opendrive_map",
    "plot": "overtaking.api.reports",
    "sql": "overtaking.api.datasets",
    "relabel_dataset": "overtaking.api.datasets",
    "reproduce_study": "overtaking.api.studies",
    "resume_dataset": "overtaking.api.datasets",
    "sample": "overtaking.api.simulating",
    "simulate": "overtaking.api.simulating",
    "dataset_statistics": "overtaking.api.studies",
    "validate_profile": "overtaking.api.studies",
    "write_report": "overtaking.api.reports",
    "serve_viewer": "overtaking.api.reports",
    "write_viewer_page": "overtaking.api.reports",
}
"""Public names, each with the module that defines it. Their order has no effect."""

_MODULES = ("carla", "law", "learning", "logic", "whatif")
"""Public modules, in the folder of this file."""

# For `from overtaking import *` and documentation tools. Pyright misses the names, because only
# `__getattr__` makes them.
__all__ = [*_HOMES, *_MODULES]  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    """Load a public name; Python calls this function for names that are not loaded yet."""
    if name == "__version__":
        value = _import_module("importlib.metadata").version(__name__)
    elif name in _MODULES:
        # Not checked as below: `import overtaking.law` does not call this function either.
        value = _import_module(f"{__name__}.{name}")
    elif name in _HOMES:
        # Compiled libraries end the process when they get no memory. So `check_address_space` first
        # raises a `SystemLimitError` if a limit of the system (`ulimit -v`) leaves too little; the
        # error names the public name. The module of `OvertakingError` loads no library and is not
        # checked, so that a program can always catch the error.
        if name != "OvertakingError":
            _import_module("overtaking.core.process_limits").check_address_space(name)
        value = getattr(_import_module(_HOMES[name]), name)
    else:
        message = f"overtaking: no public name {name!r}{_nearest(name)}; dir(overtaking) lists them"
        raise AttributeError(message, name=name)
    globals()[name] = value  # The next use of the name does not call this function.
    return value


def _nearest(name: str) -> str:
    """A question with the public name that is most similar to an unknown one; may be empty."""
    difflib = _import_module("difflib")
    # A guessed name is often a word of the right one: `load` of `load_dataset`.
    names = [public_name for public_name in __all__ if name in public_name.split("_")]
    names = names or difflib.get_close_matches(name, __all__, n=1)
    return f"; did you mean {names[0]}?" if names else ""


def __dir__() -> list[str]:
    """List the public names, loaded or not."""
    return sorted({*globals(), *__all__, "__version__"})
