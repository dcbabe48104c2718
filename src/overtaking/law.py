"""Laws: functions that judge data by a law, and the parts of rules and packs of your own.

A pack is the list of the rules of one law. Each rule has a criterion, whose method `check` takes a
`Case` (simulations with their signals) and returns a `Finding`: for each simulation a `Verdict`
(such as legal, illegal or undecidable), a margin (the distance to the limit where it is smallest,
negative in a breach, in the unit of the rule) and the first and last frame of a breach. A policy
names the rules of a pack that a legal overtake must not break, and tolerances: amounts by which the
limit of a rule may be exceeded.

The ego is the vehicle that is judged, the target the vehicle that it overtakes. An attempt is an
overtake that has begun. A frame is a recorded instant; frames are numbered from 0. Signals are time
series of shape (simulation, time).

Functions that use a law:

- `judge`: judge a data set by another law or by other policies than its labels;
- `compare`: find the overtakes that are legal under one law and illegal under another;
- `explain`: explain each verdict on one simulation in English;
- `tolerance_curve`: count the legal overtakes for larger and larger tolerances;
- `undecidable_rules`: list the rules of `PORTUGAL`, the law of all labels by default, that cannot
  be decided where a recording lacks quantities such as the weather;
- `load_pack`, `policies_for`: find a pack by its name, and the policies for it.

Description of a rule and of a pack:

- `Criterion`: how a duty is measured; a subclass has a predicate and a check, and its fields are
  the numbers of the law, each made by `quantity` with unit, source and reason (`Quantity`);
- `BreachContext`: a breach, from which a criterion computes its remedies;
- `Rule`, and the types of its attributes: `TextSource` (whether the author read the wording of the
  provision or knows it at second hand) and `Grade` (how severe a breach of the rule is; the
  severity may depend on the road or on the breach);
- `Severity`: severity of one breach, as a finding states it;
- `Pack`, and the packs `PORTUGAL` and `GERMANY`; `Policy`, `Tolerance`.

Input of a rule:

- `Case`; `MeasurementErrors`, the standard deviations of recorded positions and speeds;
- `NeighbourRole`: leader and follower in the lane of the ego and in the lanes beside it;
- `NEVER` (-1): the number of a frame if the event did not happen;
- `UNCONSTRAINED`: larger than any margin; a margin has this value in frames that do not count;
- `GeneralSpeedLimits` and `ClassSpeedLimits`: speed limits that hold without a sign, by kind of
  road and class of vehicle.

Spans of frames to check (`FrameSpan`: the first and the last frame of each simulation):

- `manoeuvre`: from 3 s before the attempt to 3 s after its end;
- `judged_span`: the manoeuvre, or the whole drive if there was no attempt;
- `span_after_gap_recovery`: `judged_span` without its first seconds, in which a driver may restore
  a gap that another vehicle has taken before the recording;
- `span_after_passing`: from the frame in which the ego is past the target to the end of
  `manoeuvre`;
- `alongside`: no `FrameSpan`, but a list of the frames in which ego and target are side by side, at
  least in part, with the lateral gap between them;
- `num_frames_in`: number of frames in a number of seconds; `seconds_of`: the reverse.

Values at frames:

- `at_frame`: a signal at one frame of each simulation;
- `encounters_at`: gap, closing speed and other measures of a neighbour at listed frames;
- `neighbour_at`: the measures of `encounters_at` at one frame of each simulation;
- `speed_limit_bounds`: the lowest and the highest speed limit that may hold, because the kind of
  the road or of the ego can be unknown.

Functions that make a finding from margins (the smallest margin becomes the margin of the finding):

- `finding_over_span`: a margin at all frames of a span;
- `finding_at_instants`: a margin at listed frames;
- `finding_at_frame`: a margin at one frame of each simulation;
- `keeps_limit`: the speed under a limit;
- `finding_from_margins`: a margin and frames that you have computed for each simulation.

Errors of measurement:

- `deciding_frame`: the frame of a span at which the margin is smallest, where its error matters;
- `propagated_error`: the standard deviation of a margin.

`docs/how-to/write-a-rule.md` shows a pack of two rules.
"""

# `import x as x` marks a name as public for type checkers.
from overtaking.api.law import compare as compare
from overtaking.api.law import explain as explain
from overtaking.api.law import judge as judge
from overtaking.api.law import load_pack as load_pack
from overtaking.api.law import policies_for as policies_for
from overtaking.api.law import tolerance_curve as tolerance_curve
from overtaking.api.law import undecidable_rules as undecidable_rules
from overtaking.knowledge.quantities import Quantity as Quantity
from overtaking.labels.law.case import ClassSpeedLimits as ClassSpeedLimits
from overtaking.labels.law.case import GeneralSpeedLimits as GeneralSpeedLimits
from overtaking.labels.law.case import alongside as alongside
from overtaking.labels.law.case import judged_span as judged_span
from overtaking.labels.law.case import manoeuvre as manoeuvre
from overtaking.labels.law.case import neighbour_at as neighbour_at
from overtaking.labels.law.case import seconds_of as seconds_of
from overtaking.labels.law.case import span_after_gap_recovery as span_after_gap_recovery
from overtaking.labels.law.case import span_after_passing as span_after_passing
from overtaking.labels.law.case import speed_limit_bounds as speed_limit_bounds
from overtaking.labels.law.criteria.speed import keeps_limit as keeps_limit
from overtaking.labels.law.germany import GERMANY as GERMANY
from overtaking.labels.law.judging import Policy as Policy
from overtaking.labels.law.margins import UNCONSTRAINED as UNCONSTRAINED
from overtaking.labels.law.margins import finding_at_frame as finding_at_frame
from overtaking.labels.law.margins import finding_at_instants as finding_at_instants
from overtaking.labels.law.margins import finding_from_margins as finding_from_margins
from overtaking.labels.law.margins import finding_over_span as finding_over_span
from overtaking.labels.law.margins import num_frames_in as num_frames_in
from overtaking.labels.law.measurement_errors import MeasurementErrors as MeasurementErrors
from overtaking.labels.law.measurement_errors import deciding_frame as deciding_frame
from overtaking.labels.law.measurement_errors import propagated_error as propagated_error
from overtaking.labels.law.numbers import quantity as quantity
from overtaking.labels.law.portugal import PORTUGAL as PORTUGAL
from overtaking.labels.law.remedies import BreachContext as BreachContext
from overtaking.labels.law.rule import Criterion as Criterion
from overtaking.labels.law.rule import Grade as Grade
from overtaking.labels.law.rule import Pack as Pack
from overtaking.labels.law.rule import Rule as Rule
from overtaking.labels.law.rule import TextSource as TextSource
from overtaking.labels.law.rule import Tolerance as Tolerance
from overtaking.labels.signals import encounters_at as encounters_at
from overtaking.labels.snapshots import FrameSpan as FrameSpan
from overtaking.labels.snapshots import at_frame as at_frame
from overtaking.model.neighbours import NeighbourRole as NeighbourRole
from overtaking.model.overtake_events import NEVER as NEVER
from overtaking.model.verdicts import Case as Case
from overtaking.model.verdicts import Finding as Finding
from overtaking.model.verdicts import Severity as Severity
from overtaking.model.verdicts import Verdict as Verdict
