"""Data sets on disk: writes them shard by shard from a recipe, and loads their simulations."""
