"""A chip from Python: the C driver (sw/flk.c) over a backend, which is a simulated chip, a SoC in simulation, or a board (docs/guide/soc.md).

    with Device(SimulatedChip(RECOMMENDED)) as device:
        device.load(packed)
        frame = device.render(camera)
    frame.image(camera)  # float64 (H, W, 3)

A backend of your own has `register` and `memory`.
"""

from __future__ import annotations

import ctypes
import importlib
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from .chip.dram import DramConfig
from .chip.run import frame_image
from .chip_registers import REGISTERS, ChipCounter, ResultError
from .chips import name_of
from .errors import FlickerError
from .front.view import View
from .golden.frame_buffer import PixelFormat
from .golden.front.frame import ListKind
from .golden.front.record import RecordKind
from .params import TILE, CatMode, RenderConfig, SortOrder
from .pipeline import Engine, Front, FrontOptions, Rendered, basic_stats, compared, packed_for_picture
from .progress import Steps
from .scene.camera import Camera
from .scene.packed import PackedScene
from .sim import driver
from .sim.chip import PORT, build
from .sim.half import PAGE, Half, MemoryOptions
from .toolchain import ROOT

ENTRIES = 2  # of lists expected for each Gaussian; list memory grows when there are more
RAM = 0x4000_0000
RAM_BYTES = 256 << 20


class Backend(ABC):
    """What a driver needs of a machine. base, size: of the memory that it may use, bytes at the chip's addresses; base a multiple of 4096."""

    base: int = RAM
    size: int = RAM_BYTES

    @abstractmethod
    def register(self, offset: int, value: int | None = None) -> int:
        """Write a register of the chip, or with None read it: its 32 bits. Accesses happen in order."""

    @abstractmethod
    def memory(self, address: int, data: bytes | int) -> bytes:
        """Write bytes to memory (returns none), or read so many. Both see what the chip does: no cache between."""

    def pause(self) -> None:
        """Between two looks at the chip."""
        time.sleep(0.001)

    def close(self) -> None:  # noqa: B027  (most have nothing to do)
        """No access follows."""


class SimulatedChip(Backend):
    """The verilated chip alone. dram: the memory behind it; None: a perfect one."""

    def __init__(self, config: RenderConfig, dram: DramConfig | None = None, seed: int = 1, size: int = RAM_BYTES) -> None:
        self.size = size
        self._half = Half("device", build(config), {"memory": PORT}, MemoryOptions(None if dram is None else dram.timing), seed)
        lib = self._half._lib
        lib.flk_chip_register.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_int, ctypes.c_void_p]
        lib.flk_chip_wait.argtypes = [ctypes.c_void_p, ctypes.c_uint64, ctypes.c_int]
        lib.flk_chip_wait.restype = ctypes.c_int64
        lib.flk_half_write.argtypes = [ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint64, ctypes.c_char_p]
        self._half.load(self.base, self.size, b"", 0)

    def register(self, offset: int, value: int | None = None) -> int:
        """As of `Backend`."""
        word = ctypes.c_uint32(value or 0)
        if self._half._lib.flk_chip_register(self._half._sim, offset, value is not None, ctypes.byref(word)) != 1:
            raise self._half._failure()
        return word.value

    def memory(self, address: int, data: bytes | int) -> bytes:
        """As of `Backend`; takes no time."""
        if isinstance(data, int):
            return self._half.read(address, data).tobytes()
        if not self._half._lib.flk_half_write(self._half._sim, address, len(data), data):
            raise self._half._failure(f"{len(data)} bytes at {address:#x} are not there")
        return b""

    def pause(self) -> None:
        """A thousand cycles."""
        if self._half._lib.flk_chip_wait(self._half._sim, 1000, 0) < 0:
            raise self._half._failure()

    def close(self) -> None:
        """Ends the simulation."""
        self._half.__exit__()


class SimulatedSoc(Backend):
    """The SoC of soc/ in simulation: registers through the firmware's commands on its UART, memory as the harness sees it. chip: name of a size."""

    def __init__(self, chip: str = "small", shared: bool = False, echo: Callable[[str], None] | None = None) -> None:
        folder = str(ROOT / "soc")
        if folder not in sys.path:
            sys.path.append(folder)
        try:
            firmware, simulation = importlib.import_module("firmware"), importlib.import_module("simulation")
        except ImportError as error:
            raise FlickerError(f"--device soc: {error}") from None
        built = simulation.build(chip, shared)
        self._soc = simulation.Soc(built, firmware.build(built.folder), timing=DramConfig().timing, echo=echo)
        self.base, self.size, self._registers = simulation.RAM, simulation.RAM_BYTES, simulation.REGISTERS
        self._soc.expect("> ")

    def register(self, offset: int, value: int | None = None) -> int:
        """As of `Backend`."""
        if value is None:
            self._soc.send(f"r{self._registers + offset:x}\n")
            return int(self._soc.expect("> ").split()[0], 16)
        self._soc.send(f"w{self._registers + offset:x} {value:x}\n")
        self._soc.expect("> ")
        return 0

    def memory(self, address: int, data: bytes | int) -> bytes:
        """As of `Backend`; takes no time."""
        if isinstance(data, int):
            return self._soc.read(address, data).tobytes()
        self._soc.write(address, data)
        return b""

    def pause(self) -> None:
        """A thousand cycles."""
        self._soc.run(1000)

    def close(self) -> None:
        """Ends the simulation."""
        self._soc.__exit__()


