"""Why a picture is empty: where the Gaussians of a scene lie as seen from a camera."""

from __future__ import annotations

import numpy as np

from ..params import ALPHA_MIN
from ..scene.camera import Camera
from ..scene.gaussians import Scene
from .projection import NEAR, project
from .view import View

BEHIND, FAINT, INSIDE = f"behind the camera, or nearer than {NEAR:g}", "too faint, opacity below 1/255", "in the picture"


def places(scene: Scene, camera: Camera) -> dict[str, int]:
    """Gaussians by place, those with none left out: behind, beside the picture, in it but too faint, in it. The 3-sigma box of the float64 projection decides;
    one beside a corner counts for the side that it is farther from."""
    t = (scene.means.astype(np.float64) - camera.position) @ camera.rotation
    ahead = t[:, 2] > NEAR
    inside = np.zeros(len(scene), bool)
    inside[project(scene, camera).index] = True
    faint = inside & (scene.opacities < ALPHA_MIN)
    found = {BEHIND: int((~ahead).sum())}
    x, y, z = t[ahead & ~inside].T
    over = np.stack([  # pixels beyond each side
        -(camera.fx * x / z + camera.cx), camera.fx * x / z + camera.cx - camera.width, -(camera.fy * y / z + camera.cy),
        camera.fy * y / z + camera.cy - camera.height,
    ])
    side = over.argmax(axis=0)
    found |= {f"{name} the picture": int((side == k).sum()) for k, name in enumerate(("left of", "right of", "above", "below"))}
    found |= {FAINT: int(faint.sum()), INSIDE: int((inside & ~faint).sum())}
    return {name: count for name, count in found.items() if count}


def unseen(view: View, image: np.ndarray, visible: int | None = None) -> dict[str, int] | None:
    """`places` of a view whose picture (H, W, 3) is its background and nothing else, or that sees no Gaussian; None: something is seen.

    visible: Gaussians that an engine saw; None: it does not say.
    """
    flat = image.reshape(-1, 3)
    if visible != 0 and (flat != flat[0]).any():
        return None
    if visible != 0 and np.abs(flat[0] - np.asarray(view.background)).max() > 0.5 / 255:
        return None
    return places(view.scene, view.camera)


def advice(found: dict[str, int], cameras_from: str, cameras: int) -> str:
    """What to try for a picture in which nothing is seen. found: of `places`. cameras: how many there are."""
    if set(found) <= {FAINT, INSIDE}:
        return "what lies in the picture is too faint to be drawn, or has the colour of the background"
    other = [f"another --view (0 to {cameras - 1})"] if cameras > 1 else []
    if cameras_from.startswith("orbit"):
        other += ["another axis (--up)", "cameras of the training (--cameras)"]
    else:
        other += [f"cameras that belong to this scene (--cameras; these are of {cameras_from})"]
    return f"try {', or '.join([', '.join(other[:-1]), other[-1]] if len(other) > 1 else other)}"


def why_empty(view: View) -> str | None:
    """One line for a view in which the float64 projection sees no Gaussian that can be drawn; None: it sees some."""
    found = places(view.scene, view.camera)
    if INSIDE in found:
        return None
    return f"nothing is seen: {', '.join(f'{name}: {count:,}' for name, count in found.items())}; {advice(found, view.cameras_from, 1)}"
