"""What the readers of scene files give, and the conversions that they share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .gaussians import SH_C0, SH_DEGREES

if TYPE_CHECKING:
    import gsply  # loads numba

MAX_DEGREE = 3
KEPT = (MAX_DEGREE + 1) ** 2  # SH coefficients a colour
FLAT_NOTE = "2DGS (surfels of two scales): drawn as flat 3D Gaussians, not by where rays meet a surfel"


@dataclass(eq=False)
class Raw:
    """Gaussians as a file says them, activated and unchecked, of any float type.

    means: (N, 3). scales: (N, 3), linear, 0 for flat. quats: (N, 4), w first, of any length. opacities: (N,). sh: (N, K, 3), K of degree 0 to 3, as in Scene.
    antialiased: as in Scene. notes: what was assumed, approximated or dropped, in words that follow the file's name.
    """

    means: np.ndarray
    scales: np.ndarray
    quats: np.ndarray
    opacities: np.ndarray
    sh: np.ndarray
    antialiased: bool = False
    notes: tuple[str, ...] = ()


def sigmoid(logits: np.ndarray) -> np.ndarray:
    """float32: 1 of +inf, 0 of -inf, NaN of NaN."""
    with np.errstate(over="ignore"):
        return (1.0 / (1.0 + np.exp(-logits.astype(np.float64)))).astype(np.float32)


def sh_of_colours(colours: np.ndarray) -> np.ndarray:
    """float64 (N, 1, 3): the constant harmonic of colours (N, 3) in [0, 1]."""
    return ((colours.astype(np.float64) - 0.5) / SH_C0)[:, None]


def degree_of(coefficients: int) -> int | None:
    """SH degree of so many coefficients a colour, the constant one among them; None where no degree has so many."""
    degree = int(np.sqrt(coefficients) + 0.5) - 1
    return degree if (degree + 1) ** 2 == coefficients else None


def cut_note(coefficients: int) -> tuple[str, ...]:
    """What to say of a file with so many coefficients a colour: nothing where all are kept."""
    if coefficients <= KEPT:
        return ()
    return (f"SH of degree {degree_of(coefficients)} cut to {MAX_DEGREE}: {coefficients - KEPT} of {coefficients} coefficients a colour are left out",)


def of_gsply(data: gsply.GSData) -> Raw:
    """gsply gives every format as INRIA PLY holds it: log scales, logit opacities, quaternions w first, sh0 and shN (N, K, 3)."""
    rest = data.shN
    count = len(data.means)
    bands = 0 if rest is None else rest.shape[1]
    if bands + 1 not in SH_DEGREES:
        raise ValueError(f"{bands} SH coefficients a colour")
    sh = np.empty((count, bands + 1, 3), np.float32)
    sh[:, 0] = data.sh0
    if bands:
        sh[:, 1:] = rest
    return Raw(data.means, np.exp(data.scales), data.quats, sigmoid(data.opacities.reshape(count)), sh)
