"""Differences between countries in map files: side of traffic, speed signs, unit on the signs."""

import re

from overtaking.core.units import mps_from_kmh

MPS_PER_MPH = 0.44704
"""Exact: 1609.344 m in 3600 s, international yard and pound agreement, 1959."""

_LEFT_HAND = (
    "AG ATG,AI AIA,AU AUS,BB BRB,BD BGD,BM BMU,BN BRN,BS BHS,BT BTN,BW BWA,CK COK,CY CYP,DM DMA,"
    "FJ FJI,FK FLK,GB GBR,GD GRD,GG GGY,GY GUY,HK HKG,ID IDN,IE IRL,IM IMN,IN IND,JE JEY,JM JAM,"
    "JP JPN,KE KEN,KI KIR,KN KNA,KY CYM,LC LCA,LK LKA,LS LSO,MO MAC,MS MSR,MT MLT,MU MUS,MV MDV,"
    "MW MWI,MY MYS,MZ MOZ,NA NAM,NP NPL,NR NRU,NZ NZL,PG PNG,PK PAK,SB SLB,SC SYC,SG SGP,SH SHN,"
    "SR SUR,SZ SWZ,TC TCA,TH THA,TL TLS,TO TON,TT TTO,TV TUV,TZ TZA,UG UGA,VC VCT,VG VGB,VI VIR,"
    "WS WSM,ZA ZAF,ZM ZMB,ZW ZWE"
)
LEFT_HAND = frozenset(re.split("[ ,]", _LEFT_HAND)) | {"UK"}
"""Countries and territories with left-hand traffic: codes of ISO 3166-1 of two and three letters,
and the customary UK."""

_MILES = frozenset({"GB", "GBR", "UK", "US", "USA", "PR", "PRI", "LR", "LBR"})
"""Countries whose signs show miles per hour."""

SPEED_SIGNS = (
    "274",  # Germany, also used for China, Italy and the fictional Zamunda (ZAM).
    "274.1",  # Germany, the beginning of a zone.
    "R2-1",  # USA, Puerto Rico.
    "R301",  # Spain.
    "3.24",  # Russia.
    "R15",  # Argentina.
    "C43",  # Belgium.
    "B14",  # France.
    "P-32",  # Greece; the letter is a Greek rho.
    "B31",  # Croatia.
)
"""Signs that post a speed limit, as commonroad-io 2026.1 lists them by country
(`commonroad.scenario.traffic_sign`). No country of that list uses one of the codes for another
sign, so the country of a scenario need not be known."""

_SPEED_SIGN = re.compile(f"(?:{'|'.join(map(re.escape, SPEED_SIGNS))})(?:-(?P<variant>[0-9]+))?")

_HIGHEST_MPS = {"mph": 85.5 * MPS_PER_MPH, "km/h": mps_from_kmh(160.5)}
"""The highest limits that signs post by unit, 85 mph in Texas and 160 km/h in Abu Dhabi, with half
a unit for rounding [m/s]. A larger value in a file is the number on the sign."""


def keeps_left(country: str) -> bool:
    """Whether the traffic of a country keeps to the left.

    Args:
        country: A code of ISO 3166-1, of two or three letters.
    """
    return country.upper() in LEFT_HAND


def speed_unit(country: str | None) -> str:
    """The unit on the speed signs of a country: "mph" or "km/h"."""
    return "mph" if country is not None and country.upper() in _MILES else "km/h"


def is_speed_sign(code: str) -> bool:
    """Whether a sign posts a speed limit.

    Args:
        code: Code of the sign in the catalogue of its country, with or without the number of a
            variant, such as 274 or 274-120.
    """
    return _speed_sign(code) is not None


def number_on_sign(code: str) -> float | None:
    """The number on a speed sign by the variant in its code, such as 120 for 274-120, else None."""
    match = _speed_sign(code)
    variant = 0 if match is None or match["variant"] is None else int(match["variant"])
    # Old German catalogues number the variants instead: 274-53 is 30 km/h, 274-55 is 50 km/h. The
    # speeds on German signs are 5 km/h and multiples of 10 km/h, elsewhere multiples of 5.
    step = 10 if code.strip().startswith("274") and variant != 5 else 5
    return float(variant) if variant > 0 and variant % step == 0 else None


def _speed_sign(code: str) -> re.Match[str] | None:
    latin = code.strip().upper().replace("\N{GREEK CAPITAL LETTER RHO}", "P")
    return _SPEED_SIGN.fullmatch(latin)


def limit_in_mps(value: float, unit: str) -> float:
    """The limit that a file states, in m/s or as the number on the sign [m/s].

    Args:
        value: The stated value.
        unit: The unit on the signs of the country, "mph" or "km/h".
    """
    return value if value <= _HIGHEST_MPS[unit] else from_sign(value, unit)


def from_sign(number: float, unit: str) -> float:
    """The limit of a sign with a number on it [m/s]."""
    return number * MPS_PER_MPH if unit == "mph" else mps_from_kmh(number)
