"""Physics of road, weather and sight, and the inputs of the simulation step.

The step moves all vehicles of a batch of simulations by 10 ms. Modules `..._parameters` compute its
inputs once before a simulation, from a `Scenario`: the road, and the weather, vehicles and drivers
of each simulation. The others hold formulas that they share with the step and with the rules of the
law.

constants            numbers of the model, and switches that disable its effects, such as fog
driver_parameters    inputs from drivers: desired speeds, car following, passing
road_parameters      inputs from the road: borders of lanes, tables of sight, lines and limits
road_surface         film of water, friction of tyres, stopping distance
sight_distance       how far a road is visible round bends and over crests
step_parameters      tables of all inputs of a batch, for both simulators (Python, compiled)
surrogate_safety     measures of near-crashes, such as the time to collision
vehicle_parameters   inputs from vehicle bodies and their starts
visibility           extinction, contrast, lamps, glare
weather_parameters   inputs from weather and light
"""
