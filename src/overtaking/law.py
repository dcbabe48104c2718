"""Laws: functions that judge data by a law, and the parts of rules and packs of your own.

A pack is the list of the rules of one law. The check of a rule is a function that takes a `Case`
(simulations with their signals) and returns a `Finding`: for each simulation a `Verdict` (such as
legal, illegal or undecidable), a margin (the distance to the limit where it is smallest, negative
in a breach, in the unit of the rule) and the first and last frame of a breach. A policy names the
rules of a pack that a legal overtake must not break, and tolerances: amounts by which the limit of
a rule may be exceeded.

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

- `Rule`, and the types of its attributes: `Text` (whether the author read the wording of the
  provision or knows it at second hand), `Grade` (how severe a breach of the rule is; the severity
  may depend on the road or on the breach) and `Spread` (a function that computes the standard
  deviation of the margin from errors of measurement);
- `Severity`: severity of one breach, as a finding states it;
- `adopt`: make a rule of another law with the check of an existing rule;
- `Pack`, and the packs `PORTUGAL` and `GERMANY`; `Policy`, `Tolerance`.

Input of a rule:

- `Case`; `MeasurementErrors`, the standard deviations of recorded positions and speeds;
- `NeighbourRole`: leader and follower in the lane of the ego and in the lanes beside it;
- `NEVER` (-1): the number of a frame if the event did not happen;
- `ENDLESS`: larger than any margin; a margin has this value in frames that do not count;
- `ROAD_KINDS` and `CLASSES`: kinds of roads and of vehicles with speed limits of their own.

Spans of frames to check (`Span`: the first and the last frame of each simulation):

- `manoeuvre`: from 3 s before the attempt to 3 s after its end;
- `conduct`: the manoeuvre, or the whole drive if there was no attempt;
- `settled`: `conduct` without its first seconds, in which a driver may restore a gap that another
  vehicle has taken before the recording;
- `passed`: from the frame in which the ego is past the target to the end of `manoeuvre`;
- `alongside`: no `Span`, but a list of the frames in which ego and target are side by side, at
  least in part, with the lateral gap between them;
- `frames_of`: number of frames in a number of seconds; `seconds_of`: the reverse.

Values at frames:

- `at`: a signal at one frame of each simulation;
- `encounter`: gap, closing speed and other measures of a neighbour at listed frames;
- `beside`: the measures of `encounter` at one frame of each simulation;
- `limits_of`: the lowest and the highest speed limit that may hold, because the kind of the road or
  of the ego can be unknown.

Functions that make a finding from margins (the smallest margin becomes the margin of the finding):

- `always`: a margin at all frames of a span;
- `always_at`: a margin at listed frames;
- `instant`: a margin at one frame of each simulation;
- `keeps_limit`: the speed under a limit;
- `decided`: a margin and frames that you have computed for each simulation.

Errors of measurement:

- `deciding`: the frame of a span at which the margin is smallest, where its error matters;
- `standard_error`: the standard deviation of a margin.

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
from overtaking.labels.law.case import CLASSES as CLASSES
from overtaking.labels.law.case import ROAD_KINDS as ROAD_KINDS
from overtaking.labels.law.case import alongside as alongside
from overtaking.labels.law.case import beside as beside
from overtaking.labels.law.case import conduct as conduct
from overtaking.labels.law.case import limits_of as limits_of
from overtaking.labels.law.case import manoeuvre as manoeuvre
from overtaking.labels.law.case import passed as passed
from overtaking.labels.law.case import seconds_of as seconds_of
from overtaking.labels.law.case import settled as settled
from overtaking.labels.law.germany import GERMANY as GERMANY
from overtaking.labels.law.judging import Policy as Policy
from overtaking.labels.law.margins import ENDLESS as ENDLESS
from overtaking.labels.law.margins import always as always
from overtaking.labels.law.margins import always_at as always_at
from overtaking.labels.law.margins import decided as decided
from overtaking.labels.law.margins import frames_of as frames_of
from overtaking.labels.law.margins import instant as instant
from overtaking.labels.law.measurement_errors import MeasurementErrors as MeasurementErrors
from overtaking.labels.law.measurement_errors import deciding as deciding
from overtaking.labels.law.measurement_errors import standard_error as standard_error
from overtaking.labels.law.portugal import PORTUGAL as PORTUGAL
from overtaking.labels.law.rule import Grade as Grade
from overtaking.labels.law.rule import Pack as Pack
from overtaking.labels.law.rule import Rule as Rule
from overtaking.labels.law.rule import Spread as Spread
from overtaking.labels.law.rule import Text as Text
from overtaking.labels.law.rule import Tolerance as Tolerance
from overtaking.labels.law.rule import adopt as adopt
from overtaking.labels.law.speed import keeps_limit as keeps_limit
from overtaking.labels.signals import encounter as encounter
from overtaking.labels.snapshots import Span as Span
from overtaking.labels.snapshots import at as at
from overtaking.model.neighbours import NeighbourRole as NeighbourRole
from overtaking.model.overtake_events import NEVER as NEVER
from overtaking.model.verdicts import Case as Case
from overtaking.model.verdicts import Finding as Finding
from overtaking.model.verdicts import Severity as Severity
from overtaking.model.verdicts import Verdict as Verdict
