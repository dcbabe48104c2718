"""Install a wheel or a source distribution into an empty environment, and try it there.

    python tests/try_wheel.py dist/overtaking-*.whl

Needs nothing of the clone: environment and working directory lie in a temporary folder.
"""

import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

TRIAL = """
import overtaking as ot
scenarios = ot.sample("pinto2023-physical", num_simulations=4, seed=1)
runs = ot.simulate(scenarios)
twin = ot.simulate(scenarios, simulator="reference")
assert (runs.trace_hash == twin.trace_hash).all(), "engine and reference differ"
print(ot.__version__, ot.label(runs).labels.classes.shape, ot.__file__)
"""


def main() -> None:
    """Install, import, simulate, generate."""
    package = Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        venv.create(folder / "env", with_pip=True)
        programs = folder / "env" / ("Scripts" if os.name == "nt" else "bin")
        for command in (
            ["python", "-m", "pip", "install", "--quiet", str(package)],
            ["python", "-c", TRIAL],
            ["overtaking", "doctor"],
            ["overtaking", "generate", "-n", "20", "--out", "scenes"],
            ["overtaking", "show", "scenes", "3"],
            ["overtaking", "view", "scenes", "--export", "page.html"],
        ):
            subprocess.run([programs / command[0], *command[1:]], cwd=folder, check=True)


if __name__ == "__main__":
    main()
