"""Scenarios: from a profile, a seed and an index to a batch of scenarios.

driver_sampling        draws drivers from populations
motorway_traffic       traffic of one direction at a density
placed_traffic         vehicles placed independently, as in the study
profiles               reads profiles and overrides
random_draws           random streams, choices, importance sampling, blocks of simulations
recording_defaults     default values for quantities that a recording lacks
safe_start             repairs starts so that every driver can avoid the vehicle ahead
sampler                draws batches of scenarios, block by block
specification          sections of a specification; proposals
specification_values   value types of a specification, and messages about wrong values
traffic_specification  section `[traffic]`: placed, flow, two-way
two_way_traffic        traffic of both directions at rates of arrival
vehicle_sampling       draws vehicles
weather_sampling       draws weather and light
"""
