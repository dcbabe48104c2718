"""The literature as data: the source paper's surveys, with corrections and their sources."""

from overtaking.analysis.literature.reading import datasets, factors, references, studies, systems

__all__ = ["datasets", "factors", "references", "studies", "systems"]
