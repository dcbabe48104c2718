"""The workers of a PyTorch `DataLoader`, which Linux forks by default, simulate."""

# pyright: reportMissingImports=false

from __future__ import annotations

import pytest

import overtaking as ot

pytestmark = pytest.mark.rl
torch = pytest.importorskip("torch", reason="run by make test-rl")


class Speeds(torch.utils.data.Dataset):
    """Speeds of the ego in simulations that are made when they are asked for."""

    def __len__(self) -> int:
        return 8

    def __getitem__(self, index: int) -> object:  # A tensor; torch is not in .venv.
        runs = ot.simulate(ot.sample("pinto2023-physical", num_simulations=1, seed=index))
        return torch.as_tensor(runs.states.speed[0, 0, :100].astype("float32"))


def test_two_workers_simulate_what_their_parent_does():
    speeds = Speeds()
    expected = torch.stack([speeds[index] for index in range(len(speeds))])
    loader = torch.utils.data.DataLoader(speeds, batch_size=4, num_workers=2, timeout=300)
    assert torch.equal(torch.cat(list(loader)), expected)
