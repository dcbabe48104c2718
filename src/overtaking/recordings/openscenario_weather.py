"""Weather, light and grip of simulations, in the words of OpenSCENARIO 1.3."""

from math import pi, tau

from overtaking.core.arrays import F32
from overtaking.knowledge.toml_reader import constant
from overtaking.model.scenario import Scenario
from overtaking.model.trajectories import Trajectories
from overtaking.world.road_surface import rain_rate
from overtaking.world.visibility import meteorological_range, sun_illuminance
from overtaking.world.weather_parameters import scene_conditions

_OKTAS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight")
_PERCENT = 0.01


def environments(trajectories: Trajectories) -> list[str]:
    """The action that sets the weather of each simulation; empty where it is not known."""
    scenario = trajectories.scenario
    if "weather" in trajectories.unknown:
        return [""] * scenario.num_simulations
    weather = scenario.weather
    rows = zip(
        rain_rate(weather.rain).tolist(),
        meteorological_range(weather.fog).tolist(),
        sun_illuminance(weather.sun_altitude).tolist(),
        _friction_scale(scenario).tolist(),
        strict=True,
    )
    return [_environment(scenario, place, *row) for place, row in enumerate(rows)]


def _friction_scale(scenario: Scenario) -> F32:
    """Grip on this road over that on a dry one, (simulation,) [1]."""
    on_dry = scenario.replace(weather=scenario.weather.without("rain"))
    wet, best = (scene_conditions(batch).believed_friction for batch in (scenario, on_dry))
    return wet / best


def _environment(
    scenario: Scenario, place: int, rain: float, sight: float, light: float, friction: float
) -> str:
    """The environment of one simulation.

    The azimuth of the sun is counted clockwise from north, the y axis of a map. The wind blows to
    its direction, which is counted as headings are.
    """
    weather, heading = scenario.weather, scenario.road.heading
    azimuth = (pi / 2 - heading - float(weather.sun_azimuth[place])) % tau
    towards = (heading + float(weather.wind_direction[place])) % tau
    speed = float(constant("weather.wind.full_speed")) * _PERCENT * float(weather.wind[place])
    oktas = _OKTAS[round(float(weather.cloudiness[place]) * _PERCENT * 8)]
    wetness = "wetWithPuddles" if weather.puddles[place] > 0 else "moist" if rain > 0 else "dry"
    hour = "00" if weather.night[place] else "12"
    return (
        '<GlobalAction><EnvironmentAction><Environment name="weather">'
        f'<TimeOfDay animation="false" dateTime="1970-01-01T{hour}:00:00"/>'
        f'<Weather fractionalCloudCover="{oktas}Oktas">'
        f'<Sun azimuth="{azimuth:.4f}" elevation="{weather.sun_altitude[place]:.4f}"'
        f' illuminance="{light:.0f}"/><Fog visualRange="{sight:.1f}"/>'
        f'<Precipitation precipitationType="{"rain" if rain > 0 else "dry"}"'
        f' precipitationIntensity="{rain:.3f}"/>'
        f'<Wind direction="{towards:.4f}" speed="{speed:.3f}"/></Weather>'
        f'<RoadCondition frictionScaleFactor="{friction:.4f}" wetness="{wetness}"/>'
        "</Environment></EnvironmentAction></GlobalAction>"
    )
