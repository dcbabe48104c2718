"""The German rules of overtaking (StVO): an interpretation, not legal advice.

The first letter of a code is the subject: G general duty, F lanes, V speed, A distance, O
overtaking, B lamps, S lines. An s at the end marks the strict variant of a rule. Arguments that
end in `_rule` change no verdict: the printed condition of the criterion refers to the rule with
this code instead of repeating its condition.

- `grade`: a breach is serious where the catalogue of fines (BKatV, annex) gives a point for it,
  very serious with two, else light. This version of the pack has one grade for each rule but V2. A
  later reading of the catalogue found differences, not included because they would change verdicts:
  A3 (number 15), O9 (153a) and O17 (89a, 113) cost a point; A2 costs two with the smallest gaps
  above 100 km/h; O1 costs none in towns (16); V1 costs one only in some situations, such as bad
  weather (8.1).
- `required_by`: which of the policies `paper`, `default`, `strict`, `serious` and `enforced`
  require the rule, a choice. `EVERY_POLICY`: rules that we consider as important as the Portuguese
  rules of the reproduced study (Pinto, Dutra and Fonseca, 2023); `DEFAULT_AND_STRICTER`, all but
  `paper`: other rules; `STRICT_ONLY`: signals, lamps, keeping right, the intentions of others, and
  uncertain readings; `ALL_BUT_STRICT`: `strict` requires the variant with an s instead;
  `NO_POLICY`: the text was not read, or the duty is another vehicle's. `enforced` counts breaches
  that are fined in practice.
- `text_source`: how the wording of the duty is known. `READ`: in a full reprint. `SECONDARY`: in
  quotations alone; such a rule (G1, F2) is always undecidable.
- `limit_phrase`: completes the sentence "the ego missed ... by 2 m".
"""

from overtaking.labels.law.case import (
    NO_GENERAL_LIMIT,
    ClassSpeedLimits,
    GeneralSpeedLimits,
)
from overtaking.labels.law.criteria.alongside import LateralDistance, PassingSide, TargetSpeed
from overtaking.labels.law.criteria.following import (
    FinedTimeDistance,
    FixedDistance,
    GapForAnotherVehicle,
    TimeDistance,
)
from overtaking.labels.law.criteria.lamps_and_indicators import IndicatorUse, Lamps
from overtaking.labels.law.criteria.lines_and_lanes import SolidLines
from overtaking.labels.law.criteria.oncoming_traffic import (
    GapAtReturn,
    NoOncomingReaction,
    TimeToPass,
)
from overtaking.labels.law.criteria.returning import (
    NoForcedBraking,
    ReturnDelay,
    RightLaneUse,
    SafeReturn,
)
from overtaking.labels.law.criteria.sight import PassingSightDistance, StoppingSightDistance
from overtaking.labels.law.criteria.speed import SpeedInFog, SpeedLimit
from overtaking.labels.law.criteria.starting import (
    CalmFollower,
    SightForTrucks,
    SpeedAdvantage,
    TargetInLane,
)
from overtaking.labels.law.criteria.zones import NoOvertakingAtCrossings, NoOvertakingSigns
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
from overtaking.model.trajectories import ManoeuvreKind

G1 = Rule(
    id="de.stvo.1-2@2013",
    code="G1",
    article="§ 1(2) StVO",
    title="No danger, no avoidable obstruction",
    gloss="Behave so that no person is harmed, endangered, or hindered more than is unavoidable.",
    criterion=NoForcedBraking(),
    grade=Grade.LIGHT,
    required_by=NO_POLICY,
    limit_phrase="the braking that may be forced on others",
    text_source=TextSource.SECONDARY,
    consulted_source="1(2) quoted by 123fahrschule.de and others",
)

F1 = Rule(
    id="de.stvo.2-2@2013",
    code="F1",
    article="§ 2(2) and § 7(1) StVO",
    title="Keep right",
    gloss="Drive as far to the right as possible; on several lanes one may do otherwise where the "
    "traffic is dense enough.",
    criterion=RightLaneUse(),
    grade=Grade.LIGHT,
    required_by=STRICT_ONLY,
    limit_phrase="the right-most lane, with room",
    text_source=TextSource.READ,
    consulted_source="2(2) at buzer.de; 7(1) at verkehrsportal.de",
)

