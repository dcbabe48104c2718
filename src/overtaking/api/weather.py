"""Weather with something taken away, for branches: `weather.dry(scenario.weather)` and friends."""

from overtaking.world.skies import WITHOUT, bright, clear, dry, still, undazzled, without

__all__ = ["WITHOUT", "bright", "clear", "dry", "still", "undazzled", "without"]
