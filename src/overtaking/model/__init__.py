"""The nouns: road, vehicles, drivers, weather, scenario and what was recorded of it."""
