"""The lowest package: errors, units, files, processes, elementary functions, random numbers."""
