"""Videos of pictures in files, by the suffix of their name: MP4 (H.264) and WebM (VP9) with the ffmpeg that `imageio-ffmpeg` brings, GIF and WebP with
Pillow."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from ..errors import FlickerError, one_line, say
from ..output import write_atomically

# What ffmpeg is told. Videos have colours at half the resolution, as players want them: figures are of the frames, never of a video.
CODECS = {
    ".mp4": ("-c:v", "libx264", "-preset", "medium", "-crf", "14", "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
    ".webm": ("-c:v", "libvpx-vp9", "-b:v", "0", "-crf", "20", "-deadline", "good", "-cpu-used", "4", "-row-mt", "1", "-pix_fmt", "yuv420p"),
}
STEPS = {".gif": 0.010, ".webp": 0.001}  # seconds in which Pillow's formats count
SUFFIXES = (*CODECS, *STEPS)
_EVEN = "pad=ceil(iw/2)*2:ceil(ih/2)*2"  # what yuv420p needs


def ffmpeg() -> str:
    """The program. FlickerError where there is none."""
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        raise FlickerError(f"no ffmpeg for .mp4 and .webm ({one_line(error)}): .gif, .webp or a folder need none") from None


def durations(frames: int, fps: float, step: float) -> list[int]:
    """Milliseconds of each frame in a format that counts in steps of `step` seconds: no frame is later than half a step, one step each at least."""
    ends = [round((n + 1) / fps / step) for n in range(frames)]
    return [round(1000 * step) * max(end - start, 1) for start, end in zip([0, *ends], ends)]


def _opened(pictures: Sequence[Path]) -> Iterator[Image.Image]:
    for path in pictures:
        with Image.open(path) as picture:
            yield picture.convert("RGB")


def _with_pillow(out: Path, pictures: Sequence[Path], fps: float) -> None:
    suffix = out.suffix.lower()
    step = STEPS[suffix]
    first, rest = next(_opened(pictures)), _opened(pictures[1:])
    options: dict[str, Any] = {"quality": 92, "method": 2} if suffix == ".webp" else {"disposal": 1}
    # GIF's own writer joins equal frames, and then wants one duration.
    first.save(out, save_all=True, append_images=rest, duration=durations(len(pictures), fps, step), loop=0, **options)


def _with_ffmpeg(out: Path, pictures: Sequence[Path], fps: float) -> None:
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as names:
        for path in pictures:
            escaped = str(path.absolute()).replace("'", "'\\''")
            names.write(f"file '{escaped}'\nduration {1 / fps:.9f}\n")
        names.flush()
        command = [
            ffmpeg(), "-hide_banner", "-loglevel", "error", "-y", "-r", f"{fps:.9g}", "-f", "concat", "-safe", "0", "-i", names.name, "-vf", _EVEN,
            "-r", f"{fps:.9g}", *CODECS[out.suffix.lower()], str(out),
        ]
        # Signals as here: a file beyond the limit of its size is then an error with a reason, not a killed process.
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", restore_signals=False)
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        reason = next((line for line in lines if any(word in line for word in ("No space", "too large", "denied"))), lines[-1] if lines else "")
        raise OSError(0, one_line(reason.split(": ")[-1]) if reason else f"ffmpeg ended with {done.returncode}")


def write_video(out: Path, pictures: Sequence[Path], fps: float) -> None:
    """A video of pictures of one size, one at least, put in place whole. FlickerError, naming the file, where it cannot be written; FlickerWarning where its
    format cannot show so many frames a second."""
    suffix = out.suffix.lower()
    if suffix in STEPS and fps > 1 / STEPS[suffix]:
        say(out, f"holds a frame for {STEPS[suffix]:g} s at least: it plays at {1 / STEPS[suffix]:g} frames a second, not {fps:g}")
    write = _with_ffmpeg if suffix in CODECS else _with_pillow
    write_atomically(out, lambda path: write(path, pictures, fps))
