"""The Portuguese rules of overtaking: an interpretation, not legal advice.

An s at the end of a code marks the strict variant of a rule. Arguments such as `return_rule` change
no verdict: the description of the criterion (`predicate`) refers to the rule with this code.

- `grade`: how severe a breach is. By Articles 145(1)(f) and 146(h) breaches of distance, overtaking
  and change of lane are very serious on a motorway and serious elsewhere (`BY_ROAD`). Breaches that
  these articles do not list are light. With `BY_BREACH` the criterion states a `Severity` for each
  breach.
- `required_by`: which of the policies `paper`, `default`, `strict`, `serious` and `enforced`
  require the rule. `EVERY_POLICY`: the 22 columns of the data of the reproduced study (Pinto, Dutra
  and Fonseca, 2023) suffice to decide it. `DEFAULT_AND_STRICTER`, all but `paper`: it also needs
  the road or its friction. `STRICT_ONLY`: signals, lamps, keeping right, the intentions of others,
  and uncertain readings. `ALL_BUT_STRICT`: `strict` requires the variant with an s instead.
  `NO_POLICY`: the duty is another vehicle's.
- `limit_phrase`: completes the sentence "the ego missed ... by 2 m".
- `text_source`: how the wording of the duty is known. `READ`: in the decree or a full reprint.
  `SECONDARY`: in a quotation, a bill or an earlier edition. `RECALLED`: no text was read. A rule
  on several provisions has the weakest of those that its criterion applies. `RECALLED` rules
  decide like the others. `consulted_source` says where the wording was read.
- `source`: the Highway Code, unless a rule states another one. `stl-monitor` is a published monitor
  of highway rules, from which some numbers are taken.
"""

from overtaking.knowledge.quantities import Quantity
from overtaking.labels.law.case import ClassSpeedLimits, GeneralSpeedLimits
from overtaking.labels.law.criteria.alongside import (
    BicycleDistance,
    LateralDistance,
    PassingSide,
    TargetSpeed,
)
from overtaking.labels.law.criteria.following import SafeDistance, SlowVehicleDistance
from overtaking.labels.law.criteria.lamps_and_indicators import IndicatorUse, Lamps
from overtaking.labels.law.criteria.lines_and_lanes import (
    RightmostLanesForTrucks,
    SolidLines,
    WidthForOvertaking,
)
from overtaking.labels.law.criteria.oncoming_traffic import (
    GapAtReturn,
    GapToReturnInto,
    NoOncomingReaction,
    TimeToPass,
)
from overtaking.labels.law.criteria.returning import (
    NoForcedBraking,
    ReturnDelay,
    RightLaneUse,
    SafeReturn,
)
from overtaking.labels.law.criteria.sight import MinimumSightDistance, StoppingSightDistance
from overtaking.labels.law.criteria.speed import MinimumSpeed, SpeedLimit
from overtaking.labels.law.criteria.starting import (
    GapAhead,
    GapBehind,
    NoOtherOvertaking,
    TargetInLane,
)
from overtaking.labels.law.criteria.zones import NoOvertakingSigns, NoOvertakingZones
from overtaking.labels.law.numbers import quantity
from overtaking.labels.law.rule import (
    ALL_BUT_STRICT,
    DEFAULT_AND_STRICTER,
    EVERY_POLICY,
    NO_POLICY,
    STRICT_ONLY,
    Grade,
    Pack,
    Rule,
    TextSource,
    Tolerance,
)
from overtaking.model.verdicts import Severity


def _highway_code_kmh(value: float) -> Quantity:
    return quantity(value, "km/h", "pt-highway-code-2013")


GENERAL_LIMITS = GeneralSpeedLimits(
    motorway=ClassSpeedLimits(
        light=_highway_code_kmh(120.0), van=_highway_code_kmh(110.0), heavy=_highway_code_kmh(90.0)
    ),
    other=ClassSpeedLimits(
        light=_highway_code_kmh(90.0), van=_highway_code_kmh(80.0), heavy=_highway_code_kmh(80.0)
    ),
    town=ClassSpeedLimits(
        light=_highway_code_kmh(50.0), van=_highway_code_kmh(50.0), heavy=_highway_code_kmh(50.0)
    ),
)
"""Speed limits of Article 27(1)."""


