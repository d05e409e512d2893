"""The chip with the pins of AMBA: what of it is wrapper, with nothing but a header in the chip's place, and, with SLOW=1, frames.

State space: every pin of both sides with random values, resets with the synchroniser, with SLOW=1 without it, test enable; what is refused. With SLOW=1 the
whole chip between cocotbext-axi's AXI4-Lite manager and its AXI4 memory, which knows narrow reads: a frame byte for byte as the golden model has it, and every
access of that frame against the table of docs/reference/chip_ports.md.
Parameter space: identifiers wider than the chip's; with SLOW=1 as wide, a chip of 32 lanes with small memories. Frames of flk_top: tb/frames.
"""

from __future__ import annotations

import ctypes
import json
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from doc_parts.instance import managers
from flicker_tb.bench import netlist
from flicker_tb.elaboration import refused
from flicker_tb.runner import build_and_test, seed

from flicker.chip_registers import REGISTERS, ResultError
from flicker.golden.chip import render_chip
from flicker.golden.front.frame import ListKind, run_front
from flicker.golden.front.record import RecordKind
from flicker.golden.lanes.lists import front_lists
from flicker.params import RenderConfig
from flicker.scene.camera import Camera
from flicker.scene.files import Scene
from flicker.scene.packed import PackedFormat, PackedScene
from flicker.scene.packing import pack
from flicker.sim import driver
from flicker.sim.chip import IMAGE, ChipSession
from flicker.toolchain import BUILD, ROOT, sources_of

TOP = ROOT / "rtl" / "flk_top.sv"
pytestmark = pytest.mark.skipif(netlist(), reason="has no netlist of its own: flk_top has one")


def header(path: Path) -> str:
    """Imports, parameters and ports of a module."""
    found = re.search(rf"^module {path.stem}\b.*?^\);", path.read_text(), re.M | re.S)
    assert found
    return found[0]


def sources() -> list[Path]:
    """The wrapper's, with a module that has the chip's header and nothing inside."""
    empty = BUILD / "top_axi" / "flk_top.sv"
    empty.parent.mkdir(parents=True, exist_ok=True)
    empty.write_text(f"{header(TOP)}\nendmodule\n")
    needed = [path for path in sources_of("flk_top_axi") if path.stem.endswith("_pkg") or path.stem in ("flk_reset_sync", "flk_top_axi")]
    return [*needed[:-1], empty, needed[-1]]


def pins() -> list[tuple[str, str, bool]]:
    """Every port of the chip: its name, the wrapper's pin, whether it is an input."""
    found = []
    for direction, name in re.findall(r"^\s*(input|output)\s+logic\b.*?(\w+),?\s*(?://.*)?$", header(TOP), re.M):
        plain = re.sub(r"_n?[io]$", "", name)
        pin = {"clk": "aclk", "rst": "aresetn", "test_en": "test_en", "irq": "irq"}.get(plain)
        if pin is None:
            interface, rest = ("s_axil", plain.removeprefix("reg_")) if plain.startswith("reg_") else ("m_axi", plain)
            pin = f"{interface}_{rest.replace('_', '')}"
        found.append((name, pin, direction == "input"))
    return found


@pytest.mark.parametrize("id_width,stages", [pytest.param(7, 0, marks=pytest.mark.slow), (11, 3)])
def test_wiring(id_width: int, stages: int) -> None:
    build_and_test(
        "flk_top_axi", "cocotb_top_axi_wiring", sources=sources(), inner=True,
        parameters={"IdWidth": id_width, "UserWidth": 3, "ResetStages": stages, "Cache": 11, "Prot": 2},
        config={"pins": pins(), "stages": stages, "cache": 11, "prot": 2},
    )


@pytest.mark.parametrize(("parameters", "message"), [
    ({"IdWidth": 6}, "IdWidth must be at least 7"), ({"UserWidth": 0}, "UserWidth must be at least 1"), ({"Cache": 16}, "Cache must be 0 to 15"),
    ({"Prot": 8}, "Prot 0 to 7"), ({"ResetStages": 1}, "ResetStages must be 0 or at least 2"),
])
def test_refused(parameters: dict[str, int], message: str) -> None:
    refused("flk_top_axi", parameters, f"flk_top_axi: {message}" if "Prot" not in parameters else message)


