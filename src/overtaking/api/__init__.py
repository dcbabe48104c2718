"""The public functions, by subject.

datasets            generate, resume, load and label data sets again; query them in SQL
simulating          sample, simulate, drive, branch and label in memory
evaluation          a driver compared with others in the same scenes; benchmarks; loading of drivers
studies             a profile compared with measurements, simulators with each other, ours with the
                    paper; statistics of a data set
reports             figures, films and pages
file_formats        recordings in other formats, and data sets written in other formats
law                 laws and tolerances compared, verdicts explained, packs of rules loaded
logic               questions in logic, and proofs
learning            learned rules and factors
whatif              counterfactuals, futures, sufficient changes, saved branches
carla               CARLA: handling limits, replay, a server for its clients
simulator_registry  simulators by name

Users import `overtaking`, which has most of these functions, and `overtaking.law`, `whatif`,
`logic`, `learning` and `carla`.
"""
