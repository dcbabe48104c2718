"""The public functions: what to call from Python, and which simulator they call."""

from overtaking.api import rules
from overtaking.api.carla import measure_limits, replay, serve
from overtaking.api.choices import BRANCHING, SIMULATORS, Profile, simulator_of
from overtaking.api.data import (
    generate_dataset,
    judged,
    load_dataset,
    relabel_dataset,
    resume_dataset,
)
from overtaking.api.driving import drive, load_driver
from overtaking.api.evaluating import (
    evaluate,
    resolve_driver,
    run_benchmark,
)
from overtaking.api.formats import (
    EXPORT_FORMATS,
    export_dataset,
    import_recording,
    label_recordings,
    trajectories_from_table,
    write_column_map,
)
from overtaking.api.law import compare, explain, tolerance_curve
from overtaking.api.learning import learn_factors, learn_rules
from overtaking.api.logic import ask, prove
from overtaking.api.maps import list_opendrive_roads
from overtaking.api.plotting import plot
from overtaking.api.results import (
    dataset_statistics,
    film,
    reproduce_study,
    serve_viewer,
    sql,
    validate_profile,
    write_report,
    write_viewer_page,
)
from overtaking.api.simulating import (
    branch,
    compare_simulators,
    label,
    sample,
    simulate,
    undecidable_rules,
)
from overtaking.api.whatif import (
    counterfactual,
    outcome_fan,
    resimulate_branch,
    save_branches,
    sufficient_changes,
)
from overtaking.data.load import Dataset

__all__ = [
    "BRANCHING",
    "EXPORT_FORMATS",
    "SIMULATORS",
    "Dataset",
    "Profile",
    "ask",
    "branch",
    "compare",
    "compare_simulators",
    "counterfactual",
    "dataset_statistics",
    "drive",
    "evaluate",
    "explain",
    "export_dataset",
    "film",
    "generate_dataset",
    "import_recording",
    "judged",
    "label",
    "label_recordings",
    "learn_factors",
    "learn_rules",
    "list_opendrive_roads",
    "load_dataset",
    "load_driver",
    "measure_limits",
    "outcome_fan",
    "plot",
    "prove",
    "relabel_dataset",
    "replay",
    "reproduce_study",
    "resimulate_branch",
    "resolve_driver",
    "resume_dataset",
    "rules",
    "run_benchmark",
    "sample",
    "save_branches",
    "serve",
    "serve_viewer",
    "simulate",
    "simulator_of",
    "sql",
    "sufficient_changes",
    "tolerance_curve",
    "trajectories_from_table",
    "undecidable_rules",
    "validate_profile",
    "write_column_map",
    "write_report",
    "write_viewer_page",
]