@dataclass(eq=False)
class DeviceFrame:
    """What a frame left. buffer: uint8 (rows of pixels, stride). error: bits of ResultError. pairs: of tiles written. cycles: from its being taken to its
    end; of each half."""

    buffer: np.ndarray
    error: int
    pairs: int
    cycles: int
    front_cycles: int
    rendering_cycles: int

    @property
    def errors(self) -> list[str]:
        """Texts of the error's bits."""
        return [driver.library().flk_error_text(int(bit)).decode() for bit in ResultError if self.error >> bit & 1]

    def image(self, camera: Camera) -> np.ndarray:
        """float64 (H, W, 3) of a buffer in RGB8."""
        return frame_image(self.buffer, camera)


class Device:
    """A chip behind a backend. Use as a context. FlickerError begins with "device" and has the status's text."""

    def __init__(self, backend: Backend) -> None:
        self.backend, self.driver = backend, driver.library()
        self._error: BaseException | None = None
        self._calls = driver.READ(self._read), driver.WRITE(self._write)  # kept alive
        self._device, self._scene = driver.CDevice(), driver.CScene()
        self._free = 0
        self._tag = 0
        self._check("flk_probe", ctypes.byref(self._device), ctypes.byref(driver.CBus(*self._calls, None)))
        if self.driver.flk_interrupt_pending(ctypes.byref(self._device)) >> REGISTERS["interrupt"].fields["frame_done"][0] & 1:
            self.driver.flk_release(ctypes.byref(self._device))  # of whoever had the chip before
        self._raise()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_) -> None:
        self.backend.close()

    # ---- calls ----------------------------------------------------------------------------------------------------------------------

    def _access(self, offset: int, value: int | None) -> int:
        """What a callback of the driver raises would be lost; it is kept for `_raise`."""
        if self._error is None:
            try:
                return self.backend.register(offset, value) & 0xFFFFFFFF
            except BaseException as error:
                self._error = error
        return 0

    def _read(self, _user: int, offset: int) -> int:
        return self._access(offset, None)

    def _write(self, _user: int, offset: int, value: int) -> None:
        self._access(offset, value)

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _check(self, function: str, *arguments: object) -> None:
        status = getattr(self.driver, function)(*arguments)
        self._raise()
        if status:
            raise FlickerError(f"device: FLK_{driver.statuses()[status]}: {self.driver.flk_status_text(status).decode()}")

    # ---- the chip --------------------------------------------------------------------------------------------------------------------

    @property
    def capability(self) -> dict[str, int]:
        """What the chip was built with, by the names of flk_device_t."""
        names = (
            "minor", "stage", "form", "precision", "vrus", "mask_generator", "lanes", "lists", "beat", "cores", "preproc_lanes", "list_writers",
            "sort_units", "preproc_interval", "colour_store",
        )
        return {name: getattr(self._device, name) for name in names}

    def counter(self, index: int) -> int:
        """A performance counter, by its number (`chip_registers.ChipCounter`)."""
        value = self.driver.flk_counter(ctypes.byref(self._device), ctypes.c_uint32(index))
        self._raise()
        return value

    def set_timeout(self, cycles: int) -> None:
        """Cycles without progress after which the chip gives up; 0: never."""
        self.driver.flk_set_timeout(ctypes.byref(self._device), ctypes.c_uint32(cycles))
        self._raise()

    def load(self, scene: PackedScene | bytes) -> None:
        """Put a packed scene into memory and check it there."""
        image = scene if isinstance(scene, bytes) else scene.image()
        if len(image) > self.backend.size:
            raise FlickerError(f"device: the scene has {len(image):,} bytes, the memory {self.backend.size:,}")
        self.backend.memory(self.backend.base, image)
        self._check("flk_scene_open", ctypes.byref(self._scene), image, len(image), self.backend.base, 0)
        self._free = self.backend.base + -(-len(image) // PAGE) * PAGE

    def render(
        self, camera: Camera, format_: PixelFormat = PixelFormat.RGB8, *, background: Sequence[int] = (0, 0, 0), lists: ListKind = ListKind.ELLIPSE,
        order: SortOrder = SortOrder.DEPTH, cat: CatMode = CatMode.SMOOTH, deadline: int = 0,
    ) -> DeviceFrame:
        """A frame; list memory grows until it suffices. FlickerError for any other fault but `late`."""
        if not self._free:
            raise FlickerError("device: no scene is loaded")
        chunks = self.driver.flk_list_chunks(camera.width, camera.height, ENTRIES * self._scene.gaussians)
        while True:
            frame = self._frame(camera, format_, background, lists, order, cat, deadline, chunks)
            done = self._run(frame)
            if not done.error >> ResultError.LIST_MEMORY & 1:
                break
            chunks *= 4
        if done.error & ~(1 << ResultError.LATE):
            raise FlickerError(f"device: {', '.join(done.errors)}")
        return done

    def _frame(
        self, camera: Camera, format_: PixelFormat, background: Sequence[int], lists: ListKind, order: SortOrder, cat: CatMode, deadline: int, chunks: int,
    ) -> driver.CFrame:
        lib, at, places = self.driver, self._free, []
        stride = lib.flk_least_stride(camera.width, int(format_))
        record_bytes = lib.flk_record_bytes(ctypes.byref(self._scene), self._device.form)
        for size in (record_bytes, lib.flk_list_bytes(chunks), lib.flk_pointer_bytes(camera.width, camera.height), lib.flk_frame_bytes(camera.height, stride)):
            places.append(at)
            at += -(-size // PAGE) * PAGE
        if at > self.backend.base + self.backend.size:
            raise FlickerError(f"device: scene and frame take {at - self.backend.base:,} bytes, the memory has {self.backend.size:,}")
        self._tag = self._tag % 0xFFFF + 1
        return driver.CFrame(
            ctypes.pointer(self._scene), driver.CCamera.of(camera), driver.CRegion(places[0], record_bytes, places[1], chunks, places[2]), places[3], stride,
            int(format_), (ctypes.c_uint8 * 3)(*background), int(cat), lists is ListKind.BOX, self._tag, deadline, order is SortOrder.DISTANCE,
        )

    def _run(self, frame: driver.CFrame) -> DeviceFrame:
        device, number = ctypes.byref(self._device), ctypes.c_uint16()
        if frame.deadline:  # what the frame does not write would be another one's
            rows = -(-frame.camera.height // TILE) * TILE
            buffer = ctypes.create_string_buffer(rows * frame.stride)
            self.driver.flk_frame_fill(ctypes.byref(frame), buffer)
            self.backend.memory(frame.frame_buffer, buffer.raw)
        self._check("flk_frame_write", device, ctypes.byref(frame), None)
        self._check("flk_start", device, ctypes.byref(number))
        while True:
            status = driver.statuses()[self.driver.flk_poll(device, number)]
            self._raise()
            if status != "BUSY":
                break
            self.backend.pause()
        result = self.driver.flk_result(device)
        if status == "DEAD":
            raise FlickerError("device: FLK_DEAD: the chip has given up after a time-out, and wants a reset")
        stamps = [self.counter(k) for k in range(ChipCounter.STAMP_TAKEN, ChipCounter.STAMP_RENDERING_DONE + 1)]
        rows = -(-frame.camera.height // TILE) * TILE
        buffer_ = np.frombuffer(self.backend.memory(frame.frame_buffer, rows * frame.stride), np.uint8).reshape(rows, frame.stride)
        self.driver.flk_release(device)
        self._raise()
        taken, front_done, begin, end = stamps
        return DeviceFrame(
            buffer_, result.error, result.pairs, (end - taken) % 2**32, (front_done - taken) % 2**32, (end - begin) % 2**32,
        )


def backend_of(name: str, config: RenderConfig) -> Backend:
    """`chip`: the simulated chip of a configuration; `soc`: the SoC in simulation, with the chip of its table that has the configuration; MODULE:NAME: what
    NAME of a Python module makes when it is called, for a board. FlickerError where there is none."""
    if name == "chip":
        return SimulatedChip(config, DramConfig())
    if name == "soc":
        if (chip := name_of(config)) is None:
            raise FlickerError("--device soc: takes a chip of chips.toml (--chip)")
        return SimulatedSoc(chip)
    module, _, attribute = name.partition(":")
    if not attribute:
        raise FlickerError(f"--device: chip, soc or MODULE:NAME, not {name}")
    try:
        return getattr(importlib.import_module(module), attribute)()
    except (ImportError, AttributeError) as error:
        raise FlickerError(f"--device {name}: {error}") from None


def render_on_device(
    view: View, name: str, *, config: RenderConfig, options: FrontOptions | None = None, compare: bool = False, steps: Steps | None = None,
) -> Rendered:
    """Render a view on a device (`backend_of`)."""
    steps, options = steps or Steps(), options or FrontOptions()
    with steps.step("packing the scene"):
        packed, packing = packed_for_picture(view, options)
    with steps.step("reaching the device (a simulator is built once)"):
        backend = backend_of(name, config)
    red, green, blue = (round(255 * float(v)) for v in view.background)
    with steps.step("rendering on the device"), Device(backend) as device:
        device.load(packed)
        frame = device.render(view.camera, background=(red, green, blue), lists=options.lists, order=view.order, cat=config.cat)
        found: dict[str, Any] = {
            "device": name, "capability": device.capability, "format": packed.format.value, "records": RecordKind.of(config.form).value, "adjusted": {},
            "cycles": frame.cycles, "front_cycles": frame.front_cycles, "rendering_cycles": frame.rendering_cycles,
        }
    image = frame.image(view.camera)
    stats = basic_stats(view, Engine.CHIP, Front.RTL, config) | packing | found
    return Rendered(image, stats | compared(view, image, steps) if compare else stats)
