"""Makes the pictures of docs/how-to/ask-what-if.md: a frame of a film of twins, and two fans.

    python docs/figures/what_if.py

writes `twins.webp`, `fan-truth.png` and `fan-belief.png` beside this file, from one simulated data
set. Nothing compares their bytes; make them anew when what they show looks different.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from PIL import Image

import overtaking as ot
from overtaking.show.video.scene import RATE
from overtaking.show.video.twin import TwinFilm

HERE = Path(__file__).parent
NUMBER, SECOND, FUTURES = 138, 8.5, 100


def main() -> None:
    """Write them."""
    with tempfile.TemporaryDirectory() as folder:
        data = ot.generate_dataset(
            "pinto2023-physical", num_simulations=NUMBER + 1, seed=1, out=Path(folder) / "pinto"
        )
        film = TwinFilm(ot.whatif.counterfactual(data, NUMBER, without=["rain"]))
        picture = Image.fromarray(film.draw(round(SECOND * RATE)).to_rgb())
        picture.save(HERE / "twins.webp", quality=60)
        for condition in ("truth", "belief"):
            found = ot.whatif.outcome_fan(data, NUMBER, condition_on=condition, futures=FUTURES)
            path = HERE / f"fan-{condition}.png"
            ot.plot(found, out=path)
            with Image.open(path) as drawn:
                small = drawn.convert("RGB").quantize(64)
            small.save(path, optimize=True)


if __name__ == "__main__":
    main()
