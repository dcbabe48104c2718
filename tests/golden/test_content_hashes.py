"""Small data sets of each profile say what they said: every recorded number and every label."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import overtaking as ot

GOLDEN = Path(__file__).with_name("content_hashes.json")
"""Content hash of each profile's data set. A change is an entry under Data in the changelog:
`python tests/golden/test_content_hashes.py` writes the file anew."""

COUNTS = {
    "pinto2023": 256,
    "pinto2023-physical": 256,
    "motorway": 24,
    "motorway-risk": 24,
    "rural": 24,
    "rural-risk": 24,
}


def content_hash(profile: str, folder: Path) -> str:
    found = ot.generate_dataset(
        profile, num_simulations=COUNTS[profile], seed=7, out=folder
    ).manifest.content_hash
    assert found is not None
    return found


@pytest.mark.parametrize("profile", COUNTS)
def test_a_data_set_has_the_content_that_it_had(profile: str, tmp_path: Path):
    expected = json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert content_hash(profile, tmp_path / "data") == expected[profile]


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        hashes = {profile: content_hash(profile, Path(name, profile)) for profile in COUNTS}
    GOLDEN.write_text(json.dumps(hashes, indent=2) + "\n", encoding="utf-8")
