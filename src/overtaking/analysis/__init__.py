"""Numbers about data sets: statistics, validation, reproduction, learning, logic, SQL."""
