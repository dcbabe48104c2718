"""The common arguments of all compiled functions: the SIMD level and the constants."""

import os
from typing import Any

from overtaking import _core
from overtaking.core.errors import ConfigError
from overtaking.world.constants import Constants

SIMD_VARIABLE = "OVERTAKING_SIMD"
"""Environment variable that forces a SIMD level: avx512, avx2, sse2, neon or portable."""


def chosen_level(level: str | None = None) -> str | None:
    """The SIMD level to ask for: this one, that of `OVERTAKING_SIMD`, or None.

    Raises:
        ConfigError: It is unknown, or this CPU lacks it.
    """
    forced = level or os.environ.get(SIMD_VARIABLE) or None
    known = [name for name, is_available in _core.simd_levels() if is_available]
    if forced is not None and forced not in known:
        raise ConfigError.of(
            what="SIMD level",
            where=SIMD_VARIABLE,
            expected=", ".join(known),
            got=forced,
            next_step="unset it or choose another level",
        )
    return forced


def constant_values(c: Constants) -> dict[str, Any]:
    """The constants as the compiled engine takes them."""
    return {
        "values": [float(getattr(c, name)) for name in _core.constant_fields()],
        "friction_new": [[float(x) for x in row] for row in c.friction_new],
        "friction_worn": [[float(x) for x in row] for row in c.friction_worn],
        "friction_speeds": [float(x) for x in c.friction_speeds],
        "friction_films": [float(x) for x in c.friction_films],
    }
