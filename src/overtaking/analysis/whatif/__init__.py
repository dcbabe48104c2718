"""What if: twins of a simulation, its futures, and the changes that would have been enough."""
