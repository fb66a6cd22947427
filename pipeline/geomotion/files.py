"""Files that are either whole or absent: written beside their place and renamed."""

import io
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from uuid import uuid4

from geomotion.errors import CorruptArtefact, DiskFull, MissingData, is_disk_full


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """A temporary path in the same folder, renamed to `path` on success and deleted otherwise.

    The temporary name keeps the suffix of `path`, because writers choose their format by it.

    Raises:
        DiskFull: If space, quota or a size limit ran out.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    name = f"{temporary_prefix(path)}-{uuid4().hex}{path.suffix}"
    temporary = path.with_name(name)  # unlike mkstemp's, with usual permissions
    try:
        yield temporary
        temporary.replace(path)
    except OSError as error:
        if is_disk_full(error):
            raise DiskFull(path) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def temporary_prefix(path: Path) -> str:
    """How the names of files begin that a process killed in `atomic` leaves beside `path`."""
    return f".{path.stem}"


def write_bytes(path: Path, data: bytes) -> None:
    """Write a whole file or none."""
    with atomic(path) as temporary:
        temporary.write_bytes(data)


def write_tensors(path: Path, document: object) -> None:
    """Write what `torch.save` takes; equal content gives equal bytes, which it does not where torch knows the name."""
    import torch

    buffer = io.BytesIO()
    torch.save(document, buffer)
    write_bytes(path, buffer.getvalue())


def write_text(path: Path, text: str) -> None:
    """Write a whole UTF-8 file or none."""
    write_bytes(path, text.encode())


def write_json(path: Path, document: object) -> None:
    """Write a JSON document, refusing NaN and infinity, which JSON has no word for."""
    write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


def read_json(path: Path) -> Any:
    """Read a JSON document.

    Raises:
        MissingData: If there is no such file.
        CorruptArtefact: If it is not JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise MissingData(str(path), "It is written by an earlier stage; repeat that stage.") from error
    except (ValueError, UnicodeDecodeError) as error:
        raise CorruptArtefact(path, f"not a JSON document ({error})") from error
