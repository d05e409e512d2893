"""Frames that show what flickers: a strip of a square, enlarged, from frame to frame, and a short clip of whole frames, each with its errors."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ..chip.drawing import Drawing
from ..front.view import View
from ..params import RECOMMENDED, CatMode, RenderConfig
from .record import composed, eight_bits
from .video import write_video

REFERENCE = "float64"
SPARSE, CHANNELS, LANES = "channels, sparse", "channels", "lanes"
DRAWINGS = {
    SPARSE: Drawing(config=RenderConfig(cat=CatMode.SPARSE)), CHANNELS: Drawing(config=RenderConfig()), LANES: Drawing(config=RECOMMENDED),
}
STRIP = 6  # frames of the strip
SIDE, ENLARGED = 40, 3  # of its square: pixels, times
AMPLIFIED = 8  # errors, times
CLIP_FPS = 12.0  # slower than the motion, so that single frames are seen
_GAP, _FONT = 2, 14  # pixels

Film = Mapping[str, Sequence[np.ndarray]]


def filmed(views: Iterable[View], names: Sequence[str]) -> Film:
    """Frames by name: `REFERENCE` and pictures of `DRAWINGS`, float64 (H, W, 3) each, unquantised. views: one at a time."""
    film: dict[str, list[np.ndarray]] = {name: [] for name in (REFERENCE, *names)}
    for view in views:
        film[REFERENCE].append(view.reference)
        for name in names:
            film[name].append(DRAWINGS[name].render(view).image.astype(np.float64))
    return film


def flickering(pictures: Sequence[np.ndarray], references: Sequence[np.ndarray], side: int) -> tuple[int, int]:
    """Left and upper edge, pixels, of the square of `side` in which errors change most; (H, W, 3) each, two frames at least."""
    errors = [p - r for p, r in zip(pictures, references)]
    change = np.mean([np.abs(b - a).max(axis=2) for a, b in zip(errors, errors[1:])], axis=0)
    sums = np.pad(change, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    y, x = np.unravel_index(int(inside.argmax()), inside.shape)
    return int(x), int(y)


def strip(film: Film, names: Sequence[str]) -> np.ndarray:
    """uint8 (H, W, 3): the first `STRIP` frames beside each other, the square of `SIDE` pixels where the first of `names` flickers most; rows with their names:
    the reference, pictures, errors times `AMPLIFIED`."""
    frames = {name: list(film[name][:STRIP]) for name in (REFERENCE, *names)}
    side = min(SIDE, *frames[REFERENCE][0].shape[:2])
    x, y = flickering(frames[names[0]], frames[REFERENCE], side)
    rows = {name: [each[y : y + side, x : x + side] for each in pictures] for name, pictures in frames.items()}
    rows |= {
        f"error of\n{name}\ntimes {AMPLIFIED}": [AMPLIFIED * np.abs(a - b) for a, b in zip(rows[name], rows[REFERENCE])] for name in names
    }
    step = side * ENLARGED + _GAP
    measure = ImageDraw.Draw(Image.new("RGB", (1, 1)))
    left = 12 + round(max(measure.multiline_textbbox((0, 0), name, font_size=_FONT)[2] for name in rows))
    out = Image.new("RGB", (left + len(frames[REFERENCE]) * step - _GAP, len(rows) * step - _GAP), "white")
    draw = ImageDraw.Draw(out)
    for line, (name, pictures) in enumerate(rows.items()):
        draw.multiline_text((left - 8, line * step + step / 2), name, fill="black", anchor="rm", align="right", font_size=_FONT)
        for column, picture in enumerate(pictures):
            tile = Image.fromarray(eight_bits(picture)).resize((side * ENLARGED,) * 2, Image.Resampling.NEAREST)
            out.paste(tile, (left + column * step, line * step))
    return np.asarray(out)


def clip(film: Film, names: Sequence[str]) -> list[np.ndarray]:
    """Frames of a clip, uint8 (H * len(names), 2 * W, 3): each picture with its error times `AMPLIFIED` to the right, below each other."""
    frames = []
    for n, reference in enumerate(film[REFERENCE]):
        lines = []
        for name in names:
            image = np.clip(film[name][n], 0.0, 1.0)
            lines.append(composed([(name, image), (f"error x {AMPLIFIED}", AMPLIFIED * np.abs(image - np.clip(reference, 0.0, 1.0)))]))
        frames.append(np.concatenate(lines, axis=0))
    return frames


def write_clip(out: Path, frames: Sequence[np.ndarray], fps: float = CLIP_FPS) -> None:
    """A video, by its suffix, of uint8 (H, W, 3). Raises FlickerError, naming the file, where it cannot be written."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{n:05d}.png" for n in range(len(frames))]
        for path, picture in zip(files, frames):
            Image.fromarray(picture).save(path)
        write_video(out, files, fps)