F2 = Rule(
    id="de.stvo.7-5@2013",
    code="F2",
    article="§ 7(5) StVO",
    title="Change of lane",
    gloss="Change lane only if no person is endangered.",
    # Of all changes of lane only the return is measured here; O6 measures the pull-out.
    criterion=SafeReturn(),
    grade=Grade.LIGHT,
    required_by=NO_POLICY,
    limit_phrase="the room in the lane of the return",
    text_source=TextSource.SECONDARY,
    consulted_source="7(5) quoted in part by rodorf.de",
)

V1 = Rule(
    id="de.stvo.3-1-4@2013",
    code="V1",
    article="§ 3(1) sentence 4 StVO",
    title="Stop in the visible space",
    gloss="Drive only so fast that one can stop within the way that one overlooks.",
    # Leaders do not count here; the printed condition names A1 as the rule for them.
    criterion=StoppingSightDistance(safe_distance_rule="A1"),
    grade=Grade.SERIOUS,
    required_by=ALL_BUT_STRICT,
    limit_phrase="the stopping distance that the sight of lit vehicles allows",
    text_source=TextSource.READ,
    consulted_source="3(1) at fahrschule.de",
)

V1s = Rule(
    id="de.stvo.3-1-4.unlit@2013",
    code="V1s",
    article="§ 3(1) sentence 4 StVO, strictly",
    title="Stop in the visible space, for the unlit",
    gloss=V1.gloss,
    criterion=StoppingSightDistance(safe_distance_rule="A1", is_for_unlit_obstacles=True),
    grade=Grade.SERIOUS,
    required_by=STRICT_ONLY,
    limit_phrase="the stopping distance that the sight of unlit obstacles allows",
    text_source=TextSource.READ,
    consulted_source="as V1",
)

_TOWN_LIMIT = quantity(50.0, "km/h", "de-stvo-2013")
_LIMIT_OUTSIDE_TOWN = quantity(100.0, "km/h", "de-stvo-2013")
_TRUCK_LIMIT = quantity(
    60.0,
    "km/h",
    "de-stvo-2013",
    why="Above 7.5 t, as most trucks here. From 3.5 t to 7.5 t 80 km/h hold, but trucks are one "
    "class",
)
_TRUCK_LIMIT_ON_MOTORWAY = quantity(80.0, "km/h", "de-stvo-2013")

V2 = Rule(
    id="de.stvo.3-3@2013",
    code="V2",
    article="§ 3(3) and § 18(5) StVO; sign 274",
    title="Speed limit",
    gloss=f"Keep to the limit that is posted and to the general one: in towns {_TOWN_LIMIT}, "
    f"elsewhere {_LIMIT_OUTSIDE_TOWN.bare()}, for trucks {_TRUCK_LIMIT.bare()}; on motorways none, "
    f"for trucks {_TRUCK_LIMIT_ON_MOTORWAY.bare()}.",
    criterion=SpeedLimit(
        # Vans are goods vehicles up to 3.5 t.
        general_limits=GeneralSpeedLimits(
            motorway=ClassSpeedLimits(
                light=NO_GENERAL_LIMIT, van=NO_GENERAL_LIMIT, heavy=_TRUCK_LIMIT_ON_MOTORWAY
            ),
            other=ClassSpeedLimits(
                light=_LIMIT_OUTSIDE_TOWN, van=_LIMIT_OUTSIDE_TOWN, heavy=_TRUCK_LIMIT
            ),
            town=ClassSpeedLimits(light=_TOWN_LIMIT, van=_TOWN_LIMIT, heavy=_TOWN_LIMIT),
        ),
        # Steps of excess for cars outside built-up areas, from memory; `text_source` grades only
        # the wording of the duty. An excess above the first number costs one point, above the
        # second two. The catalogue has lower steps in towns and for trucks, which this reading
        # leaves out.
        serious_excess=quantity(20.0, "km/h", "de-bkatv-recalled"),
        very_serious_excess=quantity(
            40.0, "km/h", "de-bkatv-recalled", why="Outside built-up areas"
        ),
    ),
    grade=Grade.BY_BREACH,
    required_by=EVERY_POLICY,
    # Devices deduct 3 km/h up to 100 km/h, 3 % above. A breach counts if it exceeds both the margin
    # [m/s] and the share of the measured speed.
    tolerances={"enforced": Tolerance(margin=3.0 / 3.6, share=0.03, source="adac-2019")},
    limit_phrase="the speed limit",
    text_source=TextSource.READ,
    consulted_source="3(3) at dein-gesetz.de; 18(5) at deubner-recht.de (as of 20 July 2023) and "
    "bgbau-medien.de",
)

