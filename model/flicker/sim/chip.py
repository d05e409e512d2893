"""The verilated chip: a packed scene in memory, registers through the C driver, frames (docs/reference/chip.md).

    with ChipSession(packed, config) as chip:
        frame = chip.render(camera)
    frame.buffer  # to be compared with golden.chip.render_chip
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..chip_counters import FRONT, LIVE, RENDERING, STAMPS, Counter
from ..chip_registers import REGISTERS, ChipCounter, ResultError
from ..golden.frame_buffer import PixelFormat
from ..golden.front.frame import ListKind
from ..params import CORES, COUNTER_INDEX_BITS, TILE, RenderConfig, SortOrder
from ..scene.camera import Camera
from ..scene.packed import HEADER_BYTES, PackedScene
from . import driver, half
from .half import PAGE, Half, MemoryOptions
from .memory import Order, PortConfig, PurposeCounts

# The memory's controller gives bursts once they are whole, and serves the two highest qualities of service first (docs/reference/memory_port.md).
PORT = PortConfig(id_bits=7, max_reads=256, max_writes=256, latency=20, hazards=False, order=Order.WHOLE, urgent=14)
PURPOSES = ("table", "headers", "geometry", "colour", "records", "lists", "pointers", "frame", "image header", "store")
OF_PLACE = ("records", "lists", "pointers", "frame")  # in the order of a `Place`
IMAGE = 1 << 28  # address of the scene
ENTRIES = 2  # of lists expected for each Gaussian; list memory grows when there are more
LIMIT = 100_000_000  # cycles of a frame
SLICE = 5_000  # cycles between looks at the progress


def build(config: RenderConfig) -> Path:
    """Shared library of the simulator, with the design's assertions; cached by content."""
    settings = [half.HERE / f"{name}.vlt" for name in ("preprocessing", "render_stage", "lanes", "rendering")]
    return half.build(
        "flk_top", config.top_parameters(), settings, ["--inline-mult", "20000"],
        define="-DFLK_CHIP",
    )


@dataclass(frozen=True)
class Place:
    """Addresses of what a frame writes, and how much there is, as the driver takes them. stride: bytes. number: of those whose traffic is counted apart."""

    region: driver.CRegion
    frame_buffer: int
    stride: int
    number: int = 0


@dataclass(frozen=True)
class Usage:
    """live: counters that run on, by name. traffic: bytes that the DRAM read and wrote, by what lies there. Since the session began, or in a frame."""

    live: dict[str, int]
    traffic: dict[str, tuple[int, int]]

    def since(self, before: Usage) -> Usage:
        """What has come since an earlier state."""
        return Usage(
            {name: (value - before.live[name]) % 2**32 for name, value in self.live.items()},
            {name: (read - before.traffic[name][0], written - before.traffic[name][1]) for name, (read, written) in self.traffic.items()},
        )


@dataclass(eq=False)
class ChipFrame:
    """What a frame left. buffer: uint8 (rows of pixels, stride); bytes that it did not write stay. error: bits of ResultError. pairs: of tiles written.

    front, rendering: counters of the halves by name, int or int64 (n,). stage: int64 (cores, 32). stamps: cycle in which the frame was taken, left the front
    end, entered and left the rendering half. usage: of a frame that had the chip to itself (`ChipSession.render`).
    """

    tag: int
    error: int
    buffer: np.ndarray
    front: dict[str, int | np.ndarray]
    rendering: dict[str, int | np.ndarray]
    stage: np.ndarray
    stamps: dict[str, int]
    pairs: int
    usage: Usage | None = None

    @property
    def phases(self) -> dict[str, int]:
        """Cycles of the halves."""
        return {"front end": self._between("taken", "front_done"), "rendering": self._between("rendering_start", "rendering_done")}

    @property
    def cycles(self) -> int:
        """From the frame's being taken to its end."""
        return self._between("taken", "rendering_done")

    def _between(self, first: str, second: str) -> int:
        return (self.stamps[second] - self.stamps[first]) % 2**32

    @property
    def errors(self) -> list[str]:
        """Texts of the error's bits."""
        return [driver.library().flk_error_text(int(bit)).decode() for bit in ResultError if self.error >> bit & 1]


