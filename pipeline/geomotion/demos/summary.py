"""What a dataset holds: numbers for machines, and a table for people."""

from typing import Any

import numpy as np

from geomotion.config import DatasetConfig
from geomotion.demos.demonstrations import CHANNEL_UNITS, Demonstrations, Trajectory
from geomotion.demos.selection import split, state_channels


def summarise(demonstrations: Demonstrations, config: DatasetConfig) -> dict[str, Any]:
    """Summary as JSON types; lengths and speeds are those of the first state channel, in its unit."""
    train, test = split(config, demonstrations)
    channel = state_channels(config, demonstrations)[0]
    sets = {**dict.fromkeys(train, "train"), **dict.fromkeys(test, "test")}
    demos = [
        {
            "demo": number,
            "label": trajectory.label,
            "condition": list(trajectory.condition),
            "set": sets.get(number, "unused"),
            **_numbers(trajectory, channel),
        }
        for number, trajectory in enumerate(demonstrations.trajectories)
    ]
    return {
        **demonstrations.description(),
        "summary_channel": channel,
        "unit": CHANNEL_UNITS[channel],
        "total": {
            "demos": len(demos),
            "points": sum(demo["points"] for demo in demos),
            "duration_s": sum(demo["duration_s"] for demo in demos),
        },
        "demos": demos,
    }


def _numbers(trajectory: Trajectory, channel: str) -> dict[str, Any]:
    values = trajectory.channels[channel]
    length = float(np.linalg.norm(np.diff(values, axis=0), axis=1).sum())
    return {
        "points": len(trajectory),
        "duration_s": trajectory.duration_s,
        "path_length": length,
        "mean_speed": length / trajectory.duration_s,
        "start": values[0].tolist(),
        "end": values[-1].tolist(),
    }


def summary_table(summary: dict[str, Any]) -> str:
    """The summary as lines of plain text."""
    unit, total = summary["unit"], summary["total"]
    columns = {
        "demo": [str(demo["demo"]) for demo in summary["demos"]],
        "set": [demo["set"] for demo in summary["demos"]],
        "points": [str(demo["points"]) for demo in summary["demos"]],
        "duration [s]": [f"{demo['duration_s']:.3f}" for demo in summary["demos"]],
        f"length [{unit}]": [f"{demo['path_length']:.4f}" for demo in summary["demos"]],
        f"speed [{unit}/s]": [f"{demo['mean_speed']:.4f}" for demo in summary["demos"]],
        f"start [{unit}]": [_vector(demo["start"]) for demo in summary["demos"]],
        f"end [{unit}]": [_vector(demo["end"]) for demo in summary["demos"]],
        "condition": [_vector(demo["condition"]) if demo["condition"] else "" for demo in summary["demos"]],
        "label": [demo["label"] for demo in summary["demos"]],
    }
    channels = ", ".join(f"{name} ({width})" for name, width in summary["channels"].items())
    return "\n".join(
        [
            f"{summary['name']}: {total['demos']} demonstrations, {total['points']} points, "
            f"{total['duration_s']:.2f} s",
            f"space     {summary['space']}, frame: {summary['frame']}",
            f"channels  {channels}",
            f"source    {summary['source']}",
            f"licence   {summary['licence'] or 'not stated'}",
            *(f"step {number}    {step}" for number, step in enumerate(summary["steps"], start=1)),
            "",
            *_lines({head: cells for head, cells in columns.items() if any(cells)}),
        ]
    )


def _vector(values: list[float]) -> str:
    """Coordinates without negative zeros."""
    return "(" + ", ".join(f"{round(value, 3) + 0.0:.3f}" for value in values) + ")"


def _lines(columns: dict[str, list[str]]) -> list[str]:
    """Columns side by side, each aligned to the right under its head."""
    widths = [max(map(len, [head, *cells])) for head, cells in columns.items()]
    rows = [list(columns), *zip(*columns.values(), strict=True)]
    return ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
