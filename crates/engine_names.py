"""Write names and codes that the engine shares with Python, as Python declares them.

python crates/engine_names.py            write crates/overtaking-core/src/names.rs
python crates/engine_names.py --check    fail if that file is out of date
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from overtaking.core.units import INTEGER_UNITS
from overtaking.model.batch import batch_fields
from overtaking.model.driver_interface import ACTION_KINDS, MAX_ACTION_PARTS, Move
from overtaking.model.neighbours import NeighbourRole
from overtaking.model.scenario import ForcedDecision
from overtaking.model.trajectories import Lights, Stage, States
from overtaking.world.constants import CONSTANT_NAMES
from overtaking.world.step_parameters import SIMULATION_FIELDS, VEHICLE_FIELDS

if TYPE_CHECKING:
    from enum import Enum

TARGET = Path(__file__).parent / "overtaking-core" / "src" / "names.rs"

CONTENT = """\
// Made by crates/engine_names.py from world/step_parameters.py, world/weather_parameters.py,
// world/constants.py, model/trajectories.py, model/scenario.py, model/neighbours.py and
// model/driver_interface.py; do not edit.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{{CopyLane, F32, SIMD_LANES}};

parameter_rows! {{
    /// Parameters of one vehicle slot.
    VehicleParams, VEHICLE_NAMES {{
{vehicle}
    }}
}}

parameter_rows! {{
    /// Parameters of a simulation.
    SimulationParams, SIMULATION_NAMES {{
{simulation}
    }}
}}

named_constants! {{
    /// Constants of the model.
    ModelConstants {{
{constants}
    }}
}}

/// Hand the recorded states of a vehicle to a macro, in order: meaning, name and type.
#[macro_export]
macro_rules! with_states {{
    ($then:ident! {{ $($given:tt)* }}) => {{
        $then! {{
            {{ $($given)* }}
{states}
        }}
    }};
}}

{codes}

/// Hand the kinds of action to a macro: parts, name, and steps to a unit of each part.
macro_rules! with_action_kinds {{
    ($then:ident!) => {{
        $then! {{
{action_kinds}
        }}
    }};
}}
"""

CODES = (
    ("stage", Stage, "f32"),
    ("forced_decision", ForcedDecision, "f32"),
    ("ego_move", Move, "f32"),
    ("lights", Lights, "i32"),
    ("neighbour_role", NeighbourRole, "usize"),
)
"""Modules of constants: name, enumeration, and the type that the engine computes with."""

TYPES = {"int32": "i32", "int16": "i16", "uint8": "u8"}


def content() -> str:
    """The generated file."""
    return CONTENT.format(
        vehicle=_listed(VEHICLE_FIELDS),
        simulation=_listed(SIMULATION_FIELDS),
        constants=_listed(CONSTANT_NAMES),
        states=_states(),
        codes="\n\n".join(_codes(*module) for module in CODES),
        action_kinds=_action_kinds(),
    )


def _listed(names: tuple[str, ...]) -> str:
    return textwrap.fill(
        ", ".join(names) + ",", 100, initial_indent=" " * 8, subsequent_indent=" " * 8
    )


def _states() -> str:
    lines: list[str] = []
    for name, field in batch_fields(States).items():
        unit = f" [{field.spec.unit}]" if field.spec.unit in INTEGER_UNITS else ""
        lines += [f"/// {field.spec.meaning}{unit}.", f"{name}: {TYPES[str(field.dtype)]},"]
    return textwrap.indent("\n".join(lines), " " * 12)


def _codes(name: str, enumeration: type[Enum], kind: str) -> str:
    """A module with a constant for each member of an enumeration."""
    point = ".0" if kind == "f32" else ""
    lines = [
        f"/// Members of `{enumeration.__module__}.{enumeration.__name__}`.",
        "#[allow(missing_docs, dead_code)]",
        f"pub mod {name} {{",
        *(
            f"    pub const {member.name}: {kind} = {member.value}{point};"
            for member in enumeration
        ),
        "}",
    ]
    return "\n".join(lines)


def _action_kinds() -> str:
    lines: list[str] = []
    for name, parts in ACTION_KINDS.items():
        scales = [float(round(1.0 / part.resolution)) for part in parts]
        scales += [1.0] * (MAX_ACTION_PARTS - len(parts))
        variant = "".join(word.capitalize() for word in name.split("_"))
        described = ", ".join(f"{part.name} [{part.unit}]" for part in parts)
        lines += [f"/// {described[0].upper()}{described[1:]}.", f'{variant}, "{name}", {scales};']
    return textwrap.indent("\n".join(lines), " " * 12)


def main(arguments: list[str]) -> int:
    """Write or check the file."""
    if arguments != ["--check"]:
        TARGET.write_text(content(), encoding="utf-8", newline="\n")
    elif TARGET.read_text(encoding="utf-8") != content():
        print(f"{TARGET.name} is out of date: run python crates/engine_names.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
