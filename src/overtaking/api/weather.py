"""Weather without rain, wind, fog or night, for branches: `weather.dry(scenario.weather)`."""

from overtaking.world.skies import WITHOUT, bright, clear, dry, still, undazzled, without

__all__ = ["WITHOUT", "bright", "clear", "dry", "still", "undazzled", "without"]
