"""Numbers about vehicles, roads, weather and drivers, each with unit and source, from TOML files.

- `carla_catalogue`: CARLA's vehicles, props and weather presets
- `glossary`: the words of the package
- `quantities`: `Quantity`, `Distribution`, `Source`, and how an entry of a file becomes one
- `roads`: sight facts and general speed limits
- `toml_reader`: TOML files as typed, frozen records; tables that state units once
- `vehicle_classes`: the seven vehicle classes and eight colours
"""
