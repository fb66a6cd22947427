"""The box at the top of a report: what is claimed, in words for people who want to run the motion on a robot."""

from dataclasses import dataclass
from typing import Literal

Tone = Literal["proven", "measured", "contradicted", "found", "doubtful", "not-found"]


@dataclass(frozen=True)
class Finding:
    """A sentence, and whether what it says is as it should be."""

    text: str
    is_good: bool = True


@dataclass(frozen=True)
class Verdict:
    """The box at the top of the page.

    Attributes:
        tone: How much trust the claim deserves.
        headline: A few words.
        sentences: What is claimed, and what was measured.
        facts: Names and values behind them.
        facts_title: What they are.
    """

    tone: Tone
    headline: str
    sentences: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    facts_title: str = "Certificate"
