"""What every layer stands on: errors, units, elementary functions and random numbers."""
