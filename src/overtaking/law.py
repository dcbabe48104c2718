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
from overtaking.api.law import tolerance_curve as tolerance_curve
from overtaking.api.rules import CLASSES as CLASSES
from overtaking.api.rules import ENDLESS as ENDLESS
from overtaking.api.rules import GERMANY as GERMANY
from overtaking.api.rules import NEVER as NEVER
from overtaking.api.rules import PORTUGAL as PORTUGAL
from overtaking.api.rules import ROAD_KINDS as ROAD_KINDS
from overtaking.api.rules import Case as Case
from overtaking.api.rules import Finding as Finding
from overtaking.api.rules import Grade as Grade
from overtaking.api.rules import MeasurementErrors as MeasurementErrors
from overtaking.api.rules import NeighbourRole as NeighbourRole
from overtaking.api.rules import Pack as Pack
from overtaking.api.rules import Policy as Policy
from overtaking.api.rules import Rule as Rule
from overtaking.api.rules import Severity as Severity
from overtaking.api.rules import Span as Span
from overtaking.api.rules import Spread as Spread
from overtaking.api.rules import Text as Text
from overtaking.api.rules import Tolerance as Tolerance
from overtaking.api.rules import Verdict as Verdict
from overtaking.api.rules import adopt as adopt
from overtaking.api.rules import alongside as alongside
from overtaking.api.rules import always as always
from overtaking.api.rules import always_at as always_at
from overtaking.api.rules import at as at
from overtaking.api.rules import beside as beside
from overtaking.api.rules import conduct as conduct
from overtaking.api.rules import decided as decided
from overtaking.api.rules import deciding as deciding
from overtaking.api.rules import encounter as encounter
from overtaking.api.rules import frames_of as frames_of
from overtaking.api.rules import instant as instant
from overtaking.api.rules import judge as judge
from overtaking.api.rules import keeps_limit as keeps_limit
from overtaking.api.rules import limits_of as limits_of
from overtaking.api.rules import load_pack as load_pack
from overtaking.api.rules import manoeuvre as manoeuvre
from overtaking.api.rules import passed as passed
from overtaking.api.rules import policies_for as policies_for
from overtaking.api.rules import seconds_of as seconds_of
from overtaking.api.rules import settled as settled
from overtaking.api.rules import standard_error as standard_error
from overtaking.api.simulating import undecidable_rules as undecidable_rules
