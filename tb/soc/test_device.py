"""`flicker.device`: the driver from Python over the simulated chip, a SoC in simulation and a backend of somebody's own.

Compared with the golden model bit for bit. Not covered: a board.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.bench import rounds
from flicker_tb.command import flicker
from flicker_tb.runner import seed

from flicker.device import Backend, Device, SimulatedChip, SimulatedSoc
from flicker.errors import FlickerError
from flicker.golden.chip import render_chip
from flicker.golden.frame_buffer import PixelFormat
from flicker.golden.front.frame import ListKind, run_front
from flicker.golden.front.record import RecordKind
from flicker.golden.lanes.lists import front_lists
from flicker.params import RenderConfig
from flicker.scene.camera import Camera
from flicker.scene.files import Scene, save_ply
from flicker.scene.packed import PackedFormat, PackedScene
from flicker.scene.packing import pack
from flicker.toolchain import ROOT

CONFIG = RenderConfig(stage="lanes")
CAMERA = Camera(64, 40, 80.0, 80.0, np.array([0.0, 0.0, 0.0]), np.eye(3))
BLUE = (10, 20, 200)


def scene(count: int = 400) -> Scene:
    rng = np.random.default_rng(seed())
    return Scene(
        means=np.stack([*rng.uniform(-1.5, 1.5, (2, count)), rng.uniform(1.0, 6.0, count)], axis=1), scales=rng.uniform(0.01, 0.1, (count, 3)),
        quats=rng.normal(size=(count, 4)), opacities=rng.uniform(0.01, 1.0, count), sh=rng.normal(scale=0.3, size=(count, 4, 3)),
    )


@cache
def packed() -> PackedScene:
    return pack(scene(), PackedFormat.CHUNK).packed


def golden(camera: Camera, format_: PixelFormat = PixelFormat.RGB8) -> np.ndarray:
    front = run_front(packed(), camera, ListKind.ELLIPSE, RecordKind.of(CONFIG.form))
    buffer = render_chip(front_lists(front), CONFIG, format_, BLUE).buffer
    return buffer[: camera.height, : camera.width * (3 if format_ is PixelFormat.RGB8 else 8)]


def shown(buffer: np.ndarray, camera: Camera, format_: PixelFormat = PixelFormat.RGB8) -> np.ndarray:
    return buffer[: camera.height, : camera.width * (3 if format_ is PixelFormat.RGB8 else 8)]


def test_simulated_chip() -> None:
    """Frames in both pixel formats, one that is late, and one more behind it; what has no room or no scene is refused."""
    with Device(SimulatedChip(CONFIG, size=16 << 20)) as device:
        assert device.capability["lanes"] == CONFIG.lanes and device.capability["beat"] == 64
        with pytest.raises(FlickerError, match="no scene is loaded"):
            device.render(CAMERA)
        device.load(packed())
        for format_ in PixelFormat:
            frame = device.render(CAMERA, format_, background=BLUE)
            assert np.array_equal(shown(frame.buffer, CAMERA, format_), golden(CAMERA, format_)) and not frame.error
            assert 0 < max(frame.front_cycles, frame.rendering_cycles) < frame.cycles
        late = device.render(CAMERA, background=BLUE, deadline=300)
        assert late.errors == ["ended by its deadline; progress tells what of the picture is written"] and late.pairs < 6
        assert np.array_equal(shown(late.buffer, CAMERA)[0, :3], BLUE)
        assert np.array_equal(shown(device.render(CAMERA, background=BLUE).buffer, CAMERA), golden(CAMERA))
        with pytest.raises(FlickerError, match="device: FLK_CAMERA_CENTRE: "):
            device.render(Camera(8, 8, 1.0, 1.0, np.zeros(3), np.eye(3), cx=4e4))
        with pytest.raises(FlickerError, match="scene and frame take .* bytes, the memory has 16,777,216"):
            device.render(Camera(4096, 4096, 80.0, 80.0, np.zeros(3), np.eye(3)))
        image = bytearray(packed().image())
        image[-1] ^= 1
        with pytest.raises(FlickerError, match="device: FLK_IMAGE_COLOUR_CRC: "):
            device.load(bytes(image))


class Nothing(Backend):
    """A bus with nothing on it, or one that breaks."""

    broken = False

    def register(self, offset: int, value: int | None = None) -> int:
        if self.broken:
            raise OSError("no bus")
        return 0

    def memory(self, address: int, data: bytes | int) -> bytes:
        return b""


def test_no_chip() -> None:
    """The status's name; what a backend raises comes through the driver."""
    with pytest.raises(FlickerError, match="device: FLK_DEVICE_ID: chip: not found"):
        Device(Nothing())
    broken = Nothing()
    broken.broken = True
    with pytest.raises(OSError, match="no bus"):
        Device(broken)


def test_soc() -> None:
    """Registers through the firmware's commands on the UART; with SLOW=1 a frame, whose registers are eight seconds of commands."""
    pytest.importorskip("litex", reason="LiteX is not installed: make soc sets it up")
    if not shutil.which("riscv64-unknown-elf-gcc"):
        pytest.skip("riscv64-unknown-elf-gcc is not installed (Debian: gcc-riscv64-unknown-elf)")
    with Device(SimulatedSoc("default", shared=True)) as device:
        assert device.capability["lanes"] == CONFIG.lanes and device.capability["beat"] == 64
        device.load(packed())
        if rounds(0, 1):
            frame = device.render(CAMERA, background=BLUE)
            assert np.array_equal(shown(frame.buffer, CAMERA), golden(CAMERA))


def test_guide_backend() -> None:
    """The backend of the guide compiles, and is one."""
    text = (ROOT / "docs" / "guide" / "soc.md").read_text()
    block = next(block for block in re.findall(r"^```python\n(.*?)^```", text, re.M | re.S) if "class Board" in block)
    names: dict = {}
    exec(block, names)
    assert issubclass(names["Board"], Backend) and not names["Board"].__abstractmethods__


def test_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """flicker render --device, with a backend of one's own; wrong names are told."""
    save_ply(scene(), tmp_path / "scene.ply")
    (tmp_path / "my_board.py").write_text(
        "from flicker.device import SimulatedChip\nfrom flicker.params import RenderConfig\n\n"
        "def board():\n    return SimulatedChip(RenderConfig(stage='lanes'))\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    words = ("render", "scene.ply", "--engine", "chip", "--size", "48x32", "--stats", "stats.json", "-o")
    done = flicker(*words, "board.png", "--device", "my_board:board")
    assert done.returncode == 0, done.stderr
    stats = json.loads((tmp_path / "stats.json").read_text())
    assert stats["device"] == "my_board:board" and stats["cycles"] > 0
    assert flicker("render", "scene.ply", "--engine", "chip-golden", "--size", "48x32", "-o", "golden.png").returncode == 0
    assert (tmp_path / "board.png").read_bytes() == (tmp_path / "golden.png").read_bytes()
    for name in ("nothing", "no_module:board", "my_board:nothing"):
        done = flicker(*words, "x.png", "--device", name)
        assert done.returncode and f"--device{':' if name == 'nothing' else ' ' + name + ':'}" in done.stderr.replace("\n", " "), done.stderr
    assert "for --engine chip only" in flicker("render", "scene.ply", "--device", "chip").stderr
    assert "my_board" in sys.modules
