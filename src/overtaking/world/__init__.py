"""Physics of road, weather and sight, and the parameters of the simulation step.

constants            model constants, the clock, effects that can be switched off
driver_parameters    speeds, following and passing of drivers, as parameters of the step
road_parameters      the road as the step sees it
road_surface         film of water and friction of tyres
sight_distance       how far a road is visible round bends and over crests
step_parameters      all parameters of a batch
surrogate_safety     time gap, TTC, DRAC, PICUD, RSS
vehicle_parameters   vehicle bodies, as parameters of the step
visibility           extinction, contrast, lamps, glare
weather_parameters   weather and light of each simulation, as parameters of the step
"""
