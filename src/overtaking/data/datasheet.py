"""The questions that a datasheet asks of a data set, answered from what its manifest says.

The questions follow T. Gebru et al., Datasheets for Datasets, Communications of the ACM 64(12),
2021, doi:10.1145/3458723, in our words. What only the publisher can know is left to the publisher,
and says so.
"""

from overtaking.data.manifest import Identity, ShardRecord
from overtaking.data.recipe import Keep

Answers = dict[str, str]
"""Short answers by the keys of `CHAPTERS`."""

CHAPTERS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (
        "Motivation",
        (("purpose", "What it is for"), ("makers", "Who made it, who paid for it")),
    ),
    (
        "Composition",
        (
            ("instances", "What a record stands for, and how many there are"),
            ("completeness", "Everything, or a sample"),
            ("labels", "Labels"),
            ("missing", "What is missing"),
            ("relations", "How records belong together"),
            ("splits", "Splits for training and testing"),
            ("errors", "Errors and noise"),
            ("people", "People and confidential matters"),
        ),
    ),
    (
        "Collection",
        (
            ("acquisition", "How it was acquired"),
            ("sampling", "How it was sampled"),
            ("time", "When"),
            ("consent", "Review and consent"),
        ),
    ),
    (
        "Preparation",
        (("preprocessing", "What was done to the values"), ("raw", "Where the raw values are")),
    ),
    ("Uses", (("uses", "What it is good for"), ("limits", "What it is not good for"))),
    (
        "Distribution and maintenance",
        (("licence", "Who may use it"), ("maintenance", "Who keeps it in order")),
    ),
)
"""The chapters of the datasheet; each question is a key of `Answers` and what it asks."""

_ALWAYS: Answers = {
    "purpose": "Made to study when overtaking succeeds, when it fails or is not even begun, and "
    "whether it is lawful.",
    "makers": "Whoever ran the package `overtaking`; that is not recorded, so the publisher says.",
    "labels": "`labels` has a class for each simulation and policy, `findings` the verdict on each "
    "rule of the Portuguese Highway Code, `events` what happened when, `features` the features of "
    "the study that the package continues. A program found all of them in the recorded motion; "
    "nobody annotated anything by hand. `rule_set` names the version of the rules.",
    "relations": "By the keys `simulation`, `vehicle`, `frame` and `weather`, which mean the same "
    "in every table.",
    "time": "`provenance` in `dataset.json` has the dates of the work. It is part of no hash.",
    "licence": "The package puts no licence on its output. The publisher names one, as `license` "
    "in the head of this file and in `croissant.json`.",
    "maintenance": "The publisher does. `overtaking label` makes the tables of labels anew when "
    "rules have changed, and with them this file, `croissant.json` and the content hash; what was "
    "added to these files by hand is then gone.",
}

_SIMULATED: Answers = _ALWAYS | {
    "instances": "A simulation: an ego vehicle among others on {road}, {simulations} in all, with "
    "{vehicles} vehicles.{frames}",
    "missing": "Nothing that the model computes{unknown}. Null means that there is nothing to "
    "state, such as the partner of a collision that did not happen.",
    "splits": "No split is given. Simulations are drawn independently, so any split by "
    "`simulation` is fair; a split by row would put parts of one simulation on both sides.",
    "errors": "Values are those of the model, rounded to the step in the column's name. What the "
    "ego saw wrongly is recorded beside the truth where `percepts` has rows.",
    "people": "No person is in it: everything that moves is simulated.",
    "acquisition": "Computed by the simulator `{simulator}`, version {simulator_version} of the "
    "model, from the specification in `dataset.json`.",
    "consent": "Nobody was observed, so nobody was asked.",
    "preprocessing": "Nothing was cleaned or filled in.",
    "raw": "There are no raw values: recipe and seed make the same values again.",
    "uses": "Statistics of overtaking, training and testing of classifiers, testing of rule "
    "checkers and planners, studies of what perception and weather change.",
    "limits": "Class shares and rates of collisions are those of the profile `{profile}`, not of "
    "any real road. Vehicles move as the model lets them. It is no evidence that a vehicle is "
    "safe, and its verdicts are no legal advice.",
}