_FOG_SPEED = quantity(50.0, "km/h", "de-stvo-2013", why="§ 3(1) sentence 3")
_FOG_RANGE = quantity(50.0, "m", "de-stvo-2013", why="§ 3(1) sentence 3")

V3 = Rule(
    id="de.stvo.3-1-3@2013",
    code="V3",
    article="§ 3(1) sentence 3 StVO",
    title="Slowly in fog",
    gloss=f"Drive no faster than {_FOG_SPEED} if one sees less than {_FOG_RANGE} for fog, snow or "
    "rain.",
    criterion=SpeedInFog(max_range=_FOG_RANGE, max_speed=_FOG_SPEED),
    grade=Grade.SERIOUS,  # Number 9 of the catalogue.
    required_by=EVERY_POLICY,
    limit_phrase=f"the {_FOG_SPEED} in fog",
    text_source=TextSource.READ,
    consulted_source="3(1) at fahrschule.de",
)

_COURTS_TIME = quantity(
    1.5,
    "s",
    "de-courts-distance",
    why="Courts ask for at least the distance driven in this time; advice is half the speedometer "
    "in metres, 1.8 s",
)

A1 = Rule(
    id="de.stvo.4-1@2013",
    code="A1",
    article="§ 4(1) StVO",
    title="Distance",
    gloss="Keep, as a rule, a distance behind which one can stop even if the vehicle ahead brakes "
    "suddenly.",
    criterion=TimeDistance(min_time=_COURTS_TIME),
    grade=Grade.LIGHT,
    required_by=EVERY_POLICY - {"enforced"},  # `enforced` requires A2 instead.
    limit_phrase=f"the way of {_COURTS_TIME} to the vehicle ahead",
    text_source=TextSource.READ,
    consulted_source="4(1) at ra.de and aok.de",
)

A2 = Rule(
    id="de.stvo.4-1.fined@2013",
    code="A2",
    article="§ 4(1) StVO; BKatV, annex, numbers 12.5 to 12.7",
    title="Distance, as it is fined",
    gloss=A1.gloss,
    criterion=FinedTimeDistance(
        min_time=quantity(
            0.9,
            "s",
            "de-bkatv",
            why="The catalogue fines gaps below five tenths of half the speedometer, v / 4 metres "
            "at v km/h: driven in 3.6 / 4 s",
        ),
        min_speed=quantity(80.0, "km/h", "de-bkatv"),
        max_duration=quantity(3.0, "s", "olg-hamm-2013", why="Shorter is transient"),
        max_distance=quantity(
            140.0,
            "m",
            "olg-hamm-2013",
            why="A gap that is too small over this distance is not transient either. Above 168 "
            "km/h it is driven in less than 3 s",
        ),
        distance_rule="A1",
    ),
    grade=Grade.SERIOUS,
    required_by=frozenset(["enforced"]),
    limit_phrase="the time for which a gap may be below five tenths of half the speedometer",
    text_source=TextSource.READ,
    consulted_source="4(1) at ra.de; the numbers of the catalogue as told by "
    "anwaltspraxis-magazin.de",
    fine="by the tenths of half the speedometer (BKatV, numbers 12.5 to 12.7)",
)

_TRUCK_GAP = quantity(50.0, "m", "de-stvo-2013", why="§ 4(3)")
_TRUCK_SPEED = quantity(50.0, "km/h", "de-stvo-2013", why="§ 4(3)")

