"""Data sets on disk: a recipe carried out shard by shard, and the way back to its simulations."""
