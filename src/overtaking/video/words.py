"""What the classes and policies that a film names mean, each in a few words."""

from overtaking.model.labels import OvertakeClass

CLASSES = {
    OvertakeClass.NO_ATTEMPT: "did not try to overtake",
    OvertakeClass.SUCCESS_I: "overtook, broke a rule",
    OvertakeClass.SUCCESS_L: "overtook, broke no rule",
    OvertakeClass.UNSUCCESS_COL: "tried to overtake, collided",
    OvertakeClass.UNSUCCESS_NCOL: "tried, did not complete it",
    OvertakeClass.SUCCESS_U: "overtook, law undecidable",
    OvertakeClass.CENSORED: "recording ends too early",
}

POLICIES = {
    "paper": "rules that the study can decide",
    "default": "also rules of weather and road",
    "strict": "also signals, lamps, keeping right",
}
"""Which rules count under a policy."""


def explained(label: OvertakeClass, policy: str) -> str:
    """A class under a policy, in one line."""
    return f"{CLASSES[label]} · policy {policy}: {POLICIES[policy]}"
