"""Writes the names of parameters, constants and states for the engine, as Python declares them.

python crates/fields.py            writes crates/overtaking-core/src/names.rs
python crates/fields.py --check    fails if it is out of date
"""

from __future__ import annotations

import sys
import textwrap
from pathlib import Path

from overtaking.core.units import INTEGER_UNITS
from overtaking.model.batch import batch_fields
from overtaking.model.trajectories import States
from overtaking.world.constants import CONSTANT_NAMES
from overtaking.world.step_parameters import SIMULATION_FIELDS, VEHICLE_FIELDS

TARGET = Path(__file__).parent / "overtaking-core" / "src" / "names.rs"

CONTENT = """\
// Made by crates/fields.py from world/step_parameters.py, world/weather_parameters.py,
// world/constants.py and model/trajectories.py; do not edit.

use fearless_simd::Simd;
use fearless_simd::prelude::*;

use crate::math::vectors::{{LANES, Seats, V}};

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
"""

TYPES = {"int32": "i32", "int16": "i16", "uint8": "u8"}


def content() -> str:
    """The generated file."""
    return CONTENT.format(
        vehicle=_listed(VEHICLE_FIELDS),
        simulation=_listed(SIMULATION_FIELDS),
        constants=_listed(CONSTANT_NAMES),
        states=_states(),
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


def main(arguments: list[str]) -> int:
    """Write or check the file."""
    if arguments != ["--check"]:
        TARGET.write_text(content(), encoding="utf-8", newline="\n")
    elif TARGET.read_text(encoding="utf-8") != content():
        print(f"{TARGET.name} is out of date: run python crates/fields.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
