"""The public functions: what to call from Python, and which simulator they call."""

from overtaking.api import rules, weather
from overtaking.api.carla import carla_limits, replay_in_carla, serve_carla
from overtaking.api.choices import BRANCHING, SIMULATORS, Profile, simulator_of
from overtaking.api.data import generate, judged, load, relabel, resume
from overtaking.api.driving import drive, driver_of
from overtaking.api.evaluating import (
    evaluate,
    evaluate_benchmark,
    policy_of,
    write_evaluation,
)
from overtaking.api.formats import (
    EXPORTS,
    export,
    from_table,
    import_recording,
    label_recordings,
    write_column_map,
)
from overtaking.api.law import law_compare, law_curve, law_explain
from overtaking.api.learning import learn_factors, learn_rules
from overtaking.api.logic import ask, prove
from overtaking.api.maps import map_roads
from overtaking.api.plotting import plot
from overtaking.api.results import (
    entity_relationship_diagram,
    film,
    literature,
    query,
    reproduce,
    serve_view,
    statistics,
    validate,
    write_report,
    write_reproduction,
    write_view,
)
from overtaking.api.simulating import branch, compare, label, lacking, sample, simulate
from overtaking.api.whatif import (
    branch_again,
    enough,
    fan,
    film_twin,
    save_branches,
    save_twin,
    twin,
)
from overtaking.data.load import Dataset

__all__ = [
    "BRANCHING",
    "EXPORTS",
    "SIMULATORS",
    "Dataset",
    "Profile",
    "ask",
    "branch",
    "branch_again",
    "carla_limits",
    "compare",
    "drive",
    "driver_of",
    "enough",
    "entity_relationship_diagram",
    "evaluate",
    "evaluate_benchmark",
    "export",
    "fan",
    "film",
    "film_twin",
    "from_table",
    "generate",
    "import_recording",
    "judged",
    "label",
    "label_recordings",
    "lacking",
    "law_compare",
    "law_curve",
    "law_explain",
    "learn_factors",
    "learn_rules",
    "literature",
    "load",
    "map_roads",
    "plot",
    "policy_of",
    "prove",
    "query",
    "relabel",
    "replay_in_carla",
    "reproduce",
    "resume",
    "rules",
    "sample",
    "save_branches",
    "save_twin",
    "serve_carla",
    "serve_view",
    "simulate",
    "simulator_of",
    "statistics",
    "twin",
    "validate",
    "weather",
    "write_column_map",
    "write_evaluation",
    "write_report",
    "write_reproduction",
    "write_view",
]
