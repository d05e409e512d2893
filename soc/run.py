"""`make soc`: a processor boots, drives the chip, and a picture appears (docs/guide/soc.md).

    python soc/run.py [--chip tiny] [--scene demo] [--size 160x90] [--frames 3] [--keys]

Simulates the SoC with the scene in RAM, renders the first camera of a path and then frames back to back, compares each with the golden model's picture, bit for
bit, and writes them as PNG with the measured numbers to build/soc/. With --keys the terminal's keys go to the firmware; Ctrl-C ends.
"""

from __future__ import annotations

import argparse
import json
import re
import select
import sys
import termios
import time
import tty
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import firmware  # noqa: E402
import pictures  # noqa: E402
import simulation  # noqa: E402
from litex_flicker import CHIP  # noqa: E402

from flicker.chip.dram import DramConfig  # noqa: E402
from flicker.chips import chip_of  # noqa: E402
from flicker.errors import FlickerError  # noqa: E402
from flicker.scene.camera import Camera  # noqa: E402
from flicker.scene.image import save_png  # noqa: E402
from flicker.scene.packed import PackedFormat, PackedScene  # noqa: E402
from flicker.toolchain import BUILD  # noqa: E402

SCENE_AT, LIMIT = simulation.RAM + 0x10_0000, 100_000_000
PICTURE = re.compile(r"picture (\d+)x(\d+) at 0x([0-9a-f]+) stride (\d+) sum 0x([0-9a-f]+)")


def scene_and_path(name: str, width: int, height: int) -> tuple[PackedScene, list[Camera]]:
    """A packed scene and its cameras at a size."""
    from flicker.scene.demo import demo_cameras, generate
    from flicker.scene.packing import pack

    if name == "demo":
        return pack(generate(), PackedFormat.CHUNK).packed, demo_cameras(width, height)
    from flicker.front.view import load_view
    from flicker.scene.camera import camera_count

    views = [load_view(name, n, (width, height)) for n in range(min(camera_count(name), 8))]
    return pack(views[0].scene, PackedFormat.CHUNK).packed, [view.camera for view in views]


def check_pictures(soc: simulation.Soc, text: str, golden: list[np.ndarray], folder: Path, name: str) -> int:
    """Compare the pictures that the firmware told of with the golden model's; write them. FlickerError at the first difference. How many."""
    told = PICTURE.findall(text)
    if len(told) != len(golden):
        raise FlickerError(f"soc: {len(told)} pictures, not {len(golden)}")
    for n, (words, want) in enumerate(zip(told, golden)):
        width, height, stride = (int(words[k]) for k in (0, 1, 3))
        got = soc.read(int(words[2], 16), stride * height).reshape(height, stride)[:, : 3 * width]
        path = folder / (f"{name}.png" if len(told) == 1 else f"{name}-{n + 1}.png")
        save_png(path, got.reshape(height, width, 3) / 255.0)
        # A frame buffer may be another frame's by now: its sum is of when it ended.
        if int(words[4], 16) != pictures.word_sum(want):
            raise FlickerError(f"soc: {path}: the firmware's word sum is not that of the golden model's picture")
        last = all(words[2] != other[2] for other in told[n + 1 :])
        if last and not np.array_equal(got, want):
            raise FlickerError(f"soc: {path}: the picture differs from the golden model's")
    return len(told)


def terminal(soc: simulation.Soc) -> None:
    """Keys go to the firmware, until Ctrl-C or Ctrl-D."""
    kept = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        while True:
            if select.select([sys.stdin], [], [], 0)[0]:
                keys = sys.stdin.read(1)
                if keys in ("", "\x04"):
                    return
                soc.send(keys)
            soc.run(simulation.SLICE)
    except KeyboardInterrupt:
        pass
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, kept)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--chip", default=CHIP, help="a name of chips.toml")
    parser.add_argument("--scene", default="demo", help="a scene file with cameras, or demo")
    parser.add_argument("--size", default="160x90", help="WxH of the pictures")
    parser.add_argument("--keys", action="store_true", help="then give the terminal to the firmware")
    options = parser.parse_args()
    try:
        run(options)
    except FlickerError as error:
        sys.exit(f"soc: {error}".replace("soc: soc: ", "soc: "))


def run(options: argparse.Namespace) -> None:
    if not re.fullmatch(r"\d+x\d+", options.size):
        raise FlickerError(f"--size: WxH, as 160x90, not {options.size}")
    if options.keys and not sys.stdin.isatty():
        raise FlickerError("--keys: standard input is no terminal")
    config = chip_of(options.chip).config
    width, height = map(int, options.size.split("x"))
    folder = BUILD / "soc"
    began = time.time()
    firmware.compiler()
    packed, cameras = scene_and_path(options.scene, width, height)
    print("soc: building the SoC's simulator (minutes, once)", flush=True)
    built = simulation.build(options.chip)
    rom = firmware.build(built.folder)
    print(f"soc: firmware of {len(rom)} bytes; pictures by the golden model", flush=True)
    golden = [pictures.golden_picture(packed, camera, config) for camera in cameras[:3]]
    image = packed.image()
    prepared = time.time()
    with simulation.Soc(built, rom, timing=DramConfig().timing, echo=lambda text: print(text, end="", flush=True)) as soc:
        soc.write(SCENE_AT, image)
        soc.write(SCENE_AT + -(-len(image) // pictures.BLOCK) * pictures.BLOCK, pictures.path_block(cameras))
        soc.expect("> ", LIMIT)
        boot = soc.cycles
        soc.send("5")
        text = soc.expect("> ", LIMIT)
        check_pictures(soc, text, golden[:1], folder, "frame")
        first, first_cycles = time.time() - prepared, soc.cycles
        soc.send("b")
        check_pictures(soc, soc.expect("> ", LIMIT), [golden[n % len(golden)] for n in range(3)], folder, "path")
        seconds = time.time() - prepared
        table = dict(re.findall(r"^  (\S.*?) +(\d+)$", text, re.M))
        numbers = {
            "chip": options.chip, "scene": options.scene, "size": options.size, "firmware_bytes": len(rom), "boot_cycles": boot,
            "to_first_frame_cycles": first_cycles, "to_first_frame_seconds": round(first, 1), "cycles_per_second": round(soc.cycles / seconds),
            "prepared_seconds": round(prepared - began, 1), "table": {name: int(value) for name, value in table.items()},
        }
        (folder / "numbers.json").write_text(json.dumps(numbers, indent=2) + "\n")
        print(f"\n\nsoc: four pictures equal the golden model's, bit for bit: {folder / 'frame.png'}")
        print(f"soc: boot and first frame {first_cycles:,} cycles in {first:.0f} s; {soc.cycles / seconds:,.0f} cycles a second")
        if options.keys:
            print("soc: keys go to the firmware (? for help), Ctrl-C ends", flush=True)
            terminal(soc)


if __name__ == "__main__":
    main()
