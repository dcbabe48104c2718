"""The literature as data: the source paper's surveys, with corrections and their sources."""

from overtaking.literature.reading import datasets, factors, references, studies, systems
from overtaking.literature.records import (
    Correction,
    DrivingDataset,
    Factor,
    Study,
    StudyFactor,
    System,
)

__all__ = [
    "Correction",
    "DrivingDataset",
    "Factor",
    "Study",
    "StudyFactor",
    "System",
    "datasets",
    "factors",
    "references",
    "studies",
    "systems",
]
