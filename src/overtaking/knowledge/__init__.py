"""Numbers about vehicles, roads, weather and drivers, each with unit and source."""
