"""Old import paths work for one release, and warn."""

import importlib

import pytest


@pytest.mark.parametrize(
    ("module", "name", "home"),
    [
        ("overtaking.sim.decision", "Decision", "overtaking.model.decision"),
        ("overtaking.exchange.pinto2023", "read_table", "overtaking.recordings.pinto2023"),
        ("overtaking.explain", "explain", "overtaking.labels.explain"),
        ("overtaking.plots.classes", "draw_classes", "overtaking.show.plots.distributions"),
        ("overtaking.plots.style", "to_svg", "overtaking.show.plots.style"),
        ("overtaking.rules", "PORTUGAL", "overtaking.labels.law"),
        ("overtaking.learning.splits", "split", "overtaking.analysis.learning.models"),
        ("overtaking.video.film", "Film", "overtaking.show.video.film"),
    ],
)
def test_an_old_path_gives_the_same_object_and_warns(module: str, name: str, home: str):
    with pytest.warns(DeprecationWarning, match=f"{module} is {home} now"):
        found = getattr(importlib.import_module(module), name)
    assert found is getattr(importlib.import_module(home), name)


@pytest.mark.parametrize("module", ["overtaking.nonsense", "overtaking.plots.nonsense"])
def test_a_path_that_never_was_is_not_found(module: str):
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module(module).anything  # noqa: B018
