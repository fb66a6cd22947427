"""Recordings fetched once from where they were published, compared with a checksum and kept in the user's cache."""

import logging
import os
from pathlib import Path

from geomotion.errors import DatasetError, MissingData

TIMEOUT_S = 10.0


def named_folder(root: str | None, variable: str) -> Path | None:
    """Folder of recordings that are here already: the setting, or else the environment variable; None for neither."""
    named = root or os.environ.get(variable)
    return Path(named).expanduser() if named else None


def fetched(url: str, sha256: str, path_in_cache: str, what: str, how_to_get: str) -> Path:
    """The file in the user's cache.

    Args:
        url: Where it was published.
        sha256: Its checksum.
        path_in_cache: Folder and name below this program's cache.
        what: Its name, for people.
        how_to_get: What to do without a connection.

    Raises:
        MissingData: If it is not in the cache and cannot be downloaded.
        DatasetError: If what came is not what was published.
    """
    import pooch

    pooch.get_logger().setLevel(logging.WARNING)
    path = Path(pooch.os_cache("geomotion")) / path_in_cache
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