A3 = Rule(
    id="de.stvo.4-3@2013",
    code="A3",
    article="§ 4(3) StVO",
    title="Distance of trucks",
    gloss=f"On motorways drivers of trucks above 3.5 t keep at least {_TRUCK_GAP} to the vehicle "
    f"ahead when faster than {_TRUCK_SPEED}.",
    criterion=FixedDistance(min_gap=_TRUCK_GAP, min_speed=_TRUCK_SPEED, distance_rule="A1"),
    grade=Grade.LIGHT,
    required_by=EVERY_POLICY,
    limit_phrase=f"the {_TRUCK_GAP} to the vehicle ahead",
    text_source=TextSource.READ,
    consulted_source="4(3) at ra.de and aok.de",
)

A4 = Rule(
    id="de.stvo.4-2@2013",
    code="A4",
    article="§ 4(2) StVO",
    title="Trucks leave room",
    gloss="Outside built-up areas vehicles with a speed limit of their own keep so large a "
    "distance to the vehicle ahead that an overtaking vehicle can move in. This does not hold for "
    "drivers who move out to overtake, on several lanes in one direction, and where overtaking is "
    "forbidden.",
    criterion=GapForAnotherVehicle(
        vehicle_length=quantity(
            4.5,
            "m",
            why="A choice: the length of a car, which § 4(2) lets move in. The distances of § 4(1) "
            "ahead of and behind it are added",
        ),
        min_time=_COURTS_TIME,
        distance_rule="A1",
    ),
    grade=Grade.LIGHT,
    required_by=STRICT_ONLY,
    limit_phrase="the gap into which another can move",
    text_source=TextSource.READ,
    consulted_source="4(2) at aok.de and dein-gesetz.de",
)

O1 = Rule(
    id="de.stvo.5-1@2013",
    code="O1",
    article="§ 5(1) StVO; exceptions § 7(2) and (2a)",
    title="Overtake on the left",
    gloss="Overtaking is done on the left. Where queues have formed one may be faster on the "
    "right.",
    criterion=PassingSide(),
    grade=Grade.SERIOUS,
    required_by=EVERY_POLICY,
    limit_phrase="the left side of the overtaken vehicle",
    text_source=TextSource.READ,
    consulted_source="5(1) at dejure.org; 7(2) and (2a) at verkehrsportal.de",
    fine="100 EUR, 1 point (BKat 17, Kraftfahrt-Bundesamt)",
)

_SPEED_GAIN = quantity(10.0, "km/h", "olg-hamm-2008", why="Substantially faster, § 5(2) sentence 2")

O2 = Rule(
    id="de.stvo.5-2-2@2013",
    code="O2",
    article="§ 5(2) sentence 2 StVO",
    title="Substantially faster",
    gloss="Only those may overtake who are substantially faster than the overtaken.",
    criterion=SpeedAdvantage(min_speed_gain=_SPEED_GAIN),
    grade=Grade.SERIOUS,
    required_by=EVERY_POLICY,
    limit_phrase=f"the {_SPEED_GAIN} by which one has to be faster",
    text_source=TextSource.READ,
    consulted_source="5(2) at dejure.org",
    fine="80 EUR, 1 point (BKat 18, Kraftfahrt-Bundesamt)",
)

O3 = Rule(
    id="de.stvo.5-2-1@2013",
    code="O3",
    article="§ 5(2) sentence 1 StVO",
    title="Oncoming traffic",
    gloss="Only those may overtake who can see that they will not hinder oncoming traffic at any "
    "time.",
    criterion=GapAtReturn(),
    grade=Grade.SERIOUS,
    required_by=EVERY_POLICY,
    limit_phrase="the distance to oncoming traffic",
    text_source=TextSource.READ,
    consulted_source="5(2) at dejure.org",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)

O4 = Rule(
    id="de.stvo.5-3-1@2013",
    code="O4",
    article="§ 5(3) number 1 StVO",
    title="Clear situation",
    gloss="Do not overtake where the situation is unclear, such as behind a vehicle that moves "
    "out.",
    # Of the unclear situations only the example is measured.
    criterion=TargetInLane(),
    grade=Grade.SERIOUS,
    required_by=STRICT_ONLY,
    limit_phrase="the speed to the left that counts as moving out",
    text_source=TextSource.READ,
    consulted_source="5(3) at dejure.org",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)

