"""What the figures of a report show, as plain numbers; run it to write them anew."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from overtaking.analysis.stats.associations import associations
from overtaking.analysis.stats.columns import FEATURES
from overtaking.analysis.stats.distributions import (
    Box,
    boxes_by_class,
    histogram,
    pair_points,
    scaled_boxes,
    swarm_points,
    typical,
)
from overtaking.analysis.stats.results import statistics

FOLDER = Path(__file__).parent
FEATURES_FILE, PINNED = FOLDER / "features.csv", FOLDER / "figures.json"
SIGNIFICANT = 9  # Digits: far more than a figure shows, fewer than sums in another order keep.


def features() -> pd.DataFrame:
    """The frame that the figures are of."""
    return pd.read_csv(FEATURES_FILE, index_col="simulation", keep_default_na=False, na_values=[""])


def figure_numbers(frame: pd.DataFrame) -> dict[str, Any]:
    """The numbers of every figure."""
    found = statistics(frame, policy="paper")
    sample = found.sample
    related = associations(sample)
    assert found.waiting is not None
    return plain(
        {
            "classes": found.classes.rows.to_dict(orient="list"),
            "waiting": found.waiting.rows().to_dict(orient="list"),
            "histograms": {
                one.name: {
                    "edges": histogram(sample, one.name).edges,
                    "levels": list(histogram(sample, one.name).levels),
                    "counts": histogram(sample, one.name).counts,
                }
                for one in FEATURES
            },
            "boxes": {name: of_box(one) for name, one in scaled_boxes(sample).items()},
            "speed_by_class": {
                name: of_box(one) for name, one in boxes_by_class(sample, "SE").items()
            },
            "swarm": {
                name: one.simulations for name, one in swarm_points(sample, "SE", most=5).items()
            },
            "pairs": pair_points(sample, most=40).simulations,
            "typical": typical(sample),
            "associations": {
                "names": list(related.names),
                "values": related.values,
                "p_values": related.p_values,
                "q_values": related.q_values,
            },
        }
    )


def of_box(one: Box) -> dict[str, Any]:
    """A box as plain values."""
    return {
        "count": one.count,
        "quartiles": list(one.quartiles),
        "whiskers": list(one.whiskers),
        "outliers": one.outliers,
    }


def plain(value: Any) -> Any:
    """A value as JSON has it, numbers rounded to significant digits, null for none."""
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | np.ndarray):
        return [plain(one) for one in value]
    if isinstance(value, float | np.floating):
        return None if np.isnan(value) else float(f"{value:.{SIGNIFICANT}g}")
    return int(value) if isinstance(value, np.integer) else value


if __name__ == "__main__":
    text = json.dumps(figure_numbers(features()), indent=1, ensure_ascii=False)
    PINNED.write_text(text + "\n", encoding="utf-8")
