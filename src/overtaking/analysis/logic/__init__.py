"""Data sets as logic: facts, rules of ASP programs, queries, and proofs of breaches.

The programs are written for clingo, a solver for answer set programming (ASP). Every argument is an
integer of a declared type or a constant, and no term of a program can leave the 32 bits of clingo's
integers.

Modules:
    vocabulary: Types, predicates, and the rounding of measurements to integers.
    simulation_groups: Groups of simulations of a data set.
    fact_source: The recordings from which facts are measured.
    fact_declaration: Declarations of facts.
    road_facts: Facts about the road.
    simulation_facts: Facts about a simulation as a whole: weather, class, outcome, events, target.
    vehicle_facts: Facts about the vehicles of a simulation.
    law_facts: Measurements of the ego that only the law reads.
    fact_files: Facts as text, and folders of files.
    programs: Predicates and rules of the programs, their dependencies, and ranges of values.
    query: Queries: parse a query, refuse an invalid one, answer it.
    reasoner: clingo in a worker process, as the parent sees it.
    reasoner_process: The module that runs in the worker process.
    proof: Proofs of breaches.
"""
