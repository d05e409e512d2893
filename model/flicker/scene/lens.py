"""Which lenses are pinholes: names and coefficients of the camera models of COLMAP, nerfstudio and instant-ngp."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..errors import FlickerError, one_line
from .fields import TRUTHS, numbers, truth

# Parameters of COLMAP's models, in the order of the files.
COLMAP_MODELS: dict[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": ("f", "cx", "cy"),
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "SIMPLE_RADIAL": ("f", "cx", "cy", "k"),
    "RADIAL": ("f", "cx", "cy", "k1", "k2"),
    "OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2"),
    "OPENCV_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"),
    "FULL_OPENCV": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "FOV": ("fx", "fy", "cx", "cy", "omega"),
    "SIMPLE_RADIAL_FISHEYE": ("f", "cx", "cy", "k"),
    "RADIAL_FISHEYE": ("f", "cx", "cy", "k1", "k2"),
    "THIN_PRISM_FISHEYE": ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
    "RAD_TAN_THIN_PRISM_FISHEYE": ("fx", "fy", "cx", "cy", "k0", "k1", "k2", "k3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3"),
    "SIMPLE_DIVISION": ("f", "cx", "cy", "k"),
    "DIVISION": ("fx", "fy", "cx", "cy", "k"),
    "SIMPLE_FISHEYE": ("f", "cx", "cy"),
    "FISHEYE": ("fx", "fy", "cx", "cy"),
}
# A pinhole when all their coefficients are zero. PERSPECTIVE: as nerfstudio calls it.
PERSPECTIVE = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV", "FOV", "SIMPLE_DIVISION", "DIVISION", "PERSPECTIVE")
FLAGS = ("is_fisheye", "fisheye", "latlong", "equirectangular", "orthographic")  # other projections, when true
# Keys by which other tools name a lens; camera_model is the one that is read.
_NAMES = ("camera_type", "lens_model", "lens_type", "projection", "projection_type", "distortion_model")
_DISTORTIONS = ("distortion", "distortion_coefficients", "distortion_coeffs", "dist_coeffs")  # and its coefficients, without their names
FOREIGN = (*_NAMES, *_DISTORTIONS)
_OTHER_PROJECTION = re.compile("fish|equirect|equidist|spher|panoram|omni|ortho|latlong|vr180|cylind|division|kannala|f-?theta", re.IGNORECASE)
COEFFICIENTS = ("k", "k0", "k1", "k2", "k3", "k4", "k5", "k6", "p0", "p1", "p2", "p3", "p4", "s0", "s1", "s2", "s3", "s4", "sx1", "sy1", "omega")


def lens_fault(model: str | None, coefficients: Mapping[str, float | None]) -> str | None:
    """Why a lens is no pinhole, as `field: reason`; None: it is one.

    model: name, in any case; None: not given, a pinhole but for its coefficients. coefficients: by name, None for those that are not given.
    """
    if model is not None and model.upper() not in PERSPECTIVE:
        return f"camera_model: {model} is no pinhole, and only pinholes are drawn: undistort the pictures first"
    bent = next(((name, value) for name, value in coefficients.items() if value), None)
    return None if bent is None else f"{bent[0]}: {bent[1]:g}: the lens distorts, and only pinholes are drawn: undistort the pictures first"


def _nothing(value: Any) -> bool:
    """Whether a value says that there is no distortion: none, false, 0, "none", lists and objects of such values."""
    if isinstance(value, (list, dict)):
        return all(map(_nothing, value.values() if isinstance(value, dict) else value))
    return value is None or value == 0 or (isinstance(value, str) and TRUTHS.get(value.strip().lower()) is False)


def foreign_fault(data: Mapping[str, Any]) -> str | None:
    """What a JSON object says of a lens by keys of other tools that would be passed over, as `field: reason`; None: nothing but a pinhole, or no more than
    its camera_model says."""
    said = data.get("camera_model")
    for key in () if said and str(said).upper() not in PERSPECTIVE else _NAMES:
        value = data.get(key)
        if isinstance(value, str) and _OTHER_PROJECTION.search(value):
            return f"{key}: {one_line(value)}: not read: a lens is wanted as camera_model, with its coefficients by their names"
    for key in _DISTORTIONS:
        if not _nothing(data.get(key)):
            return f"{key}: not read: coefficients are wanted by their names, k1, k2, ..."
    return None


def foreign_note(data: Mapping[str, Any]) -> str | None:
    """What is said of a name of a lens by another tool's key that is not known, which is taken for a pinhole, and of a rolling shutter; None: nothing.

    Names of other projections are `foreign_fault`'s."""
    known = {*COLMAP_MODELS, *PERSPECTIVE, "NONE", "", str(data.get("camera_model")).upper()}
    for key in _NAMES:
        value = data.get(key)
        if value is not None and not (isinstance(value, str) and (value.strip().upper() in known or _OTHER_PROJECTION.search(value))):
            return f"{key}: {one_line(value)}: not known, taken for a pinhole"
    return None if _nothing(data.get("rolling_shutter")) else "rolling_shutter: not used: all lines of a picture are taken for one moment's"


def said_fault(data: Mapping[str, Any]) -> str | None:
    """Why the lens that a JSON object describes, by the keys of nerfstudio and instant-ngp, is no pinhole, as `field: reason`; None: it is one.

    FlickerError for a coefficient that is no number, a flag that is neither true nor false.
    """
    for key in FLAGS:
        if truth(data, key):
            return f"{key}: this is no pinhole, and only pinholes are drawn: undistort the pictures first"
    if any(re.match(r"ftheta_", key) for key in data):
        return "ftheta: this is no pinhole, and only pinholes are drawn: undistort the pictures first"
    model = data.get("camera_model")
    if model is not None and not isinstance(model, str):
        return "camera_model: not a text"
    model = model or None
    if (fault := foreign_fault(data)) is not None:
        return fault
    listed = data.get("distortion_params")
    try:
        given = [] if listed is None else numbers(listed, "distortion_params", (len(listed),)).tolist()
    except (FlickerError, TypeError):
        return "distortion_params: not a list of numbers"
    coefficients = {key: None if data.get(key) is None else float(numbers(data[key], key, ())) for key in COEFFICIENTS}
    return lens_fault(model, coefficients | {f"distortion_params[{k}]": value for k, value in enumerate(given)})
