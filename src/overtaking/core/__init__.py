"""The lowest layer: errors, units, files, processes, elementary functions, random numbers."""