_TRUCK_SIGHT = quantity(50.0, "m", "de-stvo-2013", why="§ 5(3a)")

O5 = Rule(
    id="de.stvo.5-3a@2013",
    code="O5",
    article="§ 5(3a) StVO",
    title="No overtaking by trucks in fog",
    gloss="Drivers of vehicles above 7.5 t do not overtake if they see less than "
    f"{_TRUCK_SIGHT} for fog, snow or rain.",
    criterion=SightForTrucks(min_range=_TRUCK_SIGHT),
    grade=Grade.SERIOUS,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase=f"the {_TRUCK_SIGHT} of visibility for overtaking trucks",
    text_source=TextSource.READ,
    consulted_source="5(3a) at dejure.org",
    fine="120 EUR, 1 point (BKat 21, Kraftfahrt-Bundesamt)",
)

O6 = Rule(
    id="de.stvo.5-4-1@2013",
    code="O6",
    article="§ 5(4) sentence 1 StVO",
    title="Following traffic",
    gloss="A driver moving out to overtake behaves so that following traffic is in no danger.",
    criterion=CalmFollower(manoeuvre=ManoeuvreKind.PULL_OUT),
    grade=Grade.SERIOUS,
    required_by=EVERY_POLICY,
    limit_phrase="the gap before which the vehicle behind need not brake hard",
    text_source=TextSource.READ,
    consulted_source="5(4) at dejure.org",
    fine="80 EUR, 1 point (BKat 22, Kraftfahrt-Bundesamt)",
)

_SIDE_GAP = quantity(1.0, "m", "olg-karlsruhe-2001", why="Enough under normal conditions")

O7 = Rule(
    id="de.stvo.5-4-2@2013",
    code="O7",
    article="§ 5(4) sentence 2 StVO",
    title="Lateral distance",
    gloss="Keep a sufficient distance to the side of others when overtaking.",
    # The StVO states one duty for all roads, so `min_outside` also holds in built-up areas.
    criterion=LateralDistance(min_outside=_SIDE_GAP),
    grade=Grade.LIGHT,
    required_by=EVERY_POLICY,
    limit_phrase=f"the {_SIDE_GAP} to the side of the overtaken vehicle",
    text_source=TextSource.READ,
    consulted_source="5(4) at dejure.org",
)

O8 = Rule(
    id="de.stvo.5-4a@2013",
    code="O8",
    article="§ 5(4a) StVO",
    title="Indicate",
    gloss="Announce moving out and moving back in time and clearly, with the indicators.",
    criterion=IndicatorUse(),
    grade=Grade.LIGHT,
    required_by=STRICT_ONLY,
    limit_phrase="the time of indicating",
    text_source=TextSource.READ,
    consulted_source="5(4a) at dein-gesetz.de",
)

O9 = Rule(
    id="de.stvo.5-3-2@2013",
    code="O9",
    article="§ 5(3) number 2 StVO; signs 276 and 277",
    title="Signs",
    gloss="Sign 276 forbids all motor vehicles to overtake motor vehicles other than two-wheelers, "
    "sign 277 forbids it to motor vehicles above 3.5 t.",
    # A road without zones (stretches with a sign) may be one whose signs were not recorded. Unless
    # a posted speed limit shows that signs were recorded, the rule is undecidable there.
    criterion=NoOvertakingSigns(exempts_two_wheelers=True, is_undecidable_without_zones=True),
    grade=Grade.LIGHT,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the end of the stretch where a sign forbids to overtake",
    text_source=TextSource.READ,
    consulted_source="5(3) at dejure.org; annex 2, numbers 53 and 54, at sicherestrassen.de",
)

_BICYCLE_GAP = quantity(2.0, "m", "de-stvo-2013", why="Outside built-up areas")
_BICYCLE_GAP_IN_TOWN = quantity(1.5, "m", "de-stvo-2013", why="Inside built-up areas")

