"""What differs by country in map files: the side of traffic, speed signs, and the unit on them."""

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
"""Codes of ISO 3166-1 (both the two-letter and the three-letter ones) of the countries whose
traffic keeps to the left, and the common UK."""

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
(`commonroad.scenario.traffic_sign`). None of the codes means anything else in its tables."""

_SPEED_SIGN = re.compile(f"(?:{'|'.join(map(re.escape, SPEED_SIGNS))})(?:-(?P<variant>[0-9]+))?")

# The highest limits that are posted anywhere: 85 mph in Texas, 160 km/h in Abu Dhabi. A value
# beyond them is no limit in m/s but the number on the sign.
_HIGHEST_MPS = {"mph": 85.5 * MPS_PER_MPH, "km/h": mps_from_kmh(160.5)}


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
    """The number on a speed sign by the variant in its code: 120 for 274-120, else None."""
    match = _speed_sign(code)
    variant = 0 if match is None or match["variant"] is None else int(match["variant"])
    # Variants of old catalogues, such as 274-53 for 30 km/h, are no speeds.
    return float(variant) if variant > 0 and variant % 5 == 0 else None


def _speed_sign(code: str) -> re.Match[str] | None:
    latin = code.strip().upper().replace("\N{GREEK CAPITAL LETTER RHO}", "P")
    return _SPEED_SIGN.fullmatch(latin)


def limit_in_mps(value: float, unit: str) -> float:
    """A limit that a file states in m/s, or as the number on the sign [m/s].

    Args:
        value: The stated value.
        unit: The unit on the signs of the country, "mph" or "km/h".
    """
    return value if value <= _HIGHEST_MPS[unit] else from_sign(value, unit)


def from_sign(number: float, unit: str) -> float:
    """The limit of a sign with a number on it [m/s]."""
    return number * MPS_PER_MPH if unit == "mph" else mps_from_kmh(number)
