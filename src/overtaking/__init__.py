"""overtaking."""