O10 = Rule(
    id="de.stvo.5-4-3@2013",
    code="O10",
    article="§ 5(4) sentence 3 StVO",
    title="Overtaking a bicycle",
    gloss=f"Motor vehicles keep at least {_BICYCLE_GAP_IN_TOWN} to the side of those who walk or "
    f"cycle, outside built-up areas {_BICYCLE_GAP}.",
    criterion=LateralDistance(
        min_outside=_BICYCLE_GAP, min_in_town=_BICYCLE_GAP_IN_TOWN, is_for_bicycles=True
    ),
    grade=Grade.LIGHT,
    required_by=EVERY_POLICY,
    limit_phrase="the distance to the side of the bicycle",
    text_source=TextSource.READ,
    consulted_source="5(4) at dejure.org",
)

_RETURN_DELAY = ReturnDelay(opposing_lane_rule="O3")

O11 = Rule(
    id="de.stvo.5-4-5@2013",
    code="O11",
    article="§ 5(4) sentence 5 StVO",
    title="Duty to return",
    gloss="An overtaking driver moves back to the right as soon as possible.",
    criterion=_RETURN_DELAY,
    grade=Grade.LIGHT,
    required_by=EVERY_POLICY,
    limit_phrase=f"the {_RETURN_DELAY.max_delay} within which the return is due",
    text_source=TextSource.READ,
    consulted_source="5(4) at dein-gesetz.de",
)

O12 = Rule(
    id="de.stvo.5-4-6@2013",
    code="O12",
    article="§ 5(4) sentence 6 StVO",
    title="The overtaken is not hindered",
    gloss="An overtaking driver does not hinder the overtaken.",
    criterion=CalmFollower(manoeuvre=ManoeuvreKind.RETURN),
    grade=Grade.LIGHT,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the gap before which the overtaken vehicle need not brake hard",
    text_source=TextSource.READ,
    consulted_source="5(4) at dein-gesetz.de",
)

O13 = Rule(
    id="de.stvo.5-6@2013",
    code="O13",
    article="§ 5(6) sentence 1 StVO",
    title="Let others overtake",
    gloss="A driver being overtaken does not accelerate.",
    criterion=TargetSpeed(),
    grade=Grade.LIGHT,
    required_by=NO_POLICY,
    is_duty_of_ego=False,
    # "It" is the overtaken vehicle. Up to a small acceleration its speed counts as held.
    limit_phrase="the acceleration at which it still holds its speed",
    text_source=TextSource.READ,
    consulted_source="5(6) at dein-gesetz.de and fuehrerschein-bestehen.de",
)

# O3 and O14 to O16 measure one sentence of the law: the gap to oncoming vehicles as the ego is back
# and as it pulls out, their reaction, and the sight. O14 to O16 came after the first version of the
# pack, and `paper` does not require them. O15, about the intentions of others, is for `strict`.
O14 = Rule(
    id="de.stvo.5-2-1.pull-out@2013",
    code="O14",
    article="§ 5(2) sentence 1 StVO",
    title="Time to pass",
    gloss="Only those may overtake who can see that they will not hinder oncoming traffic at any "
    "time of the overtake.",
    criterion=TimeToPass(),
    grade=Grade.SERIOUS,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the gap to oncoming traffic that the overtake needs",
    text_source=TextSource.READ,
    consulted_source="5(2) at dejure.org",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)

O15 = Rule(
    id="de.stvo.5-2-1.oncoming@2013",
    code="O15",
    article="§ 5(2) sentence 1 StVO",
    title="No reaction of oncoming traffic",
    gloss=O14.gloss,
    criterion=NoOncomingReaction(),
    grade=Grade.SERIOUS,
    required_by=STRICT_ONLY,
    limit_phrase="the braking that may be forced on oncoming traffic",
    text_source=TextSource.READ,
    consulted_source="5(2) at dejure.org",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)

O16 = Rule(
    id="de.stvo.5-2-1.sight@2013",
    code="O16",
    article="§ 5(2) sentence 1 StVO",
    title="Sight of the road ahead",
    gloss=O14.gloss,
    criterion=PassingSightDistance(),
    grade=Grade.SERIOUS,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="the sight of the road that the overtake takes",
    text_source=TextSource.READ,
    consulted_source="5(2) at dejure.org",
    fine="100 EUR, 1 point (BKat 19, Kraftfahrt-Bundesamt)",
)

