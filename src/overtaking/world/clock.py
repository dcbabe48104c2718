"""The clock of a simulation in whole numbers; `[time]` of `model.toml` says why it ticks so."""

import numpy as np

STEP_MS = 10
"""Length of a step [ms]."""

SUBSTEPS = 5
"""Steps between two decisions."""

STEPS_PER_SECOND = np.float32(1000 // STEP_MS)
DECISIONS_PER_SECOND = np.float32(1000 // (STEP_MS * SUBSTEPS))
