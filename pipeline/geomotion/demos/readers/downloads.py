"""Recordings fetched once from where they were published, compared with a checksum and kept in the user's cache."""

import logging
import os
from pathlib import Path

from geomotion.errors import DatasetError, MissingData

TIMEOUT_S = 10.0


def recording(root: str | None, variable: str, url: str, sha256: str | None, cache: str, what: str) -> Path:
    """A file that is here already, or else is fetched.

    Args:
        root: Its folder; None: the one that an environment variable names, if that is set.
        variable: Name of that variable.
        url: Where it was published, under the same name.
        sha256: Its checksum; None: it is not fetched.
        cache: Where it is kept below this program's cache.
        what: Its name, for people.

    Raises:
        MissingData: If it is not in the folder, or cannot be downloaded.
        DatasetError: If what came is not what was published.
    """
    how_to_get = f"Get {url} and set dataset.root= or {variable} to its folder."
    named = root or os.environ.get(variable)
    if named:
        path = Path(named).expanduser() / url.rpartition("/")[2]
        if not path.is_file():
            raise MissingData(f"{path} ({what})", how_to_get)
        return path
    if sha256 is None:
        raise MissingData(what, how_to_get)
    return _fetched(url, sha256, cache, what, how_to_get)


def _fetched(url: str, sha256: str, cache: str, what: str, how_to_get: str) -> Path:
    """The file in the user's cache."""
    import pooch

    pooch.get_logger().setLevel(logging.WARNING)
    path = Path(pooch.os_cache("geomotion")) / cache
    try:
        found = pooch.retrieve(
            url,
            known_hash=f"sha256:{sha256}",
            fname=path.name,
            path=path.parent,
            downloader=pooch.HTTPDownloader(timeout=TIMEOUT_S),
        )
    except OSError as error:  # no connection, no permission, no space; requests' errors derive from it
        raise MissingData(what, f"It could not be downloaded. {how_to_get}") from error
    except ValueError as error:  # pooch's word for a wrong checksum
        raise DatasetError(url, "downloaded file differs from its SHA-256; try again") from error
    return Path(found)
