"""Laws: functions that judge data by a law, and the parts of which you make rules and packs.

Functions that use a law:

- `compare` (the overtakes on which laws differ), `explain` (reasons for the verdicts on one
  overtake), `tolerance_curve` (number of legal overtakes by tolerance);
- `undecidable_rules`: the rules that a recording cannot decide, because it lacks signals;
- `load_pack`, `policies_for`: a pack by its name, and the policies for it.

Parts of rules and packs. A rule is a function that takes a `Case` (simulations with their signals)
and returns a `Finding` (a `Verdict`, a margin and the frames of a breach for each simulation):

- description: `Rule` with its `Text` (how the wording of the provision is known), `Grade` (severity
  by the provision), `Severity` (of one breach) and `Spread` (error of the margin); `adopt` copies
  the check of a rule into a rule of another law; `Pack`, and the packs `PORTUGAL` and `GERMANY`;
- policies: `Policy`, `Tolerance`;
- input: `Case`, `MeasurementErrors`, `NeighbourRole`, and the constants `NEVER` (no frame),
  `ENDLESS` (larger than any margin), `ROAD_KINDS` and `CLASSES` (kinds of roads and vehicles with
  limits of their own);
- spans of frames to check: `Span`; `manoeuvre` (3 s before the attempt to 3 s after its end),
  `conduct` (the manoeuvre, or the whole drive without an attempt), `settled` (`conduct` without the
  time in which a driver may regain a gap that another took), `passed` (from the end of the overlap
  with the target), `alongside` (the frames of that overlap); `frames_of` and `seconds_of` convert
  durations;
- values at frames: `at` (a signal at one frame of each simulation), `encounter` and `beside` (a
  neighbour at a frame), `limits_of` (speed limits);
- findings from margins, where a negative margin is a breach: `always` (at all frames of a span),
  `always_at` (at listed frames), `instant` (at one frame), `keeps_limit` (speed under a limit),
  `decided` (from margins and frames that you have computed), `judge` (of a whole rule);
- errors of measurement: `deciding` (the frame whose margin is the margin of a finding),
  `standard_error` (of a margin).

`docs/how-to/write-a-rule.md` shows a rule.
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
