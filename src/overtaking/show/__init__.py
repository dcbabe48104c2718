"""Pictures of numbers: figures, reports, films."""
