"""The SoC of soc/: a processor boots from ROM and drives the chip with the driver of sw/.

Covered: the firmware's commands, every status of the driver and every error of the chip, RAM without a scene, with damaged ones, with none of a path; pictures
against the golden model; the guide's examples; boards. The default tests put the chip's own simulator, which other tests build too, in the place of the chip
(`simulation.build(shared=True)`). With SLOW=1 also: every error, more damaged scenes, an address where nothing is, clock crossings, and what LiteX emits,
simulated as a whole. Skipped where LiteX, which make soc installs, or the cross compiler is missing.
"""

from __future__ import annotations

import os
import re
import shutil
import struct
import sys
import zlib
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
import pytest
from flicker_tb.bench import rounds
from flicker_tb.runner import seed

from flicker.chip.dram import DramConfig
from flicker.chip_registers import ResultError
from flicker.params import RenderConfig
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.scene.packed import PackedFormat, PackedScene
from flicker.scene.packing import pack
from flicker.sim.driver import statuses
from flicker.toolchain import ROOT

pytest.importorskip("litex", reason="LiteX is not installed: make soc sets it up")
pytest.importorskip("pythondata_cpu_vexriscv", reason="VexRiscv is not installed: make soc sets it up")
if not shutil.which("riscv64-unknown-elf-gcc"):
    pytest.skip("riscv64-unknown-elf-gcc is not installed (Debian: gcc-riscv64-unknown-elf)", allow_module_level=True)

sys.path.insert(0, str(ROOT / "soc"))

import firmware  # noqa: E402
import pictures  # noqa: E402
import simulation  # noqa: E402

CONFIG = RenderConfig(stage="lanes")
CAMERA = Camera(96, 54, 80.0, 80.0, np.array([0.0, 0.0, 0.0]), np.eye(3))
SCENE_AT, PATH_AT = simulation.RAM + 0x10_0000, simulation.RAM + 0x20_0000
LIMIT = 10_000_000


@cache
def packed() -> PackedScene:
    rng, count = np.random.default_rng(seed()), rounds(300, 500)
    return pack(Scene(
        means=np.stack([*rng.uniform(-1.5, 1.5, (2, count)), rng.uniform(1.0, 6.0, count)], axis=1), scales=rng.uniform(0.01, 0.1, (count, 3)),
        quats=rng.normal(size=(count, 4)), opacities=rng.uniform(0.01, 1.0, count), sh=rng.normal(scale=0.3, size=(count, 4, 3)),
    ), PackedFormat.CHUNK).packed


@pytest.fixture(scope="module")
def built() -> simulation.Built:
    return simulation.build("default", shared=True)


@pytest.fixture
def boot(built: simulation.Built) -> Iterator[Callable[..., simulation.Soc]]:
    """Makes a SoC out of reset with an image and a path in RAM; what it says until its prompt is in `text`."""
    rom, made = firmware.build(built.folder), []

    def make(image: bytes = b"", path: bytes = b"") -> simulation.Soc:
        soc = simulation.Soc(built, rom, timing=DramConfig().timing, seed=seed())
        made.append(soc)
        soc.write(SCENE_AT, image)
        soc.write(PATH_AT, path)
        soc.expect("> ", LIMIT)
        return soc

    yield make
    for soc in made:
        soc.__exit__()


def command(soc: simulation.Soc, keys: str) -> str:
    soc.send(keys)
    return soc.expect("> ", LIMIT)


def table(text: str) -> dict[str, int]:
    return {name: int(value) for name, value in re.findall(r"^  (\S.*?) +(\d+)$", text, re.M)}


def picture(soc: simulation.Soc, text: str) -> np.ndarray:
    """uint8 (H, 3 W), as it lies in RAM; the firmware's sum is that of it."""
    found = re.search(r"picture (\d+)x(\d+) at 0x([0-9a-f]+) stride (\d+) sum 0x([0-9a-f]+)", text)
    assert found, text
    width, height, stride = (int(found[k]) for k in (1, 2, 4))
    out = soc.read(int(found[3], 16), stride * height).reshape(height, stride)[:, : 3 * width]
    assert int(found[5], 16) == pictures.word_sum(out)
    return out


def golden(camera: Camera) -> np.ndarray:
    return pictures.golden_picture(packed(), camera, CONFIG)


