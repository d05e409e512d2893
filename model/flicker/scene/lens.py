"""Which lenses are pinholes: names and coefficients of the camera models of COLMAP, nerfstudio and instant-ngp."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..errors import FlickerError
from .fields import numbers

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
COEFFICIENTS = ("k", "k0", "k1", "k2", "k3", "k4", "k5", "k6", "p0", "p1", "p2", "p3", "p4", "s0", "s1", "s2", "s3", "s4", "sx1", "sy1", "omega")


def lens_fault(model: str | None, coefficients: Mapping[str, float | None]) -> str | None:
    """Why a lens is no pinhole, as `field: reason`; None: it is one.

    model: name, in any case; None: not given, a pinhole but for its coefficients. coefficients: by name, None for those that are not given.
    """
    if model is not None and model.upper() not in PERSPECTIVE:
        return f"camera_model: {model} is no pinhole, and only pinholes are drawn: undistort the pictures first"
    bent = next(((name, value) for name, value in coefficients.items() if value), None)
    return None if bent is None else f"{bent[0]}: {bent[1]:g}: the lens distorts, and only pinholes are drawn: undistort the pictures first"


def said_fault(data: Mapping[str, Any]) -> str | None:
    """Why the lens that a JSON object describes, by the keys of nerfstudio and instant-ngp, is no pinhole, as `field: reason`; None: it is one.

    FlickerError for a coefficient that is no number.
    """
    for key in FLAGS:
        if data.get(key):
            return f"{key}: this is no pinhole, and only pinholes are drawn: undistort the pictures first"
    if any(re.match(r"ftheta_", key) for key in data):
        return "ftheta: this is no pinhole, and only pinholes are drawn: undistort the pictures first"
    model = data.get("camera_model")
    if model is not None and not isinstance(model, str):
        return "camera_model: not a text"
    listed = data.get("distortion_params")
    try:
        given = [] if listed is None else numbers(listed, "distortion_params", (len(listed),)).tolist()
    except (FlickerError, TypeError):
        return "distortion_params: not a list of numbers"
    coefficients = {key: None if data.get(key) is None else float(numbers(data[key], key, ())) for key in COEFFICIENTS}
    return lens_fault(model, coefficients | {f"distortion_params[{k}]": value for k, value in enumerate(given)})
