"""`make docs PART=photographs`: Table 1 against photographs, in docs/results/photographs.md: scenes fitted, pruned, fine-tuned, also through the test.

An hour on two cores; what is fitted stays in build/photographs under a digest of the options, and an interrupted run goes on from there. Delete the folder
when the optimisation itself has changed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from flicker.budget.score import Score, scores
from flicker.explore.evaluate import evaluate
from flicker.explore.points import Point, SceneFile
from flicker.explore.store import Store
from flicker.fit.dataset import Dataset, load_dataset
from flicker.fit.parameters import Parameters
from flicker.fit.train import Options, Trainer
from flicker.fit.undistort import undistort
from flicker.markdown import table
from flicker.report.claims import drop
from flicker.scene import Scene
from flicker.scene.camera import cameras_text
from flicker.scene.files import load_scene, save_ply
from flicker.toolchain import BUILD

from .common import Say, folder_of_scenes

FOLDER = BUILD / "photographs"
KEPT = 0.5  # of the Gaussians
TUNED = Options(iterations=3000, tune=True)  # the paper's number
THROUGH = Options(iterations=300, tune=True, through="faithful")
FITTED = Options(iterations=4000, gaussians=60_000)  # of photographs that come without a scene


@dataclass(frozen=True)
class Photographs:
    """Photographs of the folder of scenes. size: longer side. flat: their lens is taken out first. fitted: they come with a scene."""

    name: str
    size: int
    flat: bool = False
    fitted: bool = True


SCENES = (Photographs("lego", 400), Photographs("kunkun", 480), Photographs("fox", 400, flat=True, fitted=False))
# Rows: which of the scenes, what draws it ("" the float64 reference, "assumed" what errors of `faithful` would come to), what it is called.
ROWS = (
    ("base", "", "Base.: the fit, float64"), ("pruned", "", f"Prun.: {KEPT:.0%} kept, {TUNED.iterations:,} iterations, float64"),
    ("pruned", "no-ctu-32-conic", "VRU in conic form, no test"), ("pruned", "faithful", "Ours: `faithful`"),
    ("pruned", "assumed", "it would lose, were its errors uncorrelated with the picture's"),
    ("through", "faithful", f"`faithful`, {THROUGH.iterations} more iterations through its test"),
    ("pruned", "flicker-sparse-mixed-conic", "Uniform-Sparse"), ("pruned", "flicker", "`flicker`"), ("pruned", "log-lanes", "`log-lanes`"),
    ("base", "faithful", "the fit, `faithful`"), ("base", "log-lanes", "the fit, `log-lanes`"),
)


def kept(path: Path, make: Callable[[], Scene]) -> Path:
    """A file that is made when it is not there."""
    if not path.exists():
        made = path.with_name(f".{path.name}")
        save_ply(make(), made)
        made.replace(path)
    return path


def trained(data: Dataset, options: Options, scene: Path | None) -> Scene:
    trainer = Trainer(data, options, None if scene is None else Parameters.of(load_scene(scene)))
    trainer.run()
    return trainer.scene()


def _pruned(data: Dataset, scene: Path) -> Scene:
    """Those that change the pictures most, in the order of the file."""
    found = load_scene(scene)
    score = scores(Parameters.of(found), [shot.camera for shot in data.fitted]).by(Score.CHANGE)
    keep = np.sort(np.argsort(-score, kind="stable")[: round(KEPT * len(found))])
    return replace(found, **{name: getattr(found, name)[keep] for name in ("means", "scales", "quats", "opacities", "sh")})


def scenes_of(photographs: Photographs, say: Say) -> tuple[dict[str, Path], Path]:
    """Scenes by name, with cameras.json of the test photographs beside them; the folder of the photographs."""
    options = hashlib.sha256(repr((photographs, KEPT, TUNED, THROUGH, FITTED)).encode()).hexdigest()[:12]
    source, folder = folder_of_scenes() / photographs.name, FOLDER / f"{photographs.name}-{options}"
    folder.mkdir(parents=True, exist_ok=True)
    if photographs.flat:
        flat = folder / "flat"
        if not flat.exists():
            say(f"{photographs.name}: taking the lens out")
            undistort(source, flat, photographs.size)
        source = flat
    data = load_dataset(source, photographs.size)
    (folder / "cameras.json").write_text(cameras_text([shot.camera for shot in data.tests]))
    found = {}
    for name, what, make in (
        ("base", "fitting", (lambda: load_scene(source / "scene.ply")) if photographs.fitted else partial(trained, data, FITTED, None)),
        ("cut", "pruning", lambda: _pruned(data, found["base"])),
        ("pruned", "fine-tuning", lambda: trained(data, TUNED, found["cut"])),
        ("through", "fine-tuning through the test", lambda: trained(data, THROUGH, found["pruned"])),
    ):
        say(f"{photographs.name}: {what}")
        found[name] = kept(folder / f"{name}.ply", make)
    return found, data.tests[0].path.parent


def row_of(point: Point, store: Store) -> dict:
    """Of the store that reports and sweeps share."""
    row = store.load(point.key)
    if row is None:
        row = evaluate(point.target.load(), point.configuration).row
        store.put(point.key, row)
    return row


def tables(say: Say) -> dict[str, str]:
    store = Store()
    cells: list[list[str]] = [[title] for _, _, title in ROWS]
    for photographs in SCENES:
        found, pictures = scenes_of(photographs, say)
        begun = 0.0
        for cell, (name, configuration, _) in zip(cells, ROWS):
            say(f"{photographs.name}: {name}, {configuration or 'float64'}")
            scene = SceneFile(str(found[name]), photos=str(pictures))
            machine = configuration if configuration not in ("", "assumed") else "faithful"
            rows = [row_of(Point(scene.target(view), machine), store) for view in range(scene.views())]
            if configuration == "assumed":
                cell.append(f"({-np.mean([drop(r['psnr_db'], r['reference_photo_psnr_db']) for r in rows]):+.2f})")
                continue
            prefix = "" if configuration else "reference_"
            psnr, ssim = (float(np.mean([r[f"{prefix}photo_{key}"] for r in rows])) for key in ("psnr_db", "ssim"))
            begun = psnr if (name, configuration) == ("pruned", "") else begun
            loss = f" ({psnr - begun:+.2f})" if name != "base" and configuration else ""
            cell.append(f"{psnr:.2f}{loss}, {ssim:.4f}")
    return {"": table(["PSNR in dB (beside the pruned scene in float64), SSIM", *(p.name for p in SCENES)], [tuple(row) for row in cells])}
