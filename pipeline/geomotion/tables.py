"""Tables as plain text and as Markdown."""

from collections.abc import Sequence

Rows = Sequence[Sequence[str]]


def aligned(rows: Rows) -> str:
    """Rows of equal length in columns as wide as their widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def markdown(rows: Rows) -> str:
    """The first row as head; cells must not contain bars."""
    head, *body = rows
    return "\n".join("| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *body])


def number(value: float | None, spread: float | None) -> str:
    """A score in print, with its spread where there is one; None is what JSON keeps of NaN and infinity."""
    if value is None:
        return "not finite"
    return f"{value:.4g} ± {spread:.3g}" if spread else f"{value:.4g}"
