"""Laws: functions that judge data by a law, and the parts of rules and packs of your own.

A pack is the list of the rules of one law. The check of a rule is a function that takes a `Case`
(simulations with their signals) and returns a `Finding`: for each simulation a `Verdict`, a margin
(negative in a breach, in the unit of the rule) and the frames of a breach. A policy says which
rules of a pack an overtake must keep, and with which tolerances.

The ego is the vehicle that is judged, the target the vehicle that it overtakes. An attempt is an
overtake that has begun. Signals are time series of shape (simulation, time).

Functions that use a law:

- `judge`: judge a data set by another law or other policies;
- `compare`: find the overtakes that are legal under one law and illegal under another;
- `explain`: explain each verdict on one simulation in English;
- `tolerance_curve`: count legal overtakes by tolerance;
- `undecidable_rules`: list the rules of `PORTUGAL` that a recording without some signals cannot
  decide;
- `load_pack`, `policies_for`: find a pack by its name, and the policies for it.

Description of a rule and of a pack:

- `Rule` with its `Text` (whether the wording of the provision was read, or is known from others),
  `Grade` (severity of its breaches), `Severity` (of one breach) and `Spread` (standard deviation of
  its margin, from errors of measurement);
- `adopt`: make a rule of another law with the check of an existing rule;
- `Pack`, and the packs `PORTUGAL` and `GERMANY`; `Policy`, `Tolerance`.

Input of a rule:

- `Case`, `MeasurementErrors`, `NeighbourRole` (leader and follower in the lane of the ego and in
  the lanes beside it);
- constants: `NEVER` (a frame number that stands for no frame), `ENDLESS` (larger than any margin),
  `ROAD_KINDS` and `CLASSES` (kinds of roads and of vehicles with limits of their own).

Spans of frames to check (`Span`: the first and the last frame of each simulation):

- `manoeuvre`: from 3 s before the attempt to 3 s after its end;
- `conduct`: the manoeuvre, or the whole drive if there was no attempt;
- `settled`: `conduct` without the time in which a driver may regain a gap after a cut-in;
- `passed`: from the end of the overlap of ego and target along the road to the end of `manoeuvre`;
- `alongside`: the frames of that overlap;
- `frames_of` and `seconds_of` convert durations from and to seconds.

Values at frames:

- `at`: a signal at one frame of each simulation;
- `encounter`: gap, closing speed and other measures of a neighbour at listed frames;
- `beside`: the same at one frame of each simulation;
- `limits_of`: the lowest and the highest speed limit that may hold, because the kind of the road or
  of the ego can be unknown.

Findings from margins:

- `always`: a margin at all frames of a span;
- `always_at`: a margin at listed frames;
- `instant`: a margin at one frame of each simulation;
- `keeps_limit`: the speed under a limit;
- `decided`: margins and frames that you have computed.

Errors of measurement:

- `deciding`: the frame of a span at which the margin is the margin of the finding;
- `standard_error`: the standard deviation of a margin.

`docs/how-to/write-a-rule.md` shows a pack of two rules.
"""

from overtaking.api.law import compare as compare
from overtaking.api.law import explain as explain
from overtaking.api.law import judge as judge
from overtaking.api.law import load_pack as load_pack
from overtaking.api.law import policies_for as policies_for
from overtaking.api.law import tolerance_curve as tolerance_curve
from overtaking.api.law import undecidable_rules as undecidable_rules
from overtaking.labels.instants import at as at
from overtaking.labels.instants import seconds_of as seconds_of
from overtaking.labels.law import GERMANY as GERMANY
from overtaking.labels.law import PORTUGAL as PORTUGAL
from overtaking.labels.law import Policy as Policy
from overtaking.labels.law import Text as Text
from overtaking.labels.law import Tolerance as Tolerance
from overtaking.labels.law.alongside import alongside as alongside
from overtaking.labels.law.distances import beside as beside
from overtaking.labels.law.errors import deciding as deciding
from overtaking.labels.law.errors import standard_error as standard_error
from overtaking.labels.law.frames import ENDLESS as ENDLESS
from overtaking.labels.law.frames import Span as Span
from overtaking.labels.law.frames import always as always
from overtaking.labels.law.frames import always_at as always_at
from overtaking.labels.law.frames import conduct as conduct
from overtaking.labels.law.frames import frames_of as frames_of
from overtaking.labels.law.frames import instant as instant
from overtaking.labels.law.frames import manoeuvre as manoeuvre
from overtaking.labels.law.frames import passed as passed
from overtaking.labels.law.frames import settled as settled
from overtaking.labels.law.rule import Finding as Finding
from overtaking.labels.law.rule import Grade as Grade
from overtaking.labels.law.rule import MeasurementErrors as MeasurementErrors
from overtaking.labels.law.rule import Pack as Pack
from overtaking.labels.law.rule import Rule as Rule
from overtaking.labels.law.rule import Spread as Spread
from overtaking.labels.law.rule import adopt as adopt
from overtaking.labels.law.rule import decided as decided
from overtaking.labels.law.speeds import CLASSES as CLASSES
from overtaking.labels.law.speeds import ROAD_KINDS as ROAD_KINDS
from overtaking.labels.law.speeds import keeps_limit as keeps_limit
from overtaking.labels.law.speeds import limits_of as limits_of
from overtaking.labels.signals import encounter as encounter
from overtaking.model.neighbours import NeighbourRole as NeighbourRole
from overtaking.model.overtake_events import NEVER as NEVER
from overtaking.model.verdicts import Case as Case
from overtaking.model.verdicts import Severity as Severity
from overtaking.model.verdicts import Verdict as Verdict