L1 = Rule(
    id="pt.ce.36@2013",
    code="L1",
    article="Articles 36 and 38(3); exceptions 37 and 42",
    title="Overtake on the left",
    gloss="Overtaking is done on the left, in the lane next to that of the overtaken vehicle. "
    "Parallel queues that move at different speeds do not overtake each other.",
    criterion=PassingSide(max_lanes_left=1),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase="the place one lane to the left of the overtaken vehicle",
    # Article 37, not found, does not make this `RECALLED`: it has only exceptions, and the
    # criterion applies none of them.
    text_source=TextSource.SECONDARY,
    consulted_source="36(1) quoted by dinheirovivo.pt (2021); 38(3) and 42 read in the decree "
    "(pages 69, 70); 37 not found",
)

L2 = Rule(
    id="pt.rst.60-m1-m3@2019",
    code="L2",
    article="Regulation of signs, Article 60 (marks M1 and M3); Highway Code, Article 146(o)",
    title="Continuous line",
    gloss="A continuous line must be neither trodden on nor crossed; of a continuous and a broken"
    " line side by side the one nearer to the driver rules.",
    # Article 146(o): very serious where the line separates the directions of travel.
    criterion=SolidLines(severity_between_directions=Severity.VERY_SERIOUS),
    grade=Grade.BY_BREACH,
    required_by=EVERY_POLICY,
    source="pt-signs-2019",
    limit_phrase="the continuous line",
    text_source=TextSource.SECONDARY,
    consulted_source="the mark M1 quoted by ecsm.pt; 146(o) as listed by "
    "contraordenacao.webnode.pt",
)

L3 = Rule(
    id="pt.ce.18-1@2013",
    code="L3",
    article="Article 18(1)",
    title="Safe distance",
    gloss="Keep a distance to the vehicle ahead that avoids a collision if it stops or slows "
    "suddenly.",
    criterion=SafeDistance(),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase="the lawful gap to the vehicle ahead",
    text_source=TextSource.SECONDARY,
    consulted_source="18(1) quoted by pplware.sapo.pt and circulaseguro.pt; the same words in the "
    "bill (Diário, II-A 92, 2 March 2013, page 30)",
)

L4 = Rule(
    id="pt.ce.38-1.front@2013",
    code="L4",
    article="Article 38(1) and (2)(a)",
    title="Room ahead in the lane entered",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic in the "
    "same direction; the carriageway must be free over the length that is needed.",
    criterion=GapAhead(safe_distance_rule="L3"),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase="the lawful gap to the vehicle ahead in the lane entered",
    text_source=TextSource.SECONDARY,
    consulted_source="38(1) and (2)(a) quoted by dinheirovivo.pt (2021)",
)

L5 = Rule(
    id="pt.ce.35@2013",
    code="L5",
    article="Articles 35 and 38(2)(c)",
    title="Room behind in the lane entered",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    # The limits bound the speed of a remedy: a faster ego may need less gap behind.
    criterion=GapBehind(safe_distance_rule="L3", general_limits=GENERAL_LIMITS),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase="the lawful gap to the vehicle behind in the lane entered",
    text_source=TextSource.SECONDARY,
    consulted_source="38(2)(c) read in the decree (page 69); 35 in a reprint of an earlier edition",
)

_NO_OTHER_OVERTAKING = NoOtherOvertaking()

L6 = Rule(
    id="pt.ce.38-2-c@2013",
    code="L6",
    article="Article 38(2)(c)",
    title="Nobody overtakes already",
    gloss="Do not begin to overtake if a follower in the same lane or in the one on the left has "
    "begun to.",
    criterion=_NO_OTHER_OVERTAKING,
    grade=Grade.BY_ROAD,
    required_by=STRICT_ONLY,
    limit_phrase=f"the {_NO_OTHER_OVERTAKING.min_arrival} until the next vehicle from behind is "
    "alongside",
    text_source=TextSource.READ,
    consulted_source="38(2)(c) in the decree (page 69)",
)