class ChipSession(Half):
    """A chip with its memory, driven by sw/flk.c. Use as a context. FlickerError begins with "chip"."""

    def __init__(
        self, packed: PackedScene, config: RenderConfig, *, memory: MemoryOptions | None = None, seed: int = 1,
        image: bytes | None = None, port: PortConfig = PORT,
    ) -> None:
        super().__init__("chip", build(config), {"memory": replace(port, data_bits=config.port_bits)}, memory or MemoryOptions(), seed)
        lib = self._lib
        lib.flk_chip_register.argtypes = [ctypes.c_void_p, ctypes.c_uint32, ctypes.c_int, ctypes.c_void_p]
        lib.flk_chip_wait.argtypes = [ctypes.c_void_p, ctypes.c_uint64, ctypes.c_int]
        lib.flk_chip_wait.restype = ctypes.c_int64
        lib.flk_chip_hold_memory.argtypes = [ctypes.c_void_p, ctypes.c_int]
        lib.flk_chip_quiet.argtypes = [ctypes.c_void_p]
        self.config, self.packed = config, packed
        self.driver = driver.library()
        self._error: BaseException | None = None
        self._calls = driver.READ(self._read), driver.WRITE(self._write)  # kept alive
        self.device, self.scene = driver.CDevice(), driver.CScene()
        data = packed.image() if image is None else image
        self._load_image(data)
        self._check(self.call("flk_scene_open", ctypes.byref(self.scene), data, len(data), IMAGE, 0))
        self._check(self.call("flk_probe", ctypes.byref(self.device), ctypes.byref(driver.CBus(*self._calls, None))))
        self._next = IMAGE + -(-len(data) // PAGE) * PAGE

    # ---- registers ------------------------------------------------------------------------------------------------------------------

    def _access(self, offset: int, write: bool, value: int = 0) -> int:
        """What a callback of the driver raises, Ctrl-C too, would be lost; it is kept for `_raise`."""
        word = ctypes.c_uint32(value)
        try:
            done = self._lib.flk_chip_register(self._sim, offset, write, ctypes.byref(word))
            if done != 1:
                self._error = self._error or self._failure("" if done == -1 else f"register {offset:#x} answers with an error")
        except BaseException as error:
            self._error = error
        return word.value

    def _read(self, _user: int, offset: int) -> int:
        return self._access(offset, False)

    def _write(self, _user: int, offset: int, value: int) -> None:
        self._access(offset, True, value)

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def register(self, name: str, index: int = 0) -> int:
        """Value of a register."""
        value = self._access(REGISTERS[name].offset + 4 * index, False)
        self._raise()
        return value

    def set_register(self, name: str, value: int, index: int = 0) -> None:
        """Write a register by its name."""
        self._access(REGISTERS[name].offset + 4 * index, True, value)
        self._raise()

    def field(self, register: str, name: str) -> int:
        """Read a field of a register by their names."""
        low, bits = REGISTERS[register].fields[name]
        return self.register(register) >> low & (1 << bits) - 1

    def call(self, function: str, *arguments: object) -> str:
        """A function of the driver that returns a status: its name, without FLK_."""
        status = getattr(self.driver, function)(*arguments)
        self._raise()
        return driver.statuses()[status]

    def _check(self, status: str) -> None:
        if status != "OK":
            text = self.driver.flk_status_text(driver.statuses().index(status)).decode()
            raise self._failure(text)

    # ---- memory -----------------------------------------------------------------------------------------------------------------------

    def _load_image(self, data: bytes) -> None:
        at = IMAGE
        sizes = [HEADER_BYTES, *map(len, self.packed.sections().values())]
        for size, purpose in zip(sizes, (PURPOSES.index("image header"), 0, 1, 2, 3)):
            offset = at - IMAGE
            self.load(at, size, data[offset : offset + size], purpose)
            at += size

    def allocate(self, size: int, purpose: str, data: bytes = b"", number: int = 0) -> int:
        """Address of new memory: the data, and noise behind them. number: traffic of the same purpose is counted apart by it."""
        at = self._next
        self.load(at, -(-max(size, 1) // 64) * 64, data, number * len(PURPOSES) + PURPOSES.index(purpose))
        self._next += -(-max(size, 1) // PAGE) * PAGE
        return at

    def place(
        self, camera: Camera, format_: PixelFormat = PixelFormat.RGB8, *, chunks: int | None = None, stride: int | None = None, number: int = 0,
    ) -> Place:
        """Memory for a frame of a camera's size."""
        lib, width, height = self.driver, camera.width, camera.height
        chunks = lib.flk_list_chunks(width, height, ENTRIES * self.scene.gaussians) if chunks is None else chunks
        stride = stride or lib.flk_least_stride(width, int(format_))
        record_bytes = lib.flk_record_bytes(ctypes.byref(self.scene), self.device.form)
        records, lists, pointers, picture = (
            self.allocate(size, purpose, number=number) for purpose, size in zip(OF_PLACE, (
                record_bytes, lib.flk_list_bytes(chunks), lib.flk_pointer_bytes(width, height), lib.flk_frame_bytes(height, stride),
            ))
        )
        return Place(driver.CRegion(records, record_bytes, lists, chunks, pointers), picture, stride, number)

    def store(self, tolerance: float, generation: int = 1, colours: bytes = b"") -> driver.CStore:
        """Memory for kept colours, of frames that follow each other. colours: what it holds first (`ColourStore.image`); else zeros. FlickerError where they
        are not as many bytes as the scene's."""
        size = self.driver.flk_store_bytes(ctypes.byref(self.scene))
        if colours and len(colours) != size:
            raise self._failure(f"kept colours: {len(colours):,} bytes, the scene's take {size:,}")
        return driver.CStore(self.allocate(size, "store", colours or bytes(size)), size, generation, tolerance)

    def fail(self, base: int, size: int, writes: bool = True) -> None:
        """Bursts that touch a range, or reads alone, are answered with an error from now on."""
        self._lib.flk_half_fail(self._sim, base, size, writes)

    def hold_memory(self, hold: bool) -> None:
        """The memory's side of the port is in reset, or no more."""
        self._lib.flk_chip_hold_memory(self._sim, hold)

    @property
    def quiet(self) -> bool:
        """Nothing is under way at the memory."""
        return bool(self._lib.flk_chip_quiet(self._sim))

    # ---- frames -----------------------------------------------------------------------------------------------------------------------

    def frame(
        self, camera: Camera, place: Place, format_: PixelFormat = PixelFormat.RGB8, *, background: Sequence[int] = (0, 0, 0),
        lists: ListKind = ListKind.ELLIPSE, order: SortOrder = SortOrder.DEPTH, tag: int = 0, deadline: int = 0,
        store: driver.CStore | None = None,
    ) -> driver.CFrame:
        """The driver's description of a frame. store: kept colours, of `store`."""
        return driver.CFrame(
            ctypes.pointer(self.scene), driver.CCamera.of(camera), place.region, place.frame_buffer, place.stride, int(format_),
            (ctypes.c_uint8 * 3)(*background), int(self.config.cat), lists is ListKind.BOX, tag, deadline, order is SortOrder.DISTANCE,
            None if store is None else ctypes.pointer(store),
        )

    def start(self, frame: driver.CFrame, other: driver.CFrame | None = None) -> int:
        """Write a descriptor and start it: number of the frame. other: frame that is under way."""
        self._check(self.call("flk_frame_write", ctypes.byref(self.device), ctypes.byref(frame), ctypes.byref(other) if other else None))
        number = ctypes.c_uint16()
        self._check(self.call("flk_start", ctypes.byref(self.device), ctypes.byref(number)))
        return number.value

    def step(self, cycles: int) -> None:
        """So many cycles, whatever the interrupt does."""
        if self._lib.flk_chip_wait(self._sim, cycles, 0) < 0:
            raise self._failure()

    def wait(self, limit: int = LIMIT) -> None:
        """Until an enabled interrupt waits; Ctrl-C is seen meanwhile. FlickerError after `limit` cycles."""
        for begin in range(0, limit, SLICE):
            most = min(SLICE, limit - begin)
            cycles = self._lib.flk_chip_wait(self._sim, most, 1)
            if cycles < 0:
                raise self._failure()
            if cycles < most:
                return
        raise self._failure(f"no interrupt within {limit} cycles")

    def _wait_with(self, progress: Callable[[int, int], None], frame: driver.CFrame, limit: int) -> None:
        """Progress by what has been read of the geometry and written of the frame buffer."""
        geometry = len(self.packed.sections()["geometry"])
        picture = self.driver.flk_frame_bytes(frame.camera.height, frame.stride)
        at = self.purposes()
        for _ in range(0, limit, SLICE):
            if 0 <= self._lib.flk_chip_wait(self._sim, SLICE, 1) < SLICE:
                return
            now = self.purposes()
            read = min(1.0, (now["geometry"].read_bytes - at["geometry"].read_bytes) / geometry)
            written = min(1.0, (now["frame"].write_bytes - at["frame"].write_bytes) / picture)
            progress(round(200 * read + 800 * written), 1000)
        self.wait(1)

    def counter(self, index: int) -> int:
        """Read a counter of the frame that ended last, by its index."""
        value = self.driver.flk_counter(ctypes.byref(self.device), ctypes.c_uint32(index))
        self._raise()
        return value

    def _counters(self, counters: Sequence[Counter]) -> dict[str, int | np.ndarray]:
        """By name."""
        out: dict[str, int | np.ndarray] = {}
        for counter in counters:
            values = [self.counter(counter.number + k) for k in range(counter.words)]
            out[counter.name] = values[0] if counter.words == 1 else np.array(values, np.int64)
        return out

    def usage(self) -> Usage:
        """Of all frames until now."""
        live = {name: int(value) for name, value in self._counters(LIVE).items()}
        return Usage(live, {name: (int(c.dram_read_bytes), int(c.dram_write_bytes)) for name, c in self.purposes().items()})

    def finish(self, frame: driver.CFrame, limit: int = LIMIT, progress: Callable[[int, int], None] | None = None) -> ChipFrame:
        """Wait until the next frame ends, which must be this one; read what it left and acknowledge it. progress: called with (done, all) now and then."""
        self.driver.flk_interrupt_enable(ctypes.byref(self.device), ctypes.c_uint32(1 << REGISTERS["interrupt"].fields["frame_done"][0]))
        if progress is None:
            self.wait(limit)
        else:
            self._wait_with(progress, frame, limit)
        buffer = self.buffer(frame)
        front, rendering_ = self._counters(FRONT), self._counters(RENDERING)
        stamps = {name: int(value) for name, value in self._counters(STAMPS).items()}
        words = 1 << COUNTER_INDEX_BITS
        stage = np.array([self.counter(ChipCounter.STAGE + k) for k in range(CORES * words)], np.int64).reshape(CORES, words)
        result = self.driver.flk_result(ctypes.byref(self.device))
        self.driver.flk_release(ctypes.byref(self.device))
        self._raise()
        if result.tag != frame.tag:
            raise self._failure(f"frame {result.tag} has ended, not {frame.tag}")
        return ChipFrame(result.tag, result.error, buffer, front, rendering_, stage, stamps, result.pairs)

    def buffer(self, frame: driver.CFrame) -> np.ndarray:
        """uint8 (rows of pixels, stride)."""
        rows = -(-frame.camera.height // TILE) * TILE
        return self.read(frame.frame_buffer, rows * frame.stride).reshape(rows, frame.stride)

    def render(
        self, camera: Camera, format_: PixelFormat = PixelFormat.RGB8, *, background: Sequence[int] = (0, 0, 0), lists: ListKind = ListKind.ELLIPSE,
        order: SortOrder = SortOrder.DEPTH, limit: int = LIMIT, progress: Callable[[int, int], None] | None = None,
    ) -> ChipFrame:
        """A frame; list memory grows until it suffices. FlickerError for any other fault."""
        chunks: int | None = None
        while True:
            place = self.place(camera, format_, chunks=chunks)
            frame = self.frame(camera, place, format_, background=background, lists=lists, order=order)
            before = self.usage()
            self.start(frame)
            done = self.finish(frame, limit, progress)
            if not done.error >> ResultError.LIST_MEMORY & 1:
                break
            chunks = 4 * place.region.chunks
        if done.error:
            raise self._failure(", ".join(done.errors))
        return replace(done, usage=self.usage().since(before))

    def purposes(self, number: int = 0) -> dict[str, PurposeCounts]:
        """Traffic of all frames, by what lies there: the scene, and the places with this number."""
        own = self.traffic(PURPOSES, number * len(PURPOSES))
        return self.traffic(PURPOSES) | {name: own[name] for name in OF_PLACE}
