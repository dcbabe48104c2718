"""Margins, frame by frame, of the rules that look at every frame."""

from overtaking.core.arrays import F64
from overtaking.labels.labelling import LabelledTrajectories
from overtaking.labels.law.portugal import PORTUGAL
from overtaking.labels.law.rule import Pack, Rule
from overtaking.model.verdicts import Case, Verdict


def margins_by_frame(labelled: LabelledTrajectories, pack: Pack = PORTUGAL) -> dict[str, F64]:
    """Margins of one simulation, frame by frame; the smallest is the margin of the finding.

    Args:
        labelled: A batch of one simulation with its findings.
        pack: The pack of rules that the findings were made with.

    Returns:
        By code of the rule, the margins of the rules that are legal or illegal in this simulation
        and have a margin in every frame: speed limits, distances to the leader and to the side,
        stopping within sight. Shape (time,), in the unit of the rule, negative in a breach, NaN in
        frames that the rule does not judge. Other rules judge single instants or durations.
    """
    case, findings = labelled.case(), labelled.findings
    verdicts = dict(zip(findings.rule_codes, findings.verdict[0].tolist(), strict=True))
    margins_by_code = {
        rule.code: _margins_by_frame(rule, case)
        for rule in pack.rules
        if verdicts[rule.code] in (Verdict.LEGAL, Verdict.ILLEGAL)
    }
    return {code: margins for code, margins in margins_by_code.items() if margins is not None}


def _margins_by_frame(rule: Rule, case: Case) -> F64 | None:
    """Margins of one rule, as `Criterion.margins_by_frame`."""
    return None if rule.criterion is None else rule.criterion.margins_by_frame(case)