L7 = Rule(
    id="pt.ce.38-2-d@2013",
    code="L7",
    article="Article 38(2)(d)",
    title="The driver ahead does not pull out",
    gloss="Do not begin to overtake if the driver ahead has signalled to overtake a third vehicle"
    " or to avoid an obstacle.",
    criterion=TargetInLane(),
    grade=Grade.BY_ROAD,
    required_by=STRICT_ONLY,
    limit_phrase="the speed to the left that counts as moving out",
    text_source=TextSource.READ,
    consulted_source="38(2)(d) in the decree (page 69)",
)

L8 = Rule(
    id="pt.ce.38-2-b@2013",
    code="L8",
    article="Article 38(2)(b)",
    title="Safe return",
    gloss="Overtake only if one can return to the right without danger to those who drive there.",
    criterion=SafeReturn(safe_distance_rule="L3"),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase="the lawful gaps in the lane of the return",
    text_source=TextSource.SECONDARY,
    consulted_source="38(2)(b) quoted by dinheirovivo.pt (2021)",
)

_RETURN_DELAY = ReturnDelay(opposing_lane_rule="L24")

L9 = Rule(
    id="pt.ce.38-4@2013",
    code="L9",
    article="Articles 38(4) and 13(3)",
    title="Duty to return",
    gloss="Return to the right as soon as the manoeuvre is done and this is safe.",
    criterion=_RETURN_DELAY,
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase=f"the {_RETURN_DELAY.max_delay} within which the return is due",
    text_source=TextSource.SECONDARY,
    consulted_source="38(4) read in the decree (page 69); 13(3) in the bill (Diário, II-A 92, 2 "
    "March 2013, page 30) and quoted by ejm.pt",
)

L10 = Rule(
    id="pt.ce.18-2@2013",
    code="L10",
    article="Article 18(2)",
    title="Lateral distance",
    gloss="Keep a lateral distance to vehicles on the same carriageway that avoids accidents.",
    # The Code states one duty for all roads, so `min_outside` also holds in built-up areas.
    criterion=LateralDistance(
        min_outside=quantity(
            0.8,
            "m",
            why="A choice; the Code says 'enough'. It is above the 0.5 m below which the monitor "
            "of highway rules (stl-monitor) calls another vehicle close",
        )
    ),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase="the distance to the side of the overtaken vehicle",
    text_source=TextSource.SECONDARY,
    consulted_source="18(2) quoted by pplware.sapo.pt and circulaseguro.pt",
)

_BICYCLE_GAP = quantity(1.5, "m", "pt-highway-code-2013")

L11 = Rule(
    id="pt.ce.18-3@2013",
    code="L11",
    article="Articles 18(3) and 38(2)(e)",
    title="Overtaking a bicycle",
    gloss=f"Motor vehicles keep at least {_BICYCLE_GAP} to the side of bicycles, and slow down to "
    "overtake them.",
    criterion=BicycleDistance(min_gap=_BICYCLE_GAP),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    # A distance and a speed have no common unit, so each margin is a share of its limit, and the
    # smaller share decides. The sentence is "missed the distance ..., as a share of it, by 0.2".
    limit_phrase="the distance to the side of the bicycle, or the speed at the start, as a share "
    "of it,",
    text_source=TextSource.SECONDARY,
    consulted_source="38(2)(e) read in the decree (page 69); 18(3) quoted by circulaseguro.pt",
)

_MOTORWAY_LIMITS = GENERAL_LIMITS.motorway

