"""The literature as data: the source paper's surveys, with corrections and their sources."""

from overtaking.analysis.literature.reading import datasets, factors, references, studies, systems
from overtaking.analysis.literature.records import (
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
