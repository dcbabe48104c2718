"""Criteria: how the duties of a law are measured, one class for each way of measuring.

Two laws can share a criterion with different numbers. The modules do not import each other: their
shared functions and numbers are in `law.case`, `law.margins`, `law.measurement_errors`,
`law.remedies` and `law.numbers`.

- `alongside`: ego and target side by side (passing side, lateral distance, speed of the target);
- `following`: distance to the vehicle ahead;
- `lamps_and_indicators`: use of indicators, beam and fog lamps;
- `returning`: the return to the original lane, and the use of the right lane;
- `sight`: stopping within the sight distance, and enough sight to overtake;
- `speed`: speed limits, lowest speed on motorways, speed in fog;
- `starting`: begin of an overtake, and the vehicles that it must not endanger;
- `lines_and_lanes`: continuous lines, width of the lane on the left, lanes for trucks;
- `oncoming_traffic`: gaps to oncoming vehicles, their reaction, the gap to return into;
- `zones`: places and signs that forbid to overtake.

All criteria share these conventions:

Case: a `Case` is a batch of simulations, with one ego each. `check` and `standard_error` judge the
    whole batch. A remedy explains one breach: the case of a `BreachContext` holds one simulation,
    so remedies and `margins_by_frame` read index 0.
Unknown inputs: where an input of `required_inputs` is unknown, a rule is undecidable in all
    simulations to which it applies. So where the kind of a vehicle or of the road is unknown,
    `check` assumes a kind to which the rule applies. Where an input of `conditional_inputs` is
    unknown, the other inputs still decide some simulations.
Events and spans: an event is a frame of each simulation, `NEVER` (-1) where it does not occur. For
    `NEVER`, `at_frame` and `vehicle_snapshot` read frame 0, and `neighbour_at` finds no vehicle;
    the values are dropped later. A span such as `judged_span(case)` or `manoeuvre(case)` holds the
    first and last frame of each simulation. It ends before the ego collides, leaves the road or
    spins (`last_driven_frame`).
Scans: `scans(case)` holds results of the compiled engine, computed once for each batch.
    `following` and `forced_braking` are minima of margins, with the frames of the breach;
    `return_opportunity` is a first frame and a number of frames.
Belief: a percept holds the gap to a vehicle and the closing speed at a decision, as the driver saw
    them and as they were. `belief_at` computes the margin of each perceived vehicle from the
    believed and from the true values; its argument `conditions` has the functions. The result is
    `Finding.belief`; the verdict depends on the true motion alone. `believed_margins` gives
    explanations the same functions.
Errors: in `ERROR_FORMULA`, sp and sv are the standard deviations of a position and of a speed, v
    and u are the speeds of the vehicles behind and ahead, dv is the closing speed, t the reaction
    time and b the deceleration of the safe distance. A number of the law appears under the name of
    its field, such as `min_ttc`. In a formula without u, and in `predicate`, v is the speed of the
    ego.
    The errors of a vehicle are the same in all frames. A class without `standard_error` has a
    margin that these errors do not change, such as a range of sight or a lateral speed, or a margin
    whose error is neglected.
    `deciding_frame` finds the first frame of the span with the margin of the finding. It may
    also search frames that a rule exempts, such as those just after a cut-in: only by chance do
    they have this margin.
Lanes: lane 0 is the slowest, and indices grow to the left, the overtaking side. In left-hand
    traffic the world is mirrored, so left and right keep these meanings.
Float32: `minimum` and `maximum` of `core.float32_math` return the second value where one is NaN or
    both are zeros of different sign. So does the engine, and where both compute a result, it must
    have the same bits; NumPy's functions may return the other value.
"""