L12 = Rule(
    id="pt.ce.27@2013",
    code="L12",
    article="Article 27",
    title="Speed limit",
    gloss="Keep to the limit that is posted and to the general limit of road and vehicle: on "
    f"motorways {_MOTORWAY_LIMITS.light} for light vehicles, {_MOTORWAY_LIMITS.van.bare()} for "
    f"vans, {_MOTORWAY_LIMITS.heavy.bare()} for heavy goods vehicles.",
    # Articles 145(1)(b) and 146(i) state from which excess a breach is serious or very serious. The
    # numbers are those outside localities. Inside, the steps are 20 and 40 km/h, for heavy vehicles
    # 10 and 20 km/h; this reading leaves them out, so it grades a breach there too mildly.
    criterion=SpeedLimit(
        general_limits=GENERAL_LIMITS,
        serious_excess=_highway_code_kmh(30.0),
        very_serious_excess=_highway_code_kmh(60.0),
        heavy_serious_excess=_highway_code_kmh(20.0),
        heavy_very_serious_excess=_highway_code_kmh(40.0),
    ),
    grade=Grade.BY_BREACH,
    required_by=EVERY_POLICY,
    # The police deduct the largest permissible error of a fixed device from its reading: 5 km/h up
    # to 100 km/h, 5 % above. The error of moving devices is 7 km/h or 7 %. A breach counts if it
    # exceeds both the margin [m/s] and the share of the measured speed.
    tolerances={"enforced": Tolerance(margin=5.0 / 3.6, share=0.05, source="pt-portaria-352-2023")},
    limit_phrase="the speed limit",
    text_source=TextSource.SECONDARY,
    consulted_source="27(2) and (3) read in the decree (page 65); the table of 27(1) as printed by "
    "acp.pt; 145(1)(b) quoted by pplware.sapo.pt",
)

# A driving school and a list of fines state 50 km/h, an edition of 2001 has 40 km/h. The paragraph
# was not read in the edition of 2013; 50 km/h is a choice.
_MIN_SPEED = _highway_code_kmh(50.0)

L13 = Rule(
    id="pt.ce.27-6@2013",
    code="L13",
    article="Article 27(6)",
    title="Lowest speed",
    gloss=f"On motorways do not drive slower than {_MIN_SPEED}.",
    criterion=MinimumSpeed(min_speed=_MIN_SPEED),
    grade=Grade.LIGHT,
    required_by=EVERY_POLICY,
    limit_phrase="the lowest speed on motorways",
    text_source=TextSource.SECONDARY,
    consulted_source="27(6): 50 km/h in a sheet of a driving school; 40 km/h in the text of 2001 "
    "(pgdlisboa.pt)",
)

L14 = Rule(
    id="pt.ce.24-1@2013",
    code="L14",
    article="Article 24(1)",
    title="Stop in the visible space",
    gloss="Adapt speed to road, weather and traffic, so that the vehicle can be stopped in the "
    "free and visible space ahead.",
    criterion=StoppingSightDistance(safe_distance_rule="L3"),
    # Serious by Article 145(1)(e), a speed that does not fit the conditions. Article 146(h), by
    # which other breaches are very serious on motorways, does not raise it.
    grade=Grade.SERIOUS,
    # Not `paper`, whose columns contain no friction, nor `strict`, which requires L14s.
    required_by=DEFAULT_AND_STRICTER & ALL_BUT_STRICT,
    limit_phrase="the stopping distance that the sight of lit vehicles allows",
    text_source=TextSource.READ,
    consulted_source="24(1) reprinted by codigo.pt; its beginning in the decree (page 63)",
)

L14s = Rule(
    id="pt.ce.24-1.unlit@2013",
    code="L14s",
    article="Article 24(1), strictly",
    title="Stop in the visible space, for the unlit",
    gloss=L14.gloss,
    criterion=StoppingSightDistance(safe_distance_rule="L3", is_for_unlit_obstacles=True),
    grade=Grade.SERIOUS,
    required_by=STRICT_ONLY,
    limit_phrase="the stopping distance that the sight of unlit obstacles allows",
    text_source=TextSource.READ,
    consulted_source="as L14",
)

_MIN_SIGHT = quantity(
    50.0, "m", "pt-highway-code-2013", why="Article 19: visibility is insufficient below"
)

L15 = Rule(
    id="pt.ce.41-1-f@2013",
    code="L15",
    article="Articles 41(1)(f) and 19",
    title="Sufficient visibility",
    gloss="Do not overtake where visibility is insufficient, that is, where the carriageway cannot "
    f"be seen over {_MIN_SIGHT}; with oncoming traffic, where it is not clear over the length that "
    "is needed.",
    criterion=MinimumSightDistance(min_sight=_MIN_SIGHT),
    grade=Grade.BY_ROAD,
    # Also `paper`: the study's columns contain fog and rain, which limit this sight.
    required_by=ALL_BUT_STRICT,
    limit_phrase="the least visibility for overtaking",
    text_source=TextSource.SECONDARY,
    consulted_source="41(1)(f) quoted by postal.pt; the 50 m of 19 read in the decree (page 62)",
)

