"""Numbers about vehicles, roads, weather and drivers, each with unit and source, from TOML files.

- `carla_catalogue`: CARLA's vehicles, props and weather presets
- `glossary`: names that users see, such as classes and features, with their meanings
- `quantities`: `Quantity`, `Distribution`, `Source`, parsed from entries of the files
- `roads`: numbers for sight, and speed limits of roads without signs
- `toml_reader`: reads numbers, quantities and dataclasses from the files by name
- `vehicle_classes`: the seven vehicle classes and eight colours
"""
