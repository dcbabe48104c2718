"""From trajectories to verdicts and reasons.

- `snapshots`: single frames, and spans of frames;
- `signals`: signals of the ego and its target, by the compiled engine;
- `event_detection`: events of the overtake, its outcome and the detail of the outcome;
- `law`: rules, and what they say of a batch;
- `attempt_features`, `paper_features`, `safety_features`: features, measures of safety;
- `labelling`: all of these, one after the other;
- `explanation`: reasons of a verdict.
"""