L15s = Rule(
    id="pt.ce.41-1-f.unlit@2013",
    code="L15s",
    article="Articles 41(1)(f) and 19, strictly",
    title="Sufficient visibility, for the unlit",
    gloss=L15.gloss,
    criterion=MinimumSightDistance(min_sight=_MIN_SIGHT, is_for_unlit_obstacles=True),
    grade=Grade.BY_ROAD,
    required_by=STRICT_ONLY,
    limit_phrase="the least sight of unlit obstacles for overtaking",
    text_source=TextSource.SECONDARY,
    consulted_source="as L15",
)

L16 = Rule(
    id="pt.ce.41-1-g@2013",
    code="L16",
    article="Articles 41(1)(g) and 38(2)(a)",
    title="Sufficient width",
    gloss="Do not overtake where the carriageway is not wide enough.",
    criterion=WidthForOvertaking(),
    grade=Grade.BY_ROAD,
    required_by=EVERY_POLICY,
    limit_phrase="the width that overtaking takes",
    text_source=TextSource.SECONDARY,
    consulted_source="41(1)(g) quoted by postal.pt; 38(2)(a) quoted by dinheirovivo.pt (2021)",
)

L17 = Rule(
    id="pt.ce.41@2013",
    code="L17",
    article="Article 41(1)(a) to (e), (2) and (3)",
    title="Places and targets",
    gloss="Do not overtake on crests, immediately before and at level crossings, junctions and "
    "crossings, in bends of reduced visibility, where the carriageway is too narrow, nor a vehicle"
    " that overtakes a third. Crests, bends, junctions, level crossings and third vehicles do not "
    "count where there are two or more lanes in the same direction and the opposite side is not "
    "used.",
    # The exceptions are part of the criterion, which no other law uses.
    criterion=NoOvertakingZones(),
    grade=Grade.BY_ROAD,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="a place where one may overtake",
    text_source=TextSource.SECONDARY,
    consulted_source="41(3) read in the decree (page 70); 41(1) and (2) quoted by postal.pt",
)

L18 = Rule(
    id="pt.ce.21@2013",
    code="L18",
    article="Article 21",
    title="Indicate",
    gloss="Signal a lane change and the start of an overtake with due anticipation, and "
    "throughout.",
    criterion=IndicatorUse(),
    grade=Grade.LIGHT,
    required_by=STRICT_ONLY,
    limit_phrase="the time of indicating",
    text_source=TextSource.READ,
    consulted_source="21 in the decree (page 62)",
)

_HIGH_BEAM_GAP = quantity(100.0, "m", "pt-highway-code-2013")

L19 = Rule(
    id="pt.ce.61@2013",
    code="L19",
    article="Articles 60 and 61",
    title="Lamps",
    gloss="Low beam from dusk to dawn and wherever visibility asks for it; no high beam when "
    f"meeting or less than {_HIGH_BEAM_GAP} behind another; rear fog lamps when required and only "
    "then.",
    # By night low beam is due at any range. Without `fog_lamp_max_range`, rear fog lamps are due
    # below `low_beam_max_range` and unlawful from there on.
    criterion=Lamps(
        low_beam_max_range=quantity(
            100.0,
            "m",
            "pt-highway-code-2013",
            why="By day low beam and rear fog lamps are due in fog and rain with less sight: our "
            "reading of Article 61, which names 100 m",
        ),
        high_beam_min_gap=_HIGH_BEAM_GAP,
        high_beam_min_oncoming_gap=quantity(
            200.0,
            "m",
            why="A choice; Article 61 says 'when meeting'. High beam nearer to an oncoming vehicle "
            "breaks the rule",
        ),
    ),
    # By a list of Article 145, driving without lamps is serious; this version has one grade for all
    # breaches of the rule.
    grade=Grade.LIGHT,
    required_by=STRICT_ONLY,
    limit_phrase="the right lamps",
    text_source=TextSource.SECONDARY,
    consulted_source="61 quoted by onossogrupinho.blogspot.com (2009); 60 quoted by "
    "pplware.sapo.pt",
)

