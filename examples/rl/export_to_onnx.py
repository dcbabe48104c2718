r"""Write a trained driver as an ONNX file, which needs neither PyTorch nor this folder to drive.

    python examples/rl/export_to_onnx.py learned.zip learned.onnx
    overtaking evaluate motorway --driver learned.onnx --observation truth \
        --action decision --action-repeat 20

Bounds, scales and the rule that guards it become a part of the network: it takes the numbers of an
observation as they are, and answers a `Move`.
"""

# pyright: reportMissingImports=false, reportUnknownParameterType=false
# pyright: reportUntypedBaseClass=false, reportUnknownVariableType=false

import argparse
from pathlib import Path

import onnx
import torch
from examples.rl.learn_to_overtake import guarded
from stable_baselines3 import PPO
from torch import Tensor, nn

from overtaking.gym import OBSERVATION_COLUMNS


class Driver(nn.Module):
    """The likeliest move of a trained policy, guarded."""

    def __init__(self, model: PPO) -> None:
        """Take the layers that answer, and not those that judge."""
        super().__init__()
        policy = model.policy
        self.layers = nn.Sequential(
            policy.features_extractor, policy.mlp_extractor.policy_net, policy.action_net
        )
        for name in ("least", "most", "scale"):
            self.register_buffer(
                name, torch.tensor([getattr(one, name) for one in OBSERVATION_COLUMNS])
            )

    def forward(self, numbers: Tensor) -> Tensor:
        """A move for each simulation, shape (simulation, 1)."""
        seen = torch.clip(numbers, self.least, self.most) / self.scale
        move = self.layers(seen).argmax(dim=1)
        return guarded(move, seen, torch.where)[:, None]


def export(model: PPO, path: Path) -> None:
    """Write an ONNX file.

    Args:
        model: What `train` returns.
        path: The file.
    """
    some = torch.zeros(2, len(OBSERVATION_COLUMNS))
    rows = {"numbers": {0: torch.export.Dim("simulation")}}
    torch.onnx.export(
        Driver(model).eval(), (some,), str(path), dynamic_shapes=rows, external_data=False
    )
    written = onnx.load(path)
    for one in (*written.graph.node, *written.graph.value_info):
        one.ClearField("metadata_props")  # Where in which file of this machine it was computed.
    onnx.save(written, path)


def main() -> None:
    """Read and write."""
    options = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    options.add_argument("learned", type=Path)
    options.add_argument("out", type=Path)
    given = options.parse_args()
    export(PPO.load(given.learned, device="cpu"), given.out)
    print(f"{given.out}: {given.out.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
