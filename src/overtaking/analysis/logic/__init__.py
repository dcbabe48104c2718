"""Data sets as logic: facts, rules of ASP programs, queries, and proofs of breaches.

Every argument is an integer of a declared type or a constant, and no term of a program can leave
32 bits.

Modules:
    vocabulary: Types, predicates, and the rounding of measurements to integers.
    simulation_groups: Groups of simulations of a data set.
    fact_source: The recordings in which facts are measured.
    fact_declaration: Declarations of facts.
    road_facts: Facts about the road.
    simulation_facts: Facts about a simulation as a whole: weather, class, outcome, events, target.
    vehicle_facts: Facts about the vehicles of a simulation.
    law_facts: Measurements of the ego that only the law reads.
    fact_files: Facts as text, and folders of files.
    programs: Predicates and rules of the programs, their dependencies, and ranges of values.
    query: Queries: parse, refuse, answer.
    reasoner: clingo in a process beside this one.
    reasoner_process: That process.
    proof: Proofs of breaches.
"""
