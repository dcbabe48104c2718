"""Rules of law, their findings for each simulation, and the policies that require them.

- `numbers`: `quantity`, and the numbers that several criteria share;
- `margins`: margins over frames, and findings from them;
- `case`: spans of frames, neighbours, zones, sight and speed limits of a case;
- `safe_distance`, `beliefs`, `measurement_errors`: gaps, beliefs of the driver, errors of margins;
- `remedies`: a breach, and the changes that would have kept the rule;
- `rule`: the classes of criteria, rules and packs;
- `criteria`: how duties are measured, one module for each subject;
- `portugal`, `germany`: the laws, each with its rules, their numbers and its pack;
- `judging`: judge a case by a rule or a pack, and read the findings under a policy.
"""
