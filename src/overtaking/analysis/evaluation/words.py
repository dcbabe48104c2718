"""What an evaluation says in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from overtaking.analysis.evaluation.bootstrap import FEW, REPEATS
from overtaking.analysis.evaluation.endpoints import POLICY, PRIMARY
from overtaking.analysis.evaluation.results import TOO_FEW

if TYPE_CHECKING:
    from overtaking.analysis.evaluation.results import Evaluation

NO_CLAIM: Final = (
    "No conformity with any regulation or standard is claimed. Criteria of UN Regulations 79 and "
    "157 are measured in simulations; an approval asks for tests and audits."
)

NO_FILMS: Final = "There are no films."

LEAST_EFFECTIVE: Final = 0.2
"""Share of the scenes below which the weights leave little."""

ABOUT: Final = {
    "outcome": "How the scenes end. A scene with an attempt counts once, whatever the number of "
    "tries.",
    "safety": "Contacts and near-crashes of the ego. A near-crash is less than 1.5 s to collision "
    "with a hard reaction, and no contact in the next 5 s.",
    "law": "Portuguese law. A scene without a breach keeps every rule that a policy of the law "
    "requires; a rule is counted where it applies.",
    "comfort": "Quantiles are those of each scene, averaged over the scenes.",
    "lane changes": "The ego's own lane changes by the criteria of UN Regulations 79 and 157. They "
    "begin where the body comes over the line.",
    "conflicts": "A conflict is a near-crash or a contact. The ego began it if it changed lane or "
    "was over a line in the last 5 s, or came too close to a leader that neither braked nor had "
    "entered its lane.",
}

METHODS: Final = (
    "Every driver meets the same scenes: same weather, same others, same random numbers. The "
    "others react, so what they do afterwards differs.",
    "Scenes are weighted by w = p(x) / q(x), with x the scene and the others: q(x) = (1 - S) p(x) "
    "+ sum of s_k q_k(x) over the components of the profile, without what they bend of the ego. "
    "The ego's traits are drawn as they are met.",
    f"Intervals of differences are those of the paired bootstrap by scene, {REPEATS:,} repeats, "
    f"95 %. A difference is judged if {FEW} pairs of scenes or more differ. The four primary "
    "endpoints were fixed beforehand and are not corrected for their number; p-values of all "
    "others are corrected by Holm's method.",
    "Time gained is how much earlier the ego is where it is than the one that stays in its lane, "
    "at the last moment that both have.",
)


def title(found: Evaluation) -> str:
    """The heading."""
    return f"{found.policy} beside {_listed(found.references)}"


def lead(found: Evaluation) -> str:
    """The primary endpoints in one line."""
    said: list[str] = []
    for endpoint in PRIMARY:
        for verdict in ("better", "worse"):
            than = [
                one.reference
                for one in found.contrasts
                if one.is_primary and one.endpoint == endpoint and one.verdict == verdict
            ]
            if than:
                about = endpoint.title.partition(",")[0]
                said.append(f"{about}: {verdict} than {_listed(than)}")
    if not said:
        said = ["no primary endpoint shows a difference"]
    profile_note = f" (asked for: {found.asked_profile})" if found.asked_profile else ""
    return f"{found.simulations:,} scenes of {found.profile}{profile_note}: {'; '.join(said)}."


def risk_note(named: str, drawn: str) -> str:
    """Explain that scenes of the `-risk` profile are drawn instead.

    Args:
        named: Name of the profile that the caller named.
        drawn: Name of the profile that is drawn.
    """
    return (
        f"Scenes are drawn from {drawn}, in which dangerous scenes are more frequent, and weights "
        f"restore the rates of {named}. --natural (natural=True) draws scenes of {named} itself."
    )


def notes(found: Evaluation) -> list[str]:
    """What to know before the numbers."""
    return [
        *([risk_note(found.asked_profile, found.profile)] if found.asked_profile else []),
        NO_CLAIM,
        f"Classes and breaches of the law are read under the policy {POLICY}.",
        "Legality is the verdict of a rule set, an interpretation for research, not legal advice.",
        f"The driver observes: {found.observe}. One that observes as humans do is compared with "
        "them on equal terms; one with a sensor or the truth is not.",
    ]


def warnings(found: Evaluation) -> list[str]:
    """What weakens the numbers."""
    said: list[str] = []
    few = sorted(
        {
            one.endpoint.name.replace("_", "-")
            for one in found.contrasts
            if one.is_primary and one.verdict == TOO_FEW
        }
    )
    if few:
        said.append(
            f"Too few scenes differ in {_listed(few)}: nothing is said of a difference there. "
            "More scenes may tell."
        )
    if found.effective < LEAST_EFFECTIVE * found.simulations:
        said.append(
            f"The weights leave {found.effective:,.0f} effective scenes of {found.simulations:,}."
        )
    if clipped := int(found.counts[found.policy]["clipped"]):
        said.append(f"{clipped:,} answers of the driver were beyond the limits, and clipped.")
    return said


def _listed(names: tuple[str, ...] | list[str]) -> str:
    """Names as a sentence has them."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