O17 = Rule(
    id="de.stvo.19-1-3.26-3@2013",
    code="O17",
    article="§ 19(1) sentence 3 and § 26(3) StVO",
    title="Crossings",
    gloss="Drivers do not overtake at crossings of pedestrians, and do not overtake motor vehicles "
    "at level crossings, from their sign on.",
    criterion=NoOvertakingAtCrossings(
        level_approach_length=quantity(
            240.0,
            "m",
            "de-stvo-2013",
            why="§ 19(1) sentence 3: from sign 156 on, which stands about so far ahead (annex 1)",
        )
    ),
    grade=Grade.LIGHT,
    required_by=DEFAULT_AND_STRICTER,
    limit_phrase="a place where one may overtake",
    text_source=TextSource.READ,
    consulted_source="19(1) at fahrschule.de; 26(3) at dejure.org and buzer.de; sign 156 in annex "
    "1 at librs.net (2009)",
    fine="80 EUR at crossings of pedestrians (BKat 113)",
)

_FOG_LAMP_RANGE = quantity(50.0, "m", "de-stvo-2013", why="§ 3(1) sentence 3, § 17(3)")

B1 = Rule(
    id="de.stvo.17@2013",
    code="B1",
    article="§ 17(1) to (3) StVO",
    title="Lamps",
    gloss="Low beam in the dark and where fog, snow or rain impair the sight considerably; no high "
    "beam that dazzles; rear fog lamps only if fog leaves less than "
    f"{_FOG_LAMP_RANGE} of sight.",
    criterion=Lamps(
        low_beam_max_range=quantity(
            100.0,
            "m",
            why="A choice, as in the Portuguese rule; § 17(3) says 'considerably'. Less sight in "
            "fog and rain makes low beam due by day",
        ),
        fog_lamp_max_range=_FOG_LAMP_RANGE,
        high_beam_min_gap=quantity(
            100.0,
            "m",
            why="A choice, as in the Portuguese rule; § 17(2) names no distance. High beam nearer "
            "to the leader breaks the rule",
        ),
        high_beam_min_oncoming_gap=quantity(
            200.0,
            "m",
            why="A choice, as in the Portuguese rule; § 17(2) names no distance. High beam nearer "
            "to an oncoming vehicle breaks the rule",
        ),
    ),
    grade=Grade.LIGHT,
    required_by=STRICT_ONLY,
    limit_phrase="the right lamps",
    text_source=TextSource.READ,
    consulted_source="17 at ra.de",
)

S1 = Rule(
    id="de.stvo.295@2013",
    code="S1",
    article="§ 41(1) StVO, annex 2, signs 295 and 296",
    title="Continuous line",
    gloss="A continuous line must not be driven over, not even in part; beside a broken one, the "
    "line of the own side rules.",
    criterion=SolidLines(),
    grade=Grade.LIGHT,
    required_by=EVERY_POLICY,
    limit_phrase="the continuous line",
    text_source=TextSource.READ,
    consulted_source="annex 2, number 68, at sicherestrassen.de; sign 296 at fahrlehrer-rathje.de",
)

# fmt: off
_RULES = (
    G1, F1, F2, V1, V1s, V2, V3, A1, A2, A3, A4, O1, O2, O3, O4, O5, O6, O7, O8, O9, O10, O11,
    O12, O13, O14, O15, O16, O17, B1, S1,
)
# fmt: on

# The second version of these readings of the text of 2013 as amended.
GERMANY = Pack(
    name="de",
    version="de-2@2013",
    rules=_RULES,
    source="de-stvo-2013",
    edition="Straßenverkehrs-Ordnung of 6 March 2013 as amended, in the reprints that are named, "
    "read on 23 November 2026; fines by the Punktekatalog of the Kraftfahrt-Bundesamt (overtaking)",
    severities="the catalogue of fines and points: light without a point, serious with one, very "
    "serious with two",
    accepts_unread_articles=False,  # So G1 and F2, known from quotations alone, are undecidable.
)
