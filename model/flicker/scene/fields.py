"""Values of files that people and other programs write: JSON, numbers, with a message that names the field."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FlickerError, one_line

TRUTHS = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False, "none": False, "": False}  # of values that are texts
MAX_NUMBER = 1e30  # squares and products of such numbers stay finite in the projection


def read_json(path: Path) -> Any:
    """What a JSON file holds. FlickerError naming it."""
    try:
        return json.loads(path.read_bytes())
    except OSError as error:
        raise FlickerError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, RecursionError) as error:
        raise FlickerError(f"{path}: not JSON ({' '.join(str(error).split())})") from None


def numbers(value: Any, key: str, shape: tuple[int, ...]) -> np.ndarray:
    """float64 array of the given shape, every number finite."""
    what = "a number" if shape == () else f"{'x'.join(map(str, shape))} numbers"
    try:
        array = np.array(value)
        if array.shape != shape or array.dtype.kind not in "iufO":  # integers beyond 64 bits are objects
            raise FlickerError(f"{key}: not {what}")
        array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        raise FlickerError(f"{key}: not {what}") from None
    if not np.isfinite(array).all():
        raise FlickerError(f"{key}: not finite")
    if (np.abs(array) > MAX_NUMBER).any():
        raise FlickerError(f"{key}: beyond {MAX_NUMBER:g}")
    return array


def timestamp_of(entry: Mapping[str, Any]) -> float | None:
    """`timestamp` of a camera, seconds; None where it has none, or one that is no number, such as a date. FlickerError for a number that is not finite."""
    value = entry.get("timestamp")
    return float(numbers(value, "timestamp", ())) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def truth(data: Mapping[str, Any], key: str) -> bool:
    """Whether a key of a JSON object is true; "false" and the like are not, as texts too. FlickerError for what is neither."""
    value = data.get(key)
    if isinstance(value, str):
        value = TRUTHS.get(value.strip().lower())
        if value is None:
            raise FlickerError(f"{key}: '{one_line(data[key])}' is neither true nor false")
    elif not (value is None or isinstance(value, (bool, int, float))):
        raise FlickerError(f"{key}: neither true nor false")
    return bool(value)


def renamed(error: FlickerError, names: dict[str, str]) -> FlickerError:
    """An error `field: reason` with the name that the field has in a file; names: by ours."""
    field, colon, reason = str(error).partition(":")
    return FlickerError(f"{names.get(field, field)}{colon}{reason}")
