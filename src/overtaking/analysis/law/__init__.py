"""The law over many overtakes: the effect of tolerances, and differences between two laws."""