L20 = Rule(
    id="pt.ce.74@2013",
    code="L20",
    article="Article 74",
    title="Lanes for trucks",
    gloss="On motorways with three or more lanes in one direction, goods vehicles over 3.5 t use "
    "only the two right-most.",
    criterion=RightmostLanesForTrucks(
        num_open_lanes=quantity(
            2.0, "1", "pt-highway-code-2013", why="The right-most lanes that are open to them"
        ),
        min_lanes=quantity(
            3.0,
            "1",
            "pt-highway-code-2013",
            why="On motorways with at least so many lanes each way",
        ),
    ),
    # By a list of Article 145, such a breach may be serious; the text of 74 was not found.
    grade=Grade.LIGHT,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the two right-most lanes",
    text_source=TextSource.RECALLED,
    consulted_source="74 not found",
)

L21 = Rule(
    id="pt.ce.13-3@2013",
    code="L21",
    article="Article 13(3)",
    title="Keep right",
    gloss="With two or more lanes in the same direction use the right-most; others only if there "
    "is no room in it, to overtake or to change direction.",
    criterion=RightLaneUse(return_rule="L9"),
    grade=Grade.BY_ROAD,
    required_by=STRICT_ONLY,
    limit_phrase="the right-most lane, with room",
    text_source=TextSource.SECONDARY,
    consulted_source="13(3) in the bill (Diário, II-A 92, 2 March 2013, page 30) and quoted by "
    "ejm.pt",
)

L22 = Rule(
    id="pt.ce.39@2013",
    code="L22",
    article="Article 39",
    title="Let others overtake",
    gloss="A driver being overtaken gives way to the right as far as possible and does not "
    "accelerate.",
    criterion=TargetSpeed(),
    grade=Grade.BY_ROAD,
    required_by=NO_POLICY,
    is_duty_of_ego=False,
    # "It" is the overtaken vehicle. Up to a small acceleration its speed counts as held.
    limit_phrase="the acceleration at which it still holds its speed",
    text_source=TextSource.READ,
    consulted_source="39 in the decree (page 69)",
)

L23 = Rule(
    id="pt.ce.35.obstruction@2013",
    code="L23",
    article="Article 35",
    title="No obstruction",
    gloss="Change lane only where no danger to or obstruction of traffic results.",
    criterion=NoForcedBraking(),
    grade=Grade.BY_ROAD,
    required_by=STRICT_ONLY,
    limit_phrase="the braking that may be forced on others",
    text_source=TextSource.SECONDARY,
    consulted_source="35 in a reprint of an earlier edition",
)

L24 = Rule(
    id="pt.ce.38-1.oncoming@2013",
    code="L24",
    article="Article 38(1)",
    title="Oncoming traffic",
    gloss="Do not begin to overtake unless sure of no danger of colliding with traffic from the "
    "opposite direction.",
    criterion=GapAtReturn(),
    grade=Grade.BY_ROAD,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the distance to oncoming traffic",
    text_source=TextSource.SECONDARY,
    consulted_source="38(1) quoted by dinheirovivo.pt (2021)",
)

# The duty of L24, measured as the ego pulls out; L24 measures it as the ego is back.
L25 = Rule(
    id="pt.ce.38-1.pull-out@2013",
    code="L25",
    article="Articles 35 and 38(1)",
    title="Time to pass",
    gloss=L24.gloss,
    criterion=TimeToPass(),
    grade=Grade.BY_ROAD,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the gap to oncoming traffic that the overtake needs",
    text_source=TextSource.SECONDARY,
    consulted_source="38(1) quoted by dinheirovivo.pt (2021); 35 in a reprint of an earlier "
    "edition",
)

