"""Criteria: how the duties of a law are measured, one class for each way of measuring.

Two laws can share a criterion with different numbers. A criterion does not import another one: what
two of them share is in `law.case`, `law.margins`, `law.measurement_errors` or `law.remedies`.

- `alongside`: ego and target side by side (passing side, lateral distance, speed of the target).
"""