# ---- the whole chip -----------------------------------------------------------------------------

CONFIG = RenderConfig(stage="lanes", memories="small")
PARAMETERS = {**CONFIG.top_parameters(), "IdWidth": 9}
SIZE = 1 << 29  # of the memory; only what is written takes place


class Recorded(ChipSession):
    """The session of a chip that is not there: what the driver writes into registers, what lies in memory."""

    def __init__(self, packed: PackedScene, capability: int) -> None:
        self.name, self.seed, self.config, self.packed = "recorded", seed(), CONFIG, packed
        self.driver, self._error = driver.library(), None
        reset = {name: int(value, 16) for name, value in re.findall(r"#define FLK_(\w+)_RESET 0x(\w+)u", (driver.SW / "flk_registers.h").read_text())}
        version = reset["VERSION_MAJOR"] | reset["VERSION_MINOR"] << 8
        self.answers = {REGISTERS[name].offset: value for name, value in (
            ("id", reset["ID_VALUE"]), ("version", version), ("capability", capability), ("capability_units", 0x12222), ("status", 1),
        )}
        self.written: list[tuple[int, int]] = []
        self._calls = driver.READ(self._read), driver.WRITE(self._write)
        self.device, self.scene = driver.CDevice(), driver.CScene()
        data = packed.image()
        self._check(self.call("flk_scene_open", ctypes.byref(self.scene), data, len(data), IMAGE, 0))
        self._check(self.call("flk_probe", ctypes.byref(self.device), ctypes.byref(driver.CBus(*self._calls, None))))
        self._next = IMAGE + -(-len(data) // 4096) * 4096
        assert not self.written

    def _access(self, offset: int, write: bool, value: int = 0) -> int:
        if write:
            self.written.append((offset, value))
        return value if write else self.answers.get(offset, 0)

    def load(self, base: int, allocated: int, data: bytes, purpose: int) -> None:
        assert base + allocated <= SIZE


def scene() -> PackedScene:
    rng = np.random.default_rng(seed())
    return pack(Scene(
        means=np.stack([*rng.uniform(-1.5, 1.5, (2, 300)), rng.uniform(1.0, 6.0, 300)], axis=1), scales=rng.uniform(0.01, 0.1, (300, 3)),
        quats=rng.normal(size=(300, 4)), opacities=rng.uniform(0.01, 1.0, 300), sh=rng.normal(scale=0.3, size=(300, 4, 3)),
    ), PackedFormat.CHUNK).packed


@pytest.mark.slow
def test_frame(tmp_path: Path) -> None:
    """Written by the C driver, rendered by the RTL, equal to the golden model; every access is one of the page's table."""
    packed, view = scene(), Camera(96, 54, 80.0, 80.0, np.zeros(3), np.eye(3))
    fields = REGISTERS["capability"].fields
    built = {"stage": 1, "form": int(CONFIG.form), "precision": int(CONFIG.precision), "vrus": CONFIG.vrus_per_channel, "mask_generator": 0,
             "log2_lists": 14, "log2_beat": 6, "log2_lanes": 5}
    session = Recorded(packed, sum(value << fields[name][0] for name, value in built.items()))
    frame = session.frame(view, session.place(view), background=(10, 20, 200), tag=77)
    session.start(frame)
    want = render_chip(front_lists(run_front(packed, view, ListKind.ELLIPSE, RecordKind.of(CONFIG.form))), CONFIG, background=(10, 20, 200)).buffer
    files = {"image": packed.image(), "want": want.tobytes(), "table": json.dumps([asdict(m) | {"qos": m.qos} for m in managers(PARAMETERS)]).encode()}
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    build_and_test(
        "flk_top_axi", "cocotb_top_axi", parameters=PARAMETERS,
        config={
            "files": str(tmp_path), "size": SIZE, "image": IMAGE, "written": session.written, "frame_buffer": frame.frame_buffer, "tag": 77,
            "registers": {name: register.offset for name, register in REGISTERS.items()}, "capability": session.answers[REGISTERS["capability"].offset],
            "built": sum(((1 << fields[name][1]) - 1) << fields[name][0] for name in ("stage", "form", "log2_lists", "log2_beat", "log2_lanes")),
            "descriptor_error": 1 << ResultError.DESCRIPTOR,
        },
    )