_RECORDED: Answers = _ALWAYS | {
    "instances": "A scene: an ego vehicle among others on {road}, cut from a recording; "
    "{simulations} in all, with {vehicles} vehicles.{frames}",
    "completeness": "A sample: the scenes that the package found by the options in "
    "`dataset.json`, where `counts` says how many there were.",
    "missing": "What the recording does not tell is null{unknown}. Rules that need it are "
    "undecidable.",
    "splits": "No split is given. Scenes of one recording may share vehicles and minutes: a fair "
    "split is by recording.",
    "errors": "Errors are those of the recording, and those of laying it on a straight road; "
    "`notes` in `dataset.json` has what was measured of them.",
    "people": "Positions and sizes of vehicles, which may be those of real people. What the "
    "recording does about that, its owners say.",
    "acquisition": "Read from a recording of others in the format {profile}, version "
    "{simulator_version} of the reader; `dataset.json` names its files by their checksums.",
    "sampling": "Not sampled: every scene that was found is there, with the weight 1.",
    "consent": "What was asked of whom, the owners of the recording say.",
    "preprocessing": "The road was straightened, scenes were cut, values were rounded to the step "
    "in the column's name.",
    "raw": "The raw values are with the owners of the recording.",
    "uses": "Statistics of overtaking, comparison with simulations, testing of rule checkers.",
    "licence": "Whom the owners of the recording allow to. The package puts no licence on its "
    "output; the publisher names one, as `license` in the head of this file and in "
    "`croissant.json`.",
    "limits": "It shows one place and time. Verdicts rest on what was recorded and are no legal "
    "advice.",
}

_IN_ORDER = (
    "A sample of the profile's scenarios, which are without end: those with the numbers 0 to "
    "{last}. None was left out."
)
_CHOSEN = (
    "A selection: of {candidates} candidates, those that fill the cells of the table above. Class "
    "shares are chosen, not natural; `class_weight` in `labels` gives back the natural ones."
)
_DRAWN = (
    "Pseudo-random, by the generator Philox from the seed {seed} and the number of the scenario. "
    "`weight` in `simulations` is natural over sampled probability."
)
_FRAMES = "Their motion has {states} rows in `states`."
_NO_FRAMES = "Their motion was not kept; the package simulates it again when it is asked for."


def answers(
    identity: Identity, shards: tuple[ShardRecord, ...], candidates: int | None = None
) -> Answers:
    """What can be said of a data set.

    Args:
        identity: What decides the content.
        shards: All shards.
        candidates: How many were looked at to balance it; None if it is not balanced.

    Returns:
        An answer for each key of `CHAPTERS`, in Markdown without line breaks.
    """
    texts = _RECORDED if identity.source else _sampled(candidates)
    simulations = sum(shard.simulations for shard in shards)
    facts = {
        **identity.model_dump(include={"profile", "simulator", "simulator_version", "seed"}),
        "road": f"the road {plain(identity.road.name)}",
        "simulations": simulations,
        "last": simulations - 1,
        "vehicles": num_rows("vehicles", shards),
        "frames": f" {_motion(identity, shards)}",
        "unknown": _unknown(identity),
        "candidates": candidates,
    }
    return {key: text.format(**facts) for key, text in texts.items()}


def datasheet(given: Answers) -> str:
    """The chapter of the data card with these answers."""
    chapters = "\n".join(
        f"### {title}\n\n" + "".join(f"- **{asked}.** {given[key]}\n" for key, asked in questions)
        for title, questions in CHAPTERS
    )
    return (
        "## Datasheet\n\nThe questions are those of T. Gebru et al., *Datasheets for Datasets*, "
        f"2021, in short.\n\n{chapters}"
    )


def num_rows(table: str, shards: tuple[ShardRecord, ...]) -> int:
    """Number of rows of a table in all shards."""
    return sum(shard.tables[table].rows for shard in shards)


def plain(text: str) -> str:
    """A name from elsewhere without what Markdown, YAML or a terminal would take for a command."""
    return "".join(one if one.isprintable() and one not in "`|<>[]" else "?" for one in text)


def _sampled(candidates: int | None) -> Answers:
    """The texts about simulations."""
    completeness = _IN_ORDER if candidates is None else _CHOSEN
    return _SIMULATED | {"completeness": completeness, "sampling": _DRAWN}


def _motion(identity: Identity, shards: tuple[ShardRecord, ...]) -> str:
    """What there is of the vehicles' motion."""
    if identity.keep is Keep.FEATURES:
        return _NO_FRAMES
    return _FRAMES.format(states=num_rows("states", shards))


def _unknown(identity: Identity) -> str:
    """What the source does not tell, as a part of a sentence."""
    names = ", ".join(name.replace("_", " ") for name in identity.unknown)
    if not names:
        return ""
    if identity.source:
        return f": {names}"
    return f", except what the simulator `{identity.simulator}` does not tell: {names}"
