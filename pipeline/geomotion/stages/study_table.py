"""The table of a study: scores of its cells, averaged over seeds, beside the numbers of others."""

from collections.abc import Iterator, Mapping, Sequence
from statistics import fmean, stdev
from typing import Any

import numpy as np

from geomotion.config import ReferenceConfig, StudyConfig
from geomotion.tables import aligned, markdown, number

Document = Mapping[str, Any]
Key = tuple[str, str]  # dataset and variant
CONFIDENCE = 0.95
RESAMPLED = 2000  # means behind an interval


def table_document(study: StudyConfig, scores: Mapping[Key, Sequence[Document]], failures: list[str]) -> dict[str, Any]:
    """The table as plain types.

    Args:
        study: Columns, rows and references.
        scores: By dataset and variant: ``scores`` of every seed's ``scores.json``.
        failures: What could not be run, and why.
    """
    names = [column.score for column in study.columns]
    rows = []
    for dataset in study.datasets:
        for variant in study.variants:
            found = scores.get((dataset, variant.label), [])
            values = {name: _over_seeds([one.get(name) for one in found]) for name in names}
            reference = reference_values(study.reference, dataset, variant.label)
            rows.append({"dataset": dataset, "variant": variant.label, "values": values, "reference": reference})
    return {
        "title": study.title,
        "seeds": list(study.seeds),
        "columns": [
            {"score": column.score, "title": column.title, "units": _units(column.score, scores)}
            for column in study.columns
        ],
        "reference_source": study.reference.source if study.reference else None,
        "reference_columns": list(study.reference.columns) if study.reference else [],
        "rows": rows,
        "notes": list(study.notes),
        "failures": failures,
    }


def aligned_table(document: Document) -> str:
    """For the terminal: title, table, legend, notes, failures."""
    parts = [document["title"], aligned(list(lines(document))), "\n".join(legend(document))]
    parts += ["\n".join(document["notes"]), "\n".join(f"failed: {failure}" for failure in document["failures"])]
    return "\n\n".join(part for part in parts if part)


def markdown_table(document: Document) -> str:
    """The same for a page."""
    listed = ["\n".join(f"- {line}" for line in legend(document)), "\n\n".join(document["notes"])]
    parts = [f"**{document['title']}**", markdown(list(lines(document))), *listed]
    parts += ["\n".join(f"- failed: {failure}" for failure in document["failures"])]
    return "\n\n".join(part for part in parts if part) + "\n"


def lines(document: Document) -> Iterator[list[str]]:
    """Head and rows as text. A dataset is named once; references stand last, where there are any."""
    columns, others = document["columns"], []
    if any(row["reference"] for row in document["rows"]):
        others = [f"{document['reference_source']}: {name}" for name in document["reference_columns"]]
    yield ["dataset", "variant", *(one["title"] for one in columns), *others]
    before = None
    for row in document["rows"]:
        ours = [_cell(row["values"][one["score"]]) for one in columns]
        theirs = ["–" if value is None else f"{value:g}" for value in row["reference"]] or ["–"] * len(others)
        yield ["" if row["dataset"] == before else row["dataset"], row["variant"], *ours, *theirs[: len(others)]]
        before = row["dataset"]


def legend(document: Document) -> list[str]:
    """What each column is."""
    found = [f"{one['title']}: {one['score']}{_in_brackets(one['units'])}" for one in document["columns"]]
    if len(document["seeds"]) > 1:
        fewer = ", or those of them that did not fail" if document["failures"] else ""
        found.append(
            f"mean ± standard deviation over {len(document['seeds'])} seeds{fewer} [{CONFIDENCE:.0%} bootstrap "
            "interval of the mean, over seeds and what they judged]"
        )
    return found


def reference_values(reference: ReferenceConfig | None, dataset: str, variant: str) -> list[float | None]:
    """What others report of a variant on a dataset; empty if nothing."""
    rows = reference.rows if reference is not None else []
    return next((list(row.values) for row in rows if (row.dataset, row.variant) == (dataset, variant)), [])


def _over_seeds(scores: Sequence[Document | None]) -> dict[str, Any] | None:
    """Mean and standard deviation; None where no seed has the score, `mean` None where one is not finite."""
    known = [score for score in scores if score is not None]
    if not known:
        return None
    values = [score["value"] for score in known]
    if any(value is None for value in values):
        return {"mean": None, "spread": None, "interval": None, "values": values}
    spread = stdev(values) if len(values) > 1 else None
    return {"mean": fmean(values), "spread": spread, "interval": bootstrap_interval(known), "values": values}


def bootstrap_interval(scores: Sequence[Document]) -> list[float] | None:
    """Percentile interval of a mean over seeds, each of which is a mean over what it judged.

    Every seed judges the same demonstrations, or starts. So these are drawn with replacement once for all seeds: drawn
    for each seed anew, their differences would seem to average out with the number of seeds. Seeds alone are drawn
    where a score is no mean, or has too many values to be kept; None where there is one seed.

    Source: Owen, 2007, The pigeonhole bootstrap.
    """
    if len(scores) < 2:
        return None
    kept = [score["values"] if score["statistic"] == "mean" else [] for score in scores]
    has_same = len({len(values) for values in kept}) == 1 and len(kept[0]) > 0
    values = np.array(kept if has_same else [[score["value"]] for score in scores], dtype=float)  # (seed, judged)
    if not np.isfinite(values).all():
        return None
    generator = np.random.default_rng(0)
    seeds, judged = (generator.integers(count, size=(RESAMPLED, count)) for count in values.shape)
    resampled = values[seeds[:, :, None], judged[:, None, :]].mean(axis=(1, 2))
    tail = (1 - CONFIDENCE) / 2
    return [float(end) for end in np.quantile(resampled, (tail, 1 - tail))]


def _cell(value: Document | None) -> str:
    if value is None:
        return "–"
    low, high = value["interval"] or (0, 0)
    interval = f" [{low:.3g}, {high:.3g}]" if low < high else ""
    return number(value["mean"], value["spread"]) + interval


def _units(name: str, scores: Mapping[Key, Sequence[Document]]) -> dict[str, str]:
    """Unit of a score by dataset."""
    return {dataset: one[name]["unit"] for (dataset, _), cells in scores.items() for one in cells if name in one}


def _in_brackets(units: Mapping[str, str]) -> str:
    """The unit, or what it is on which datasets."""
    different = sorted(set(units.values()))
    if len(different) > 1:
        of = {unit: ", ".join(dataset for dataset, own in units.items() if own == unit) for unit in different}
        return f" [{'; '.join(f'{unit}: {datasets}' for unit, datasets in of.items())}]"
    return f" [{different[0]}]" if different and different[0] != "1" else ""
