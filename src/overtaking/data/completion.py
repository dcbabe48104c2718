"""The last files of a data set: the data card, then the manifest that says it is complete."""

from overtaking.data.card import README_NAME, Card
from overtaking.data.croissant import CROISSANT_NAME, croissant
from overtaking.data.location import Location
from overtaking.data.manifest import (
    BalanceRecord,
    Manifest,
    ShardRecord,
    content_hash,
    now,
    write_manifest,
)


def complete(
    location: Location,
    manifest: Manifest,
    shards: tuple[ShardRecord, ...],
    balance: BalanceRecord | None = None,
) -> None:
    """Write the data card, then the manifest, which makes the data set complete.

    Args:
        location: Where it lies.
        manifest: What the manifest says so far.
        shards: All shards.
        balance: What became of the cells of a balanced data set.

    Raises:
        OSError: They cannot be written.
    """
    changes = {
        "complete": True,
        "content_hash": content_hash(shards),
        "shards": shards,
        "balance": balance,
        "provenance": manifest.provenance.model_copy(
            update={"finished": manifest.provenance.finished or now()}
        ),
    }
    card = Card(manifest.model_copy(update=changes))
    location.put_text(README_NAME, card.readme())
    location.put_text(CROISSANT_NAME, croissant(card))
    if not manifest.complete or manifest.shards != shards:
        write_manifest(location, card.manifest)
