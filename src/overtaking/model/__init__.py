"""Frozen data classes of everything that the package exchanges; no formulas beyond validity.

Modules:
    batch: `Batch`, its declared fields (`FieldSpec`), `concatenate`, one cached result per batch
    checks: checks of batches and of the arguments of public functions
    driver_interface: observations and actions of a driver: names, units, order
    ego_signals: signals of the ego, its neighbours and its target, frame by frame
    import_report: the findings about a recording
    known_roads: the roads that come with the package
    neighbours: `NeighbourRole`, the six neighbours, and the meaning of left
    overtake_events: phases of an overtake as frame numbers; its outcome and the detail
    overtake_features: the paper's fifteen features, and the state at an attempt
    pedal_controls: pedals and front wheels of vehicles that a program drives from outside
    reference_line: lines, arcs and clothoids in the plane
    road: roads and lanes
    road_course: changes along a road: bends, grade, centre line, zones, speed limits, sight
    safety_measures: surrogate measures of safety, also against oncoming vehicles
    scenario: scenarios, and the interventions of branches
    trajectories: recorded states, contacts and percepts
    vehicle_tracks: `VehicleTracks`, one simulation in SI units and road coordinates
    vehicles: vehicles and the traits of their drivers
    verdicts: verdicts of rules and classes of simulations
    weather: weather, and weather without some of its factors
"""
