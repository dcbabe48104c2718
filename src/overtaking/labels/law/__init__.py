"""Rules of law, their findings for each simulation, and the policies that require them.

- `numbers`, `texts`: numbers and texts of the law, from the files of the knowledge base;
- `margins`: margins over frames, and findings from them;
- `case`: spans of frames, neighbours, zones and speed limits of a case;
- `safe_distance`, `beliefs`, `measurement_errors`: gaps, beliefs of the driver, errors of margins;
- `rule`: the classes of rules and packs;
- `following`, `starting`, `alongside`, `returning`, `oncoming_traffic`, `lines_and_lanes`, `zones`,
  `sight`, `speed`, `lamps_and_indicators`: the Portuguese rules by subject;
- `portugal`, `germany`: the packs;
- `judging`: judge a case by a rule or a pack, and read the findings under a policy.
"""
