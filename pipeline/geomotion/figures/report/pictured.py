"""What a report says of policies that look at pictures."""

from collections.abc import Mapping
from typing import Any

from geomotion.figures.report.page import Column, Listing
from geomotion.figures.report.pictures import Captions
from geomotion.figures.report.scores import Headline
from geomotion.figures.report.verdict import Verdict
from geomotion.figures.style import percent

FILM = (
    "An episode in closed loop",
    "Look, grasp, look, drop. The hand holds the object by friction; where an object was moved, the hand looked again.",
)
CAPTIONS: Captions = {
    "demonstrations": (
        "Demonstrations",
        "The hand's way to three places of the object, and from there to above the bin.",
    ),
    "snapshots": (
        "Pictures",
        "What the policies see: objects at the three places in turn, and anywhere between them, before the grasp and "
        "before the drop. Light, colours, textures and the camera's pose differ.",
    ),
    "episodes": (
        "Episodes",
        "The table from above. Lines lead from where the object lay to where the hand meant to grasp it.",
    ),
}
ALWAYS = (
    "Everything is simulated, pictures included: one object, one renderer, an ideal servo. "
    "The object is rigid and looks soft.",
    "A certificate holds under a condition that stands still; after another look the motion goes on under another.",
    "Success is counted by contacts and by where the object lies, not by the motion of the hand.",
)
LABELS = {"places": "At the demonstrated places", "between": "At unseen places", "moved": "Moved before the grasp"}


def verdict(certificates: Mapping[str, Mapping[str, Any]], acted: Mapping[str, Any]) -> Verdict:
    """Put certificates and episodes into words."""
    rates = {skill: one["rate_per_s"] for skill, one in certificates.items()}
    proven = all(rate is not None for rate in rates.values())
    listed = " and ".join(f"{rate:.2g} 1/s for the {skill}" for skill, rate in rates.items() if rate is not None)
    claim = (
        "Under every picture, motions come together from any two starts, in a learned metric; "
        f"at the shown places at {listed}."
        if proven
        else "Nothing guarantees that motions from different starts come together."
    )
    facts = {f"Claim for the {skill}": one["claim"].replace("_", " ") for skill, one in certificates.items()}
    facts |= {f"Grounds for the {skill}": str(one.get("reason", "not stated")) for skill, one in certificates.items()}
    headline = "Contracting under every picture" if proven else "No guarantee: contraction is measured only"
    encoder = f"Pictures are encoded by ResNet-18 with {acted['encoder']['weights']}."
    return Verdict("proven" if proven else "measured", headline, (claim, encoder), tuple(facts.items()))


def headlines(acted: Mapping[str, Any], embedded: Mapping[str, Mapping[str, Any]]) -> list[Headline]:
    """How many episodes succeeded, and how well places are told."""
    found = []
    for name, group in acted["groups"].items():
        if group["episodes"]:
            error = f"median aiming error {1000 * group['median_aiming_error_m']:.1f} mm"
            note = f"{group['succeeded']} of {group['episodes']} objects were lifted and lie in the bin; {error}"
            found.append(Headline(LABELS[name], percent(group["share"]), note))
    right = min(one["held_out"]["place_accuracy"] for one in embedded.values())
    found.append(Headline("Place told right", percent(right), "of pictures that were not trained on, the worse skill"))
    return found


def caveats(encoder: Mapping[str, Any]) -> list[str]:
    """What the numbers do not say."""
    return [f"The encoder has {encoder['weights']}. Other weights give other numbers.", *ALWAYS]


def confusion_listing(embedded: Mapping[str, Any]) -> Listing:
    """How often each place is taken for which."""
    confusion = embedded["held_out"]["confusion"]
    names = [f"place {number}" for number in range(1, len(confusion) + 1)]
    if embedded["knows_elsewhere"]:
        names[-1] = "elsewhere"
    columns = (Column("picture of", is_text=True), *(Column(f"taken for {name}") for name in names))
    rows = tuple((name, *map(str, row)) for name, row in zip(names, confusion, strict=True))
    return Listing(f"Places in unseen pictures, before the {embedded['skill']}", columns, rows)
