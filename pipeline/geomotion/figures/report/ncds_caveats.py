"""What the numbers of a report do not say."""

from geomotion.figures.arrays import EvaluationArrays

ALWAYS = (
    "One seed, one training run: how much the scores change with the seed is not shown.",
    "The field is judged as an ideal source of velocities. A robot's controller, its sampling time and its own "
    "dynamics are not part of any number here.",
    "DTWD matches each point with the nearest one of the other curve, whatever their order in time; the time-warping "
    "and equal-time distances do respect it.",
)
PEERS = "The peers' protocol judges a model on demonstrations it was trained on. It says nothing about new ones."
NO_HELD_OUT = "No demonstration was held out: all reproduction scores are those of the training data."
BY_CONSTRUCTION = (
    "The guarantee concerns trajectories of the field in exact arithmetic and in the learned metric. It says nothing "
    "about how well the demonstrations are reproduced."
)
ON_MANIFOLD = (
    "Motions begin at the projection of their start onto the decoder's manifold, which is a jump. A robot that follows "
    "velocities from beside the manifold stays beside it: nothing brings it back, and nothing is proven."
)
BEYOND = {
    "by_construction": "follows from the claim alone",
    "by_construction_on_manifold": "follows from the claim on the decoder's manifold, and is unknown beside it",
    "verified_on_set": "follows from the claim inside the verified box, and is unknown outside",
}
REGION = "Steps inside the region depend on the grid of starts, the duration and the margin of the hull."


def caveats(data: EvaluationArrays, claim: str, protocol: str) -> list[str]:
    """Caveats of this run, then those of every run.

    Args:
        data: What was evaluated.
        claim: Claim of the certificate.
        protocol: Which demonstrations were judged.
    """
    found = [PEERS if protocol == "peers" else _held_out(data)]
    if data.eigenvalues is not None:
        where = "on a grid" if data.eigenvalues.shape else "at random points"
        points = f"{len(data.eigenvalues.true)} points around the demonstrations"
        beyond = BEYOND.get(claim, "is unknown")
        found.append(f"Contraction was sampled {where}: {points}. What happens between and beyond them {beyond}.")
    if claim == "by_construction":
        found.append(BY_CONSTRUCTION)
    if claim == "by_construction_on_manifold":
        found.append(ON_MANIFOLD)
    if data.region is not None:
        found.append(REGION)
    return [*found, *ALWAYS]


def _held_out(data: EvaluationArrays) -> str:
    count = sum(item.held_out for item in data.judged)
    noun = "demonstration" if count == 1 else "demonstrations"
    return (
        f"Held-out scores rest on {count} {noun} of the same task, most likely by the same person."
        if count
        else NO_HELD_OUT
    )
