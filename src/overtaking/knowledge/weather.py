"""What percent of rain, puddles, wind and fog mean, and what can be seen through them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from overtaking.knowledge.reader import read_section

if TYPE_CHECKING:
    from overtaking.knowledge.quantity import Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class RainRate:
    """Rate of rain R = max_rate (P / 100)^exponent, P in percent.

    Attributes:
        max_rate_mmph: Rate at 100 percent [mm/h].
        exponent: Of the percentage.
    """

    max_rate_mmph: float
    exponent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WaterFilm:
    """Film above the texture after Gallaway, from rate, path, slope and texture depth.

    h = coefficient MTD^texture_exponent L^path_exponent R^rate_exponent / S^slope_exponent - MTD,
    h and MTD in mm, drainage path L in m, R in mm/h, cross slope S as a ratio.

    Attributes:
        coefficient: For mm, m and mm/h.
        texture_exponent: Of the texture depth.
        path_exponent: Of the drainage path.
        rate_exponent: Of the rate of rain.
        slope_exponent: Of the cross slope, dividing.
        texture_depth_mm: Mean texture depth [mm].
        cross_slope: Fall over run.
        path_per_lane: Drainage path that each drained lane adds [m].
        wet_film_mm: Smallest film of a wet road [mm].
        wet_deposits_percent: Deposits from which a road counts as wet without rain.
    """

    coefficient: float
    texture_exponent: float
    path_exponent: float
    rate_exponent: float
    slope_exponent: float
    texture_depth_mm: float
    cross_slope: float
    path_per_lane: float
    wet_film_mm: float
    wet_deposits_percent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Puddles:
    """Film of a puddle = max_film max(0, (Q - from) / (100 - from)), Q in percent.

    Attributes:
        max_film_mm: At 100 percent [mm].
        from_percent: Deposits below which there is no puddle.
        full_cover: Part of the lane under puddles at 100 percent.
        first_wave: Length of one of the two waves that make the field [m].
        second_wave: Length of the other [m].
        slope: Share of the full depth per unit of the field below its threshold.
    """

    max_film_mm: float
    from_percent: float
    full_cover: float
    first_wave: float
    second_wave: float
    slope: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Wind:
    """Mean wind speed from percent, and the turbulence about it.

    Attributes:
        full_speed: Mean speed at 100 percent [m/s].
        turbulence_intensity: Standard deviation over mean.
        length_scale: Of the turbulence [m].
        peak_factor: Gust over mean.
        restricted_gust: Gust above which exposed bridges reduce the speed limit [m/s].
        restricted_speed: The reduced limit [m/s].
        angle_factor: On the relative wind's angle, in the side force.
    """

    full_speed: float
    turbulence_intensity: float
    length_scale: float
    peak_factor: float
    restricted_gust: float
    restricted_speed: float
    angle_factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Gusts:
    """Single 1 - cos gusts, where the wind is at least `from_percent`.

    Attributes:
        from_percent: Wind from which they occur.
        spacing: Mean distance between two [m].
        shortest: Length [m].
        longest: Length [m].
        smallest_ratio: Amplitude over the mean wind.
        largest_ratio: Amplitude over the mean wind.
    """

    from_percent: float
    spacing: float
    shortest: float
    longest: float
    smallest_ratio: float
    largest_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Shelter:
    """What a truck or van leaves of the cross wind beside it.

    Attributes:
        factor: Part of the cross wind that is left.
        reach: Lateral distance within which it acts [m].
        release_ratio: Distance of its return over the vehicle's length.
    """

    factor: float
    reach: float
    release_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fog:
    """MOR = clear_range (thick_range / clear_range)^(F / 100), F in percent.

    Attributes:
        clear_range: MOR at 0 percent [m].
        thick_range: MOR at 100 percent [m].
        transmission_depth: Optical depth of one MOR.
        band_edges: Ranges that bound the bands of reports [m].
    """

    clear_range: float
    thick_range: float
    transmission_depth: float
    band_edges: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Contrast:
    """Smallest contrast that is seen, by light, and the contrast of road markings.

    Attributes:
        threshold_day: By day.
        threshold_dusk: At dusk and dawn.
        threshold_night: At night, of unlit objects.
        marking_dry: Of a marking on a dry road.
        marking_wet: Of a marking on a wet road.
    """

    threshold_day: float
    threshold_dusk: float
    threshold_night: float
    marking_dry: float
    marking_wet: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RainSight:
    """Extinction of falling rain = coefficient R^exponent (1 + speed / speed_scale), R in mm/h.

    Attributes:
        coefficient: For R in mm/h [1/m].
        exponent: Of the rate.
        speed_scale: Own speed that doubles it [m/s].
        screen_rate_mmph: Rate that doubles the contrast threshold through a wet screen [mm/h].
    """

    coefficient: float
    exponent: float
    speed_scale: float
    screen_rate_mmph: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Spray:
    """Extinction of spray behind a vehicle, within `reach`.

    coefficient min(1, film / full_film) (leader's speed / speed_scale)^2 spray_factor

    Attributes:
        coefficient: Of a car at `speed_scale` [1/m].
        full_film_mm: Film above which there is no more spray [mm].
        speed_scale: Reference speed [m/s].
        reach: Length of the cloud [m].
    """

    coefficient: float
    full_film_mm: float
    speed_scale: float
    reach: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Lamps:
    """Intensity of rear lamps [cd], and the illuminance at which they are seen [lx].

    Attributes:
        rear_position: Intensity [cd].
        stop: Intensity [cd].
        rear_fog: Intensity [cd].
        threshold_night: Illuminance [lx].
        threshold_dusk: Illuminance [lx].
        threshold_day: Illuminance [lx].
    """

    rear_position: float
    stop: float
    rear_fog: float
    threshold_night: float
    threshold_dusk: float
    threshold_day: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Headlamps:
    """Distances at which one's own lamps show what is unlit [m].

    Attributes:
        low_beam: Range to an unlit object [m], with sigma.
        high_beam: Range to an unlit object [m], with sigma.
        wet_factor: On the ranges, where the road is wet.
        marking_dry: Range to a marking [m].
        marking_wet: Range to a marking [m].
        low_beam_within: Distance behind another vehicle that asks for low beam [m].
    """

    low_beam: Quantity
    high_beam: Quantity
    wet_factor: float
    marking_dry: float
    marking_wet: float
    low_beam_within: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Glare:
    """When a low sun dazzles, and by how much.

    Veil = coefficient E / angle^2 in cd/m^2, E in lx, angle in degrees.

    Attributes:
        highest_sun: Altitude above which there is none [rad].
        lowest_sun: Altitude below which there is none [rad].
        half_width: Largest angle between sun and heading [rad].
        most_cloud_percent: Cloudiness from which there is none.
        coefficient: For lx, degrees and cd/m^2.
        smallest_angle_deg: Below which the formula does not hold.
        sun_illuminance: Direct normal illuminance [lx].
        road_luminance: Background [cd/m^2].
    """

    highest_sun: float
    lowest_sun: float
    half_width: float
    most_cloud_percent: float
    coefficient: float
    smallest_angle_deg: float
    sun_illuminance: float
    road_luminance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgementErrors:
    """Coefficients of variation of what drivers judge.

    Attributes:
        distance_cv_day: Distance by day.
        distance_cv_night: Distance at night.
        distance_cv_fog: Distance in fog.
        closing_speed_cv: Closing speed that is seen.
        own_speed_cv_fog: Own speed in fog.
    """

    distance_cv_day: float
    distance_cv_night: float
    distance_cv_fog: float
    closing_speed_cv: float
    own_speed_cv_fog: float


@dataclass(frozen=True, slots=True, kw_only=True)
class WeatherMaps:
    """Every mapping of the weather, by topic.

    Attributes:
        rain: See `RainRate`.
        film: See `WaterFilm`.
        puddles: See `Puddles`.
        wind: See `Wind`.
        gusts: See `Gusts`.
        shelter: See `Shelter`.
        fog: See `Fog`.
        contrast: See `Contrast`.
        rain_sight: See `RainSight`.
        spray: See `Spray`.
        lamps: See `Lamps`.
        headlamps: See `Headlamps`.
        glare: See `Glare`.
        errors: See `JudgementErrors`.
    """

    rain: RainRate
    film: WaterFilm
    puddles: Puddles
    wind: Wind
    gusts: Gusts
    shelter: Shelter
    fog: Fog
    contrast: Contrast
    rain_sight: RainSight
    spray: Spray
    lamps: Lamps
    headlamps: Headlamps
    glare: Glare
    errors: JudgementErrors


@cache
def weather_maps() -> WeatherMaps:
    """The mappings of the weather; the source of each number is in `quantities("weather.toml")`."""
    return read_section(WeatherMaps, "weather.toml")
