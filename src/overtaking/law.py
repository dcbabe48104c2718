"""Laws: comparison, tolerances and reasons, and what rules and packs of your own are made of.

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
