"""Prints how long attempts had waited: `matched.waiting_time_quantiles` of `event_detection.toml`.

    python calibration/waiting_times.py          # 20,000 simulations of each profile, seed 1

Without an attempt, the matched reading of the features draws its instant from these.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

import overtaking
from overtaking.scenarios.profiles import profile_names


def main() -> None:
    """Print minimum, deciles and maximum for each profile."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", "--simulations", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    for profile in profile_names():
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "data"
            data = overtaking.generate_dataset(
                profile,
                num_simulations=given.simulations,
                seed=given.seed,
                out=out,
                keep="features",
            )
            events, waited = data.events(), data.features(reading="matched")["WT"]
        attempts = waited[events["simulation"][events["event"] == "attempt"]].dropna()
        quantiles = np.quantile(attempts, np.linspace(0.0, 1.0, 11)).round(2).tolist()
        print(f"{profile}: {len(attempts):,} attempts, {quantiles} s")


if __name__ == "__main__":
    main()