L26 = Rule(
    id="pt.ce.35.oncoming@2013",
    code="L26",
    article="Article 35",
    title="No reaction of oncoming traffic",
    gloss="Overtake only where no danger to or obstruction of traffic results.",
    criterion=NoOncomingReaction(),
    grade=Grade.BY_ROAD,
    required_by=STRICT_ONLY,
    limit_phrase="the braking that may be forced on oncoming traffic",
    text_source=TextSource.SECONDARY,
    consulted_source="35 in a reprint of an earlier edition",
)

L27 = Rule(
    id="pt.ce.38-2-b.gap@2013",
    code="L27",
    article="Article 38(2)(b)",
    title="A gap to return into",
    gloss="Do not begin to overtake unless one can return to the right without danger to those "
    "who drive there.",
    criterion=GapToReturnInto(safe_distance_rule="L3"),
    grade=Grade.BY_ROAD,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the gap that the return needs",
    text_source=TextSource.SECONDARY,
    consulted_source="38(2)(b) quoted by dinheirovivo.pt (2021)",
)

_SLOW_VEHICLE_GAP = quantity(50.0, "m", "pt-highway-code-2013")

L28 = Rule(
    id="pt.ce.40@2013",
    code="L28",
    article="Article 40",
    title="Slow vehicles leave room",
    gloss="Outside localities, on roads with one lane in each direction, heavy and other vehicles "
    f"that drive slowly keep at least {_SLOW_VEHICLE_GAP} to the vehicle ahead, so that they can "
    "be overtaken; the duty does not hold for a driver who is about to overtake.",
    criterion=SlowVehicleDistance(
        max_speed=quantity(
            40.0,
            "km/h",
            why="A choice; the Code says 'slowly'. Vehicles that cannot exceed this speed must "
            "show the lamp of slow vehicles",
        ),
        min_gap=_SLOW_VEHICLE_GAP,
    ),
    grade=Grade.BY_ROAD,
    required_by=STRICT_ONLY,
    limit_phrase=f"the {_SLOW_VEHICLE_GAP} to the vehicle ahead",
    text_source=TextSource.RECALLED,
    consulted_source="the beginning of 40(1) read in the decree (page 69); the distance and "
    "paragraph 2 not found",
)

L29 = Rule(
    id="pt.rst.24-c14@2019",
    code="L29",
    article="Regulation of signs, Article 24 (signs C14a to C14c)",
    title="Signs against overtaking",
    gloss="Sign C14a forbids to overtake motor vehicles other than two-wheelers. Sign C14b forbids "
    "heavy vehicles to overtake, sign C14c motorcycles and mopeds.",
    # L25 to L29 came with two-way roads, and tables of one-way roads leave them out, so that these
    # tables have the rows that they had before. Of these rules only L29 could judge such roads.
    criterion=NoOvertakingSigns(has_sign_for_motorcycles=True, only_two_way_roads=True),
    grade=Grade.BY_ROAD,
    required_by=DEFAULT_AND_STRICTER,
    source="pt-signs-2019",
    limit_phrase="the end of the stretch where a sign forbids to overtake",
    text_source=TextSource.RECALLED,
    consulted_source="C14a to C14c named by a list of signs (slideshare.net); their wording not "
    "found",
)

# fmt: off
_RULES = (
    L1, L2, L3, L4, L5, L6, L7, L8, L9, L10, L11, L12, L13, L14, L14s, L15, L15s, L16, L17, L18,
    L19, L20, L21, L22, L23, L24, L25, L26, L27, L28, L29,
)
# fmt: on

# `pt-2@2013` is the second version of these readings of the text of 2013. On two-way roads the
# version is `pt-2@2013+opposite-1`: the suffix is the version of the rules that came with these
# roads. So data sets of one-way roads keep the version that they had before.
PORTUGAL = Pack(
    name="pt",
    version="pt-2@2013",
    rules=_RULES,
    source="pt-highway-code-2013",
    edition="Código da Estrada, text of Law 72/2013 as decreed (Diário da Assembleia da República, "
    "II-A 178, supplement 1, 26 July 2013, pages 61 to 70), held against the rules on 23 November "
    "2026. The consolidation in force (20th amendment; Decree-Law 102-B/2020 and later) was found "
    "from its first article only and is not compared",
    severities="Articles 145 and 146 of the Highway Code",
    two_way_version="+opposite-1",
)
