"""Asks the checkers of ASAM for issues of OpenSCENARIO and OpenDRIVE files.

They pin a NumPy that the package cannot live with, so they have an environment of their own, and
this script imports nothing of the package. `make test-qc` makes it and asks; by hand:

    overtaking export data/pinto --format openscenario --out build/scenarios
    .venv-qc/bin/python benchmarks/oracles/asam_qc.py build/scenarios

It prints every issue. It ends with 1 if there is an issue or no file, or if a check failed.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

BUNDLES = {".xosc": ("qc_openscenario", "xoscBundle"), ".xodr": ("qc_opendrive", "xodrBundle")}
"""Module and bundle of checks, by the ending of a file."""


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="files, or folders with files")
    logging.disable(logging.INFO)
    files = [
        file.resolve()
        for folder in parser.parse_args().folders
        for file in (sorted(folder.iterdir()) if folder.is_dir() else [folder])
        if file.suffix in BUNDLES
    ]
    total, issues = Counter[str](), list[str]()
    for file in files:
        checks, found = checked(file)
        total.update(checks)
        issues += [f"{file.name}: {one}" for one in found]
    checks = ", ".join(f"{count} checks {name}" for name, count in sorted(total.items()))
    print(*issues, f"{len(files)} files, {checks}, {len(issues)} issues", sep="\n")
    return 1 if issues or not files or total["error"] else 0


def checked(file: Path) -> tuple[list[str], list[str]]:
    """How each check of a file ended, and its issues."""
    module, bundle = BUNDLES[file.suffix]
    base = importlib.import_module("qc_baselib")
    run: Any = importlib.import_module(f"{module}.main")
    with tempfile.TemporaryDirectory() as folder:
        config = base.Configuration()
        config.set_config_param("InputFile", str(file))
        config.register_checker_bundle(bundle)
        config.set_checker_bundle_param(bundle, "resultFile", str(Path(folder, "result.xqar")))
        result = base.Result()
        version = importlib.import_module(f"{module}.constants").BUNDLE_VERSION
        result.register_checker_bundle(name=bundle, description="", version=version, summary="")
        run.run_checks(config, result)
    checkers = result.get_checker_results(bundle)
    issues = [
        f"{one.description} {[place.description for place in one.locations]}"
        for checker in checkers
        for one in checker.issues
    ]
    return [str(checker.status.value) for checker in checkers], issues


if __name__ == "__main__":
    raise SystemExit(main())
