"""Pictures of a scene with what is known of it."""

import hashlib
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from geomotion.errors import CorruptArtefact, ShapeMismatch
from geomotion.files import atomic

BETWEEN = -1  # number of the place where there is none

Pictures = UInt8[np.ndarray, "picture height width 3"]


@dataclass(frozen=True)
class Snapshots:
    """Pictures, and where the object lies in each.

    Attributes:
        pictures: Red, green and blue from 0 to 255.
        place: Number of the demonstrated place that was meant; -1 for anywhere between.
        object_m: Where the object lies on the table [m].
        is_on_the_way: Whether the hand has left its place of rest.
    """

    pictures: Pictures
    place: Int[np.ndarray, " picture"]
    object_m: Float[np.ndarray, "picture 2"]
    is_on_the_way: Bool[np.ndarray, " picture"]

    def __len__(self) -> int:
        return len(self.pictures)

    def save(self, path: Path) -> None:
        """Write all of it, compressed without loss."""
        with atomic(path) as temporary:
            np.savez_compressed(
                temporary,
                allow_pickle=False,
                pictures=self.pictures,
                place=self.place,
                object_m=self.object_m,
                is_on_the_way=self.is_on_the_way,
            )

    @classmethod
    def load(cls, path: Path) -> "Snapshots":
        """Read what :meth:`save` wrote.

        Raises:
            CorruptArtefact: If the file is damaged, or of something else.
        """
        try:
            with np.load(path, allow_pickle=False) as found:
                return cls(**{name: found[name] for name in ("pictures", "place", "object_m", "is_on_the_way")})
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            raise CorruptArtefact(path, f"it holds no snapshots ({error})") from error


def check_pictures(pictures: np.ndarray, side_px: int | None = None) -> None:
    """Refuse what is no stack of RGB pictures with eight bits a channel.

    Args:
        pictures: Shape (picture, height, width, 3).
        side_px: Height and width that are needed; None for any.

    Raises:
        ShapeMismatch: If the mode or the size is another.
    """
    if pictures.dtype != np.uint8 or pictures.ndim != 4 or pictures.shape[-1] != 3:
        raise ShapeMismatch("pictures", "RGB with 8 bits a channel, (picture, height, width, 3) uint8", _mode(pictures))
    if side_px is not None and pictures.shape[1:3] != (side_px, side_px):
        height, width = pictures.shape[1:3]
        raise ShapeMismatch("size of a picture", f"{side_px} x {side_px}, as in training", f"{width} x {height}")


def digest_of_picture(picture: np.ndarray) -> str:
    """SHA-256 of shape and content."""
    return hashlib.sha256(repr(picture.shape).encode() + np.ascontiguousarray(picture).tobytes()).hexdigest()


def _mode(pictures: np.ndarray) -> str:
    return f"{tuple(pictures.shape)} {pictures.dtype}"
