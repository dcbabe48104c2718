"""Our simulations beside every number that the source paper states."""
