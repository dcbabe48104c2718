"""Criteria: how the duties of a law are measured, one class for each way of measuring.

Two laws can share a criterion with different numbers. The modules do not import each other: their
shared functions and numbers are in `law.case`, `law.margins`, `law.measurement_errors`,
`law.remedies` and `law.numbers`.

- `alongside`: ego and target side by side (passing side, lateral distance, speed of the target);
- `following`: distance to the vehicle ahead;
- `lamps_and_indicators`: use of indicators, beam and fog lamps;
- `returning`: the return to the original lane, and the use of the right lane;
- `starting`: begin of an overtake, and the vehicles that it must not endanger;
- `lines_and_lanes`: continuous lines, width of the lane on the left, lanes for trucks;
- `zones`: places and signs that forbid to overtake.
"""
