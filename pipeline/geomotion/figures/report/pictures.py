"""Pictures and films of a run, inlined, with captions that say what to look for."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from geomotion.figures.style import PNG_DPI

SCREEN_DPI = 130  # a little larger than in print
PNG_WIDTH, GIF_WIDTH = slice(16, 20), slice(6, 8)  # where headers say it
FILM_WIDTH = 640

Captions = Mapping[str, tuple[str, str]]


@dataclass(frozen=True)
class Picture:
    """An image that the page carries in itself.

    Attributes:
        title: What it shows.
        caption: What to look for.
        source: PNG or GIF as a data URI.
        width: Width on the screen [px]; the same scale for all, so that their letters have one size.
    """

    title: str
    caption: str
    source: str
    width: int


def pictures(folders: Sequence[Path], captions: Captions) -> dict[str, Picture]:
    """The pictures that lie in the figure folders, by name, in the order of the captions.

    Args:
        folders: Where stages left pictures.
        captions: Title and caption of each known name.
    """
    found = {}
    for name, (title, caption) in captions.items():
        path = next((folder / f"{name}.png" for folder in folders if (folder / f"{name}.png").is_file()), None)
        if path is not None:
            png = path.read_bytes()
            width = int.from_bytes(png[PNG_WIDTH], "big")
            found[name] = Picture(title, caption, _data_uri("png", png), round(width * SCREEN_DPI / PNG_DPI))
    return found


def film(path: Path, title: str, caption: str) -> Picture:
    """A film as an animated GIF, enlarged so far that it is seen well."""
    gif = path.read_bytes()
    width = int.from_bytes(gif[GIF_WIDTH], "little")
    return Picture(title, caption, _data_uri("gif", gif), min(max(width, FILM_WIDTH), 2 * width))


def _data_uri(kind: str, content: bytes) -> str:
    return f"data:image/{kind};base64,{b64encode(content).decode()}"