def test_frames(boot: Callable[..., simulation.Soc]) -> None:
    """A boot, the chip's capabilities, a frame by interrupt; the camera turns and steps; frames back to back; words by hand."""
    other = Camera(47, 33, 80.0, 80.0, np.array([0.5, 0.0, 0.0]), np.eye(3))
    soc = boot(packed().image(), pictures.path_block([CAMERA, other]))
    said = table(soc.text)
    assert said["lanes"] == CONFIG.lanes and said["bytes of a beat"] == 64 and said["Gaussians"] == len(packed()) and said["cameras of the path"] == 2
    asleep = soc.asleep
    text = command(soc, "f")
    cost = table(text)
    assert np.array_equal(picture(soc, text), golden(CAMERA)) and golden(CAMERA).any()
    # The harness sees the CPU asleep as long as the firmware thinks.
    slept = soc.asleep - asleep
    assert cost["start to interrupt, cycles"] * cost["of these CPU asleep, permille"] // 1000 == pytest.approx(slept, rel=0.05)
    assert 0 < cost["frame, cycles"] < cost["start to interrupt, cycles"] < cost["frame, cycles"] + 1000
    assert np.array_equal(picture(soc, command(soc, "n")), golden(other))
    c, s = 0.99619469809174555, 0.087155742747658174
    turned = Camera(47, 33, 80.0, 80.0, other.position, np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]))
    assert np.array_equal(picture(soc, command(soc, "a")), golden(turned))
    text = command(soc, "b")
    sums = [int(value, 16) for value in re.findall(r"sum 0x([0-9a-f]+)", text)]
    assert sums == [pictures.word_sum(golden(camera)) for camera in (CAMERA, other, CAMERA)]
    assert command(soc, f"r {SCENE_AT:x}\n") == f"0x{struct.unpack('<I', b'FLKS')[0]:08x}\n> "
    command(soc, f"w {PATH_AT + 0x8000:x} 1234abcd\n")
    assert soc.read(PATH_AT + 0x8000, 4).tobytes() == bytes.fromhex("cdab3412")
    assert command(soc, "2") == "memory: 0 words wrong\n> "
    assert command(soc, "3") == "FLK_ERROR_DESCRIPTOR: descriptor refused\n> "
    small = Camera(16, 16, 80.0, 80.0, CAMERA.position, CAMERA.rotation)  # of the last frame back to back
    assert np.array_equal(picture(soc, command(soc, "4")), golden(small))
    if rounds(0, 1):  # nothing is there: LiteX' bus gives up, after eight million cycles
        assert command(soc, "r 70000000\n") == "0xffffffff\n> "
    assert command(soc, f"r {SCENE_AT + 1:x}\n").startswith("exception 4 at ")  # no multiple of 4
    assert "bytes of a beat" in command(soc, "1") and "provoke" in command(soc, "?")


@pytest.mark.slow
def test_every_error(boot: Callable[..., simulation.Soc]) -> None:
    """Each status and each error of a result comes in a line of its own, and frames behind an abort, a time-out and a reset are right."""
    soc = boot(packed().image(), pictures.path_block([CAMERA]))
    text = command(soc, "e")
    assert "WRONG" not in text and text.count("is right") == 4, text
    told = set(re.findall(r"^FLK_(\w+): ", text, re.M))
    wanted = set(statuses()[:-1]) | {f"ERROR_{error.name}" for error in ResultError} | {"INTERRUPT_REFUSED"}
    assert told == wanted, told ^ wanted
    assert np.array_equal(picture(soc, command(soc, "f")), golden(CAMERA))


def damaged(at: int) -> bytes:
    image = bytearray(packed().image())
    image[at] ^= 1
    return bytes(image)


def sealed(at: int, value: bytes) -> bytes:
    """An image with another header that has the right checksum."""
    image = bytearray(packed().image())
    image[at : at + len(value)] = value
    image[252:256] = struct.pack("<I", zlib.crc32(bytes(image[:252])))
    return bytes(image)


def test_bad_scenes(boot: Callable[..., simulation.Soc]) -> None:
    """A line with the code's name; frames are refused with another, and a scene that is loaded then is found. A path alone is none."""
    soc = boot(b"", pictures.path_block([CAMERA]))
    assert "no scene: FLK_IMAGE_MAGIC: " in soc.text
    assert command(soc, "f").startswith("FLK_IMAGE_MAGIC: ")
    for image, said in (
        (damaged(16), "FLK_IMAGE_HEADER_CRC"), (damaged(256), "FLK_IMAGE_TABLE_CRC"), (sealed(28, struct.pack("<I", 0x0200_0000)), "FLK_IMAGE_SIZE"),
    )[:: rounds(3, 1)]:
        soc.write(SCENE_AT, image)
        assert command(soc, "s").startswith(f"scene at {SCENE_AT:#x}: {said}: ")
    # A byte of the colours: told where all checksums are computed, else taken.
    soc.write(SCENE_AT, damaged(len(packed().image()) - 1))
    assert "cameras of the path                      1" in command(soc, "s")
    assert command(soc, "v").startswith(f"scene at {SCENE_AT:#x}: FLK_IMAGE_COLOUR_CRC: ")
    soc.write(SCENE_AT, packed().image())
    soc.write(PATH_AT, bytes(8))
    assert "cameras of the path                      0" in command(soc, "v" if rounds(0, 1) else "s")
    assert picture(soc, command(soc, "f")).shape == (90, 480)


def test_firmware(built: simulation.Built) -> None:
    """It fits the ROM, its names are the driver's, and it is built of the driver as it is."""
    assert len(firmware.build(built.folder)) <= 32768
    text = (ROOT / "soc" / "firmware" / "main.c").read_text()
    for prefix, wanted in (("ERROR_", [error.name for error in ResultError]), ("", statuses()[:-1])):
        names = re.findall(rf'\[FLK_{prefix}(\w+)\] = "(\w+)"', text)
        assert {own for index, own in names if index == own} >= set(wanted)


@pytest.mark.slow
def test_clock_domain() -> None:
    """The chip behind crossings of clock domains: registers, memory and interrupt."""
    built = simulation.build("default", shared=True, crossing=True)
    with simulation.Soc(built, firmware.build(built.folder), timing=DramConfig().timing, seed=seed()) as soc:
        soc.write(SCENE_AT, packed().image())
        soc.write(PATH_AT, pictures.path_block([CAMERA]))
        soc.expect("> ", LIMIT)
        assert np.array_equal(picture(soc, command(soc, "f")), golden(CAMERA))


@pytest.mark.slow
def test_whole(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What make soc does, smaller: the SoC as LiteX emits it, in one simulator."""
    import run

    monkeypatch.setattr(sys, "argv", ["run.py", "--size", "48x32"])
    run.main()
    assert os.path.getsize(ROOT / "build" / "soc" / "frame.png") > 100
