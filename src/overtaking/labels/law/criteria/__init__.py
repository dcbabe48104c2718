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
    simulations to which it applies. So `check` takes an unknown kind or road for one to which the
    rule applies. An input of `conditional_inputs` leaves some simulations decided.
Events and spans: an event is a frame of each simulation, `NEVER` (-1) where it does not occur. For
    `NEVER`, `at_frame` and `vehicle_snapshot` read frame 0, and `neighbour_at` finds no vehicle;
    the values are dropped later. A span such as `judged_span(case)` or `manoeuvre(case)` holds the
    first and last frame of each simulation. It ends before the ego collides, leaves the road or
    spins (`last_driven_frame`).
Scans: `scans(case)` holds results of the compiled engine, computed once for each batch.
    `following` and `forced_braking` are minima of margins, with the frames of the breach;
    `return_opportunity` is a first frame and a number of frames.
Belief: a percept holds the gap to a vehicle and the closing speed at a decision, as the driver saw
    them and as they were. `belief_at` tests `conditions`, the margins by perceived vehicle, with
    both; the result is `Finding.belief`, and the verdict depends on the true motion alone.
    `believed_margins` gives explanations the same margins.
Errors: in `ERROR_FORMULA`, sp and sv are the standard deviations of a position and of a speed, v
    and u are the speeds of the vehicles behind and ahead, dv is the closing speed, t the reaction
    time and b the deceleration of the safe distance; a number of the law stands by the name of its
    field. Without u, and in `predicate`, v is the speed of the ego.
    The errors of a vehicle are the same in all frames. A class without `standard_error` has a
    margin that they do not change, such as a range of sight or a lateral speed, or a margin whose
    error is neglected.
    `deciding_frame` finds the frame by the value of the margin, so it needs no mask of the frames
    that `check` leaves out: another frame has the same value only by chance, except at a capped
    margin, which several frames may share.
Lanes: lane 0 is the slowest, and indices grow to the left, the overtaking side. In left-hand
    traffic the world is mirrored, so left and right keep these meanings.
Float32: `minimum` and `maximum` of `core.float32_math` treat NaN and -0.0 as the engine does.
"""
