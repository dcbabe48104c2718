"""Statistics, validation, evaluation, what-if, learning, logic and SQL on data sets."""
