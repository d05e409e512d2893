"""The C driver (sw/flk.c), built by the system's C compiler and called through ctypes.

State space: memory images of every format, good, cut at every length (behind a page that must not be read), with each fault alone and with random header words;
cameras at random, extreme and of the demo; numbers at random and at every edge; regions moved into each other; the sequence of a frame at a bus of registers.
Compared with the golden model: FrameSetup, ff_bits, the lists' and frame buffer's sizes, the packed scene's own reader, and the map of the registers.
Not covered: a chip behind the registers.
"""

from __future__ import annotations

import ctypes
import dataclasses
import mmap
import os
import struct
import subprocess
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flicker.arithmetic.ff import ff_bits, ff_round
from flicker.chip_registers import REGISTERS, ResultError
from flicker.errors import FlickerError
from flicker.golden.frame_buffer import PixelFormat, least_stride
from flicker.golden.front.record import RecordKind
from flicker.golden.front.reuse import ColourStore, limit_of
from flicker.golden.front.setup import CLUSTER_M, FrameSetup
from flicker.golden.lists import CHUNK_LINES, LINE_BYTES, MAX_CHUNKS, WRITERS, list_chunks, pointer_lines
from flicker.golden.long_lists import region_bytes
from flicker.params import TILE, CatMode, Form
from flicker.scene import packed as packed_module
from flicker.scene.camera import Camera, orbit_camera
from flicker.scene.demo import generate
from flicker.scene.files import Scene
from flicker.scene.packed import HEADER_BYTES, IMAGE_HEADER, PackedFormat, PackedScene
from flicker.scene.packing import pack
from flicker.sim.driver import (
    NUMBERS,
    PAUSE,
    READ,
    SW,
    WRITE,
    CBus,
    CCamera,
    CCameraRegisters,
    CDevice,
    CFrame,
    CRegion,
    CScene,
    CStore,
    library,
    statuses,
    u8,
    u16,
    u32,
)
from flicker.sim.preprocessing import Regions

SEED = int(os.environ.get("FLICKER_SEED", "1"))
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Werror", "-ffp-contract=off")

STATUSES = statuses()


def compiler() -> str:
    return os.environ.get("CC", "cc")


@pytest.fixture(scope="module")
def lib() -> ctypes.CDLL:
    return library()


def test_compiles_as_told(tmp_path: Path) -> None:
    """Without a warning also unoptimised, and the header in C++."""
    subprocess.run([compiler(), *STRICT, "-O0", "-c", str(SW / "flk.c"), "-o", str(tmp_path / "flk.o")], check=True)
    subprocess.run(["g++", "-std=c++17", "-Wall", "-Wextra", "-pedantic", "-Werror", "-fsyntax-only", "-x", "c++", str(SW / "flk.h")], check=True)


def test_example(tmp_path: Path) -> None:
    """That of the page compiles."""
    text = (SW / "README.md").read_text().split("```c\n")[1].split("```")[0]
    (tmp_path / "example.c").write_text(text)
    subprocess.run([compiler(), *STRICT, f"-I{SW}", "-c", str(tmp_path / "example.c"), "-o", str(tmp_path / "example.o")], check=True)


def test_texts(lib: ctypes.CDLL) -> None:
    texts = [lib.flk_status_text(k) for k in range(len(STATUSES))]
    assert STATUSES[-1] == "STATUSES" and len(set(texts)) == len(texts) and all(texts)
    assert texts[-1] == lib.flk_status_text(1000) == lib.flk_status_text(-1) == b"unknown status"
    errors = [lib.flk_error_text(k) for k in range(16)]
    assert all((text == b"unknown error") != (k in set(map(int, ResultError))) for k, text in enumerate(errors)) and len(set(errors)) == len(ResultError) + 1


# ---- scene ----------------------------------------------------------------------------------------------------------------------------


def small_scene(seed: int = SEED, count: int = 700) -> Scene:
    rng = np.random.default_rng(seed)
    quats = rng.normal(size=(count, 4))
    return Scene(
        means=rng.uniform(-2, 2, (count, 3)), scales=np.exp(rng.uniform(-4, -1, (count, 3))), quats=quats / np.linalg.norm(quats, axis=1, keepdims=True),
        opacities=rng.uniform(0.1, 0.9, count), sh=rng.uniform(-0.5, 0.5, (count, 4, 3)),
    )


@pytest.fixture(scope="module", params=list(PackedFormat), ids=lambda form: form.value)
def packed(request: pytest.FixtureRequest) -> PackedScene:
    return pack(small_scene(), request.param).packed


@pytest.fixture(scope="module")
def chunk() -> PackedScene:
    return pack(small_scene(), PackedFormat.CHUNK).packed


@pytest.fixture(scope="module")
def guarded() -> Iterator[Any]:
    """Puts bytes right before a page that cannot be read; gives their address."""
    size = 1 << 20
    area = mmap.mmap(-1, size + mmap.PAGESIZE)
    base = ctypes.addressof(ctypes.c_char.from_buffer(area))
    assert ctypes.CDLL(None, use_errno=True).mprotect(ctypes.c_void_p(base + size), mmap.PAGESIZE, 0) == 0

    def place(data: bytes) -> int:
        assert len(data) <= size
        area[size - len(data) : size] = data
        return base + size - len(data)

    yield place
    assert ctypes.CDLL(None).mprotect(ctypes.c_void_p(base + size), mmap.PAGESIZE, mmap.PROT_READ | mmap.PROT_WRITE) == 0


def open_scene(lib: ctypes.CDLL, at: int, size: int, address: int = 0x10000000, flags: int = 0) -> tuple[str, CScene]:
    scene = CScene()
    ctypes.memset(ctypes.byref(scene), 0xA5, ctypes.sizeof(scene))
    untouched = bytes(scene)
    status = STATUSES[lib.flk_scene_open(ctypes.byref(scene), at, size, address, flags)]
    assert status == "OK" or bytes(scene) == untouched, "written in spite of a fault"
    return status, scene


def test_scene(lib: ctypes.CDLL, packed: PackedScene, guarded: Any) -> None:
    image = packed.image()
    header = np.frombuffer(image, IMAGE_HEADER, 1)[0]
    for address in (0, 0x10000000, (1 << 40) - (-(-len(image) // 4096)) * 4096):
        status, scene = open_scene(lib, guarded(image), len(image), address)
        assert status == "OK" and scene.address == address and scene.bytes == len(image)
        assert (scene.format, scene.degree, scene.gaussians) == (packed.format.code, packed.degree, len(packed))
        assert (scene.clusters, scene.slots) == (len(packed.table), len(packed.geometry))
        at = address + HEADER_BYTES
        for part, data in zip(scene.part, packed.sections().values()):
            assert part == at
            at += len(data)
        assert list(scene.low) == header["low"].tolist() and list(scene.high) == header["high"].tolist() and scene.sigma == header["sigma"]
    for address in (64, 1, 1 << 40, (1 << 40) - 4096 * (len(image) // 4096), 1 << 63):
        assert open_scene(lib, guarded(image), len(image), address)[0] == "IMAGE_ADDRESS"
    for kind in RecordKind:
        assert lib.flk_record_bytes(ctypes.byref(scene), int(kind.form)) == Regions.of(packed, camera_of(), 1, kind).record_bytes


def changed(image: bytes, sealed: bool = True, **fields: Any) -> bytes:
    """With other header fields; sealed: and the header's checksum to match."""
    header = np.frombuffer(image, IMAGE_HEADER, 1).copy()[0]
    for name, value in fields.items():
        header[name] = value
    if sealed:
        header["crc"] = zlib.crc32(header.tobytes()[:-4])
    return header.tobytes() + image[HEADER_BYTES:]


def test_each_fault_of_an_image(lib: ctypes.CDLL, packed: PackedScene, guarded: Any) -> None:
    image = packed.image()
    first = np.frombuffer(image, IMAGE_HEADER, 1)[0]
    header = {name: int(first[name]) for name in IMAGE_HEADER.names if first[name].ndim == 0 and IMAGE_HEADER[name].kind == "u"}
    faults: list[tuple[str, bytes]] = [
        ("IMAGE_MAGIC", b"FLKSCENF" + image[8:]), ("IMAGE_VERSION", changed(image, version=3)), ("IMAGE_VERSION", changed(image, version=0)),
        ("IMAGE_FORMAT", changed(image, format=3)), ("IMAGE_FORMAT", changed(image, format=0x100)),
        ("IMAGE_COUNTS", changed(image, degree=4)), ("IMAGE_COUNTS", changed(image, gaussians=0)), ("IMAGE_COUNTS", changed(image, clusters=0)),
        ("IMAGE_COUNTS", changed(image, slots=header["slots"] + 1)), ("IMAGE_COUNTS", changed(image, slots=(1 << 24) + 16, clusters=1 << 17)),
        ("IMAGE_COUNTS", changed(image, gaussians=header["slots"] + 1)), ("IMAGE_COUNTS", changed(image, clusters=header["slots"] // 16 + 1)),
        ("IMAGE_COUNTS", changed(image, clusters=header["slots"] // 256)),
        ("IMAGE_SIZE", changed(image, beats=header["beats"] + 1)), ("IMAGE_SIZE", changed(image, beats=header["beats"] - 1)),
        ("IMAGE_SIZE", changed(image, beats=0xFFFFFFFF)), ("IMAGE_SIZE", image + bytes(64)), ("IMAGE_SIZE", image + b"\0"),
        *(("IMAGE_PLACE", changed(image, **{f"{part}_offset": header[f"{part}_offset"] + 1})) for part in ("table", "headers", "geometry", "colour")),
        *(("IMAGE_PART", changed(image, **{f"{part}_beats": header[f"{part}_beats"] + step})) for part in ("table", "headers", "geometry", "colour")
          for step in (1, -1)),
        ("IMAGE_PART", changed(image, colour_beats=0xFFFFFFFF)),
        *((f"IMAGE_{part.upper()}_CRC", changed(image, **{f"{part}_crc": header[f"{part}_crc"] ^ 1})) for part in ("table", "headers", "geometry", "colour")),
    ]
    reserved = bytearray(image)
    for at in (108, 112, 200, 251):
        damaged = reserved.copy()
        damaged[at] = 2  # bit 0 at 108 is a flag
        damaged[252:256] = struct.pack("<I", zlib.crc32(bytes(damaged[:252])))
        faults.append(("IMAGE_RESERVED", bytes(damaged)))
    for bit in (0, 8 * 100 + 3, 8 * 251 + 7, 8 * 255 + 7):  # in the header, with a checksum that does not know of it
        damaged = bytearray(image)
        damaged[bit // 8 if bit >= 80 else 12] ^= 1 << bit % 8
        faults.append(("IMAGE_HEADER_CRC", bytes(damaged)))
    at = HEADER_BYTES
    for name, part in packed.sections().items():  # in a part: its last byte, its first
        for place in (at, at + len(part) - 1):
            damaged = bytearray(image)
            damaged[place] ^= 0x10
            faults.append((f"IMAGE_{name.upper()}_CRC", bytes(damaged)))
        at += len(part)
    for status, data in faults:
        assert open_scene(lib, guarded(data), len(data))[0] == status
        if status.endswith("_CRC") and status != "IMAGE_HEADER_CRC":
            assert open_scene(lib, guarded(data), len(data), flags=1)[0] == "OK"


def test_every_length(lib: ctypes.CDLL, chunk: PackedScene, guarded: Any) -> None:
    """What is cut anywhere is refused, and nothing beyond it is read."""
    image = chunk.image()
    for size in [*range(300), *range(300, len(image), 97), len(image) - 1]:
        assert open_scene(lib, guarded(image[:size]), size)[0] == ("IMAGE_SHORT" if size < HEADER_BYTES else "IMAGE_SIZE")


def test_random_headers(lib: ctypes.CDLL, chunk: PackedScene, guarded: Any) -> None:
    """As the packed scene's own reader decides; and the parts of what is taken lie inside."""
    image, rng = chunk.image(), np.random.default_rng(SEED)
    fields = [name for name in IMAGE_HEADER.names if name not in ("magic", "low", "high", "sigma", "reserved", "crc") and not name.endswith("_crc")]
    header = np.frombuffer(image, IMAGE_HEADER, 1)[0]
    taken = 0
    for _ in range(20_000):
        values: dict[str, Any] = {}
        for name in rng.choice(fields, rng.integers(1, 4), replace=False):
            bits = 8 * IMAGE_HEADER[name].itemsize
            kind = rng.integers(3)
            value = int(header[name]) + int(rng.integers(-2, 3)) * int(rng.choice([1, 16])) if kind else int(rng.integers(1 << bits))
            values[str(name)] = value % (1 << bits)
        data = changed(image, **values)
        status, scene = open_scene(lib, guarded(data), len(data), 0, 1)
        try:
            packed_module._image_header(data, Path("x"))
            ours = True
        except FlickerError:
            ours = False
        if status == "IMAGE_COUNTS":
            continue  # stricter here: the other reader finds these with the cluster table
        assert ours == (status == "OK"), (status, values)
        if status == "OK":
            taken += 1
            ends = [*scene.part[1:], scene.bytes]
            assert all(HEADER_BYTES <= part <= end <= len(data) and part % 64 == 0 for part, end in zip(scene.part, ends))
    assert taken > 100


# ---- camera ---------------------------------------------------------------------------------------------------------------------------


def camera_of(width: int = 640, height: int = 360) -> Camera:
    return Camera(width, height, 500.0, 510.0, np.array([0.5, -1.0, -4.0]), np.eye(3))


def c_camera(camera: Camera) -> CCamera:
    return CCamera.of(camera)


def expected_numbers(camera: Camera) -> dict[str, list[int]]:
    setup = FrameSetup.of(camera)
    f = setup.formats
    bits = dict.fromkeys(("position", "normal", "offset", "reach"), CLUSTER_M) | dict.fromkeys(("view", "focal"), f.position)
    numbers = {name: [int(ff_bits(float(v), bits.get(name, f.shape))) for v in np.ravel(getattr(setup, name))] for name in NUMBERS if name != "middle"}
    return numbers | {"middle": [int(v) & (1 << 23) - 1 for v in setup.middle]}


def check_camera(lib: ctypes.CDLL, camera: Camera) -> None:
    out = CCameraRegisters()
    assert STATUSES[lib.flk_camera_registers(ctypes.byref(out), ctypes.byref(c_camera(camera)))] == "OK"
    assert out.off_centre == ((camera.cx, camera.cy) != (0.5 * (camera.width - 1), 0.5 * (camera.height - 1)))
    for name, numbers in expected_numbers(camera).items():
        assert list(getattr(out, name)) == numbers, name


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_random_cameras(lib: ctypes.CDLL) -> None:
    rng = np.random.default_rng(SEED)
    for turn in range(4000):
        rotation = random_rotation(rng) if turn % 4 else np.eye(3)[rng.permutation(3)]
        if np.linalg.det(rotation) < 0:
            rotation[0] *= -1
        wide = turn % 3 == 0  # focal lengths and positions of any size
        spread = (-60, 60) if wide else (3, 9)
        check_camera(lib, Camera(
            int(rng.integers(1, 4097)), int(rng.integers(1, 4097)), *np.exp(rng.uniform(*spread, 2)).tolist(),
            rng.normal(size=3) * np.exp(rng.uniform(-60, 60) if wide else 1.0), rotation,
            **({"cx": round(float(rng.normal() * 6000), int(rng.integers(0, 12))), "cy": float(rng.uniform(-32767, 32767))} if turn % 2 else {}),
        ))


def test_extreme_cameras(lib: ctypes.CDLL) -> None:
    """Ends of every field, numbers below and above what ff holds, and rotations that are barely one."""
    for width, height in ((1, 1), (4096, 4096), (1, 4096), (17, 16)):
        for f in (1e-30, 1e30, 2.0**-127, 1.0, 1e-320):
            check_camera(lib, Camera(width, height, f, 1.0, np.array([1e30, -1e-40, -0.0]), np.eye(3)))
            check_camera(lib, Camera(width, height, 1.0, f, np.zeros(3), np.eye(3) * (1 + 4e-4)))


def test_demo_cameras(lib: ctypes.CDLL) -> None:
    scene = generate()
    for width, height in ((1280, 720), (640, 360), (33, 4096)):
        for view in range(8):
            check_camera(lib, orbit_camera(scene, view, width=width, height=height))


def test_each_fault_of_a_camera(lib: ctypes.CDLL) -> None:
    nan, inf = float("nan"), float("inf")

    def status(**fields: Any) -> str:
        camera = c_camera(camera_of())
        for name, value in fields.items():
            if isinstance(value, dict):
                for i, x in value.items():
                    getattr(camera, name)[i] = x
            else:
                setattr(camera, name, value)
        return STATUSES[lib.flk_camera_registers(ctypes.byref(CCameraRegisters()), ctypes.byref(camera))]

    assert status() == "OK"
    for name in ("width", "height"):
        assert {status(**{name: n}) for n in (0, 4097, 0xFFFFFFFF)} == {"CAMERA_SIZE"}
    for name in ("fx", "fy"):
        assert {status(**{name: x}) for x in (0.0, -1.0, nan, inf, 1.1e30)} == {"CAMERA_FOCAL"}
    for i in range(3):
        assert {status(position={i: x}) for x in (nan, inf, -inf, 1.1e30)} == {"CAMERA_POSITION"}
    for i in range(9):
        assert {status(rotation={i: x}) for x in (nan, inf, 3.0, 0.5)} == {"CAMERA_ROTATION"}
    assert status(rotation={0: -1.0}) == "CAMERA_ROTATION"  # a mirror
    for name, middle in (("off_x", 319.5), ("off_y", 179.5)):
        assert {status(**{name: x}) for x in (nan, inf, -inf, 1e300, 32767.01 - middle, -32767.01 - middle)} == {"CAMERA_CENTRE"}
        assert status(**{name: 32767.0 - middle}) == status(**{name: -32767.0 - middle}) == "OK"
    rng = np.random.default_rng(SEED)
    for _ in range(2000):  # as the model's camera decides
        rotation = random_rotation(rng) + rng.normal(size=(3, 3)) * 10 ** rng.uniform(-5, -2)
        try:
            Camera(8, 8, 1.0, 1.0, np.zeros(3), rotation)
            ours = "OK"
        except FlickerError:
            ours = "CAMERA_ROTATION"
        assert status(rotation=dict(enumerate(rotation.ravel().tolist()))) == ours


def test_ff_bits(lib: ctypes.CDLL) -> None:
    rng = np.random.default_rng(SEED)
    patterns = rng.integers(0, 1 << 63, 20_000, dtype=np.uint64) | rng.integers(0, 2, 20_000, dtype=np.uint64) << np.uint64(63)
    values = patterns.view(np.float64)
    values = [*values[~np.isnan(values)].tolist(), *np.ldexp(rng.normal(size=5000), rng.integers(-130, 131, 5000)).tolist()]
    for M in (10, 11, 15, 19, 23):
        ties = [(1.0 + k * 2.0**-M + 2.0 ** -(M + 1)) * 2.0**e for k in range(5) for e in (-127, -126, -3, 127)]
        edges = [0.0, float("inf"), 2.0**-126, np.nextafter(2.0**-126, 0), 2.0**-126 * (1 - 2.0 ** -(M + 2)), 2.0**128, np.nextafter(2.0**128, 0), 5e-324]
        for value in [*values, *ties, *edges]:
            for x in (value, -value):
                assert lib.flk_ff_bits(x, M) == int(ff_bits(ff_round(x, M), M)), (x, M)


# ---- sizes ----------------------------------------------------------------------------------------------------------------------------


def test_sizes(lib: ctypes.CDLL) -> None:
    rng = np.random.default_rng(SEED)
    sides = [*range(1, 70), 640, 720, 1080, 4064, 4065, 4095, 4096]
    for _ in range(5000):
        width, height = (int(n) for n in rng.choice(sides, 2))
        entries = int(rng.choice([0, 1, 71, 72, int(rng.integers(1 << 26)), 1 << 40]))
        cols, rows = (-(-n // TILE) for n in (width, height))
        chunks = list_chunks(width, height, entries)
        assert 1 <= chunks <= MAX_CHUNKS and lib.flk_list_chunks(width, height, entries) == chunks
        assert lib.flk_list_bytes(chunks) == chunks * WRITERS * CHUNK_LINES * LINE_BYTES + region_bytes()
        assert lib.flk_pointer_bytes(width, height) == pointer_lines(cols, rows) * LINE_BYTES
        for form in PixelFormat:
            stride = least_stride(width, form)
            assert lib.flk_least_stride(width, int(form)) == stride and stride <= (1 << REGISTERS["stride"].fields["value"][1]) - 1
            assert lib.flk_frame_bytes(height, stride) == rows * TILE * stride


# ---- frames ---------------------------------------------------------------------------------------------------------------------------


class Chip:
    """Registers behind a bus, and what was written, in order."""

    def __init__(self, lib: ctypes.CDLL) -> None:
        self.lib = lib
        self.value = {register.offset + 4 * i: 0 for register in REGISTERS.values() for i in range(register.count)}
        self.writes: list[tuple[int, int]] = []
        self.reads: list[int] = []
        self.set("id", 0x464C4B52)
        self.set("version", 3 | 7 << 8)
        self.set("capability_units", 0x21201)
        self.field("capability", stage=1, form=1, precision=2, vrus=2, mask_generator=3, log2_lists=14, log2_beat=6, log2_lanes=5, colour_store=1)
        self.field("status", ready=1)
        self.calls = READ(self._read), WRITE(self._write)
        self.bus = CBus(*self.calls, 0x1234)
        self.device = CDevice()

    def _read(self, user: int, offset: int) -> int:
        assert user == 0x1234
        self.reads.append(offset)
        return self.value[offset]

    def _write(self, user: int, offset: int, value: int) -> None:
        assert user == 0x1234 and offset in self.value
        self.writes.append((offset, value))
        self.value[offset] = value

    def set(self, name: str, value: int) -> None:
        self.value[REGISTERS[name].offset] = value

    def get(self, name: str, i: int = 0) -> int:
        return self.value[REGISTERS[name].offset + 4 * i]

    def field(self, name: str, **fields: int) -> None:
        self.set(name, sum(value << REGISTERS[name].fields[field][0] for field, value in fields.items()))

    def call(self, function: str, *arguments: Any) -> str:
        return STATUSES[getattr(self.lib, function)(ctypes.byref(self.device), *arguments)]

    def probe(self) -> str:
        return self.call("flk_probe", ctypes.byref(self.bus))


@pytest.fixture
def chip(lib: ctypes.CDLL) -> Chip:
    chip = Chip(lib)
    assert chip.probe() == "OK"
    return chip


def good_frame(
    lib: ctypes.CDLL, packed: PackedScene, width: int = 640, height: int = 360, form: int = 0, records: Form = Form.FACTORED,
) -> tuple[CFrame, CScene]:
    """Regions one after the other, above 2^32; the scene must outlive the frame."""
    image = packed.image()
    data = ctypes.create_string_buffer(image, len(image))
    status, scene = open_scene(lib, ctypes.addressof(data), len(image), 0x12_3456_7000)
    assert status == "OK"
    chunks = lib.flk_list_chunks(width, height, 2 * scene.gaussians)
    region = CRegion(chunks=chunks, record_bytes=lib.flk_record_bytes(ctypes.byref(scene), int(records)))
    region.records = scene.address + scene.bytes
    region.lists = region.records + region.record_bytes
    region.pointers = region.lists + lib.flk_list_bytes(chunks)
    frame = CFrame(
        ctypes.pointer(scene), c_camera(camera_of(width, height)), region, region.pointers + lib.flk_pointer_bytes(width, height),
        lib.flk_least_stride(width, form), form, (u8 * 3)(10, 20, 30), int(CatMode.SMOOTH), 0, 0xBEEF, 123_456, 0,
    )
    return frame, scene


def check_frame(lib: ctypes.CDLL, frame: CFrame, other: CFrame | None = None, lists: int = 0, form: Form = Form.FACTORED) -> str:
    return STATUSES[lib.flk_frame_check(ctypes.byref(frame), ctypes.byref(other) if other is not None else None, u32(form), u32(lists))]


def test_each_fault_of_a_frame(lib: ctypes.CDLL, chunk: PackedScene) -> None:
    frame, scene = good_frame(lib, chunk)

    def status(where: Any = frame, capacity: int = 0, **fields: int) -> str:
        before = {name: getattr(where, name) for name in fields}
        for name, value in fields.items():
            setattr(where, name, value)
        found = check_frame(lib, frame, lists=capacity)
        for name, value in before.items():
            setattr(where, name, value)
        return found

    region = frame.region
    assert status() == status(mode=5) == status(stride=frame.stride + 32 * 100, frame_buffer=1 << 38) == "OK"
    assert status(deadline=(1 << 32) - 1) == "OK"
    assert status(mode=6) == status(pixel_format=2) == "FRAME_MODE"
    assert {status(frame.camera, **{side: n}) for side in ("width", "height") for n in (0, 4097)} == {"CAMERA_SIZE"}
    assert status(region, chunks=0) == status(region, chunks=MAX_CHUNKS + 1) == "FRAME_CHUNKS"
    assert status(region, record_bytes=region.record_bytes - 64) == "FRAME_RECORDS"
    assert status(region, record_bytes=region.record_bytes + 32, records=1 << 37) == "FRAME_ALIGN"
    assert status(stride=frame.stride - 32) == status(stride=frame.stride + 16) == status(stride=1 << 17) == "FRAME_STRIDE"
    assert status(pixel_format=1) == "FRAME_STRIDE"  # wants more
    for where, name in ((region, "records"), (region, "lists"), (region, "pointers"), (frame, "frame_buffer")):
        assert status(where, **{name: (1 << 38) + 32}) == "FRAME_ALIGN", name
        assert {status(where, **{name: at}) for at in ((1 << 40) - 64, 1 << 40, 1 << 63, (1 << 64) - 64)} == {"FRAME_RANGE"}, name
        assert status(where, **{name: 1 << 38}) == "OK", name
    own = -(-640 // 32) * -(-360 // 32)
    assert status(capacity=own) == "OK" and status(capacity=own - 1) == "FRAME_LISTS"
    # Every pair of regions, each beginning in the last bytes of the other and the other way round.
    sizes = {
        "records": region.record_bytes, "lists": lib.flk_list_bytes(region.chunks), "pointers": lib.flk_pointer_bytes(640, 360),
        "frame_buffer": lib.flk_frame_bytes(360, frame.stride), "scene": -(-scene.bytes // 4096) * 4096,
    }

    def place(name: str, at: int) -> None:
        where: Any = {"frame_buffer": frame, "scene": None}.get(name, region)
        if where is not None:
            setattr(where, name, at)

    far = {name: (16 + k) << 32 for k, name in enumerate(sizes)}
    far["scene"] = scene.address
    for name, at in far.items():
        place(name, at)
    assert status() == "OK"
    for moved in sizes:
        for still in sizes.keys() - {moved}:
            if moved == "scene":
                continue
            exact = scene.bytes if still == "scene" else sizes[still]
            for at, expected in (
                (far[still] + exact, "OK"), (far[still] + exact - 64, "FRAME_OVERLAP"), (far[still] - sizes[moved], "OK"),
                (far[still] - sizes[moved] + 64, "FRAME_OVERLAP"), (far[still], "FRAME_OVERLAP"),
            ):
                place(moved, at)
                assert status() == expected, (moved, still)
            place(moved, far[moved])


def test_kept_colours(lib: ctypes.CDLL, chunk: PackedScene, chip: Chip) -> None:
    """The region's place and size, generation and tolerance; two frames may share it, and nothing else may; what the chip is told, and that a frame without
    takes it back."""
    frame, scene = good_frame(lib, chunk)
    other, _scene = good_frame(lib, chunk)
    size = lib.flk_store_bytes(ctypes.byref(scene))
    assert size == len(ColourStore(chunk).image())
    store = CStore(1 << 38, size, 7, 2 / 255)
    frame.store = ctypes.pointer(store)

    def status(**changes: Any) -> str:
        before = {name: getattr(store, name) for name in changes}
        for name, value in changes.items():
            setattr(store, name, value)
        found = check_frame(lib, frame)
        for name, value in before.items():
            setattr(store, name, value)
        return found

    assert status() == status(tolerance=0.0) == status(tolerance=1.0) == status(generation=(1 << 32) - 1) == status(address=(1 << 40) - size & -2048) == "OK"
    assert status(bytes=size - 1) == status(generation=0) == "FRAME_STORE"
    assert {status(tolerance=x) for x in (-1e-300, 1.0 + 2**-52, float("nan"), float("inf"))} == {"FRAME_TOLERANCE"}
    assert {status(address=(1 << 38) + at) for at in (1, 64, 1024)} == {"FRAME_ALIGN"} and status(address=(1 << 40) - 2048) == "FRAME_RANGE"
    region = frame.region
    for at in (region.records, region.lists, region.pointers, frame.frame_buffer, scene.address):
        assert status(address=at & -2048) == "FRAME_OVERLAP"
    conic, _conic = good_frame(lib, chunk, records=Form.CONIC)
    conic.store = frame.store
    assert check_frame(lib, conic, form=Form.CONIC) == "FRAME_KEEPS"
    for name in ("records", "lists", "pointers"):
        setattr(other.region, name, getattr(other.region, name) + (1 << 36))
    other.store = ctypes.pointer(store)
    assert check_frame(lib, other, frame) == "OK"
    away, other.store = other.region.records, None
    other.region.records = store.address
    assert check_frame(lib, other, frame) == check_frame(lib, frame, other) == "FRAME_OVERLAP"
    other.region.records = away
    write = lambda what: chip.call("flk_frame_write", ctypes.byref(what), None)  # noqa: E731
    chip.device.colour_store = 0
    assert write(frame) == "FRAME_KEEPS" and not chip.writes
    chip.device.colour_store = 1
    assert write(frame) == "OK"
    assert (chip.get("store_low") | chip.get("store_high") << 32, chip.get("store_beats"), chip.get("generation")) == (1 << 38, size // 64, 7)
    assert chip.get("tolerance") == ff_bits(limit_of(2 / 255), CLUSTER_M)
    assert write(other) == "OK" and chip.get("generation") == 0
    scene.format = 1
    assert check_frame(lib, frame) == "FRAME_KEEPS"


def test_records_of_either_form(lib: ctypes.CDLL, chunk: PackedScene) -> None:
    """A chip of the conic form wants twice as much; more records than its register counts are refused."""
    frame, scene = good_frame(lib, chunk)
    assert check_frame(lib, frame) == "OK" and check_frame(lib, frame, form=Form.CONIC) == "FRAME_RECORDS"
    frame, scene = good_frame(lib, chunk, records=Form.CONIC)
    assert check_frame(lib, frame) == check_frame(lib, frame, form=Form.CONIC) == "OK"
    frame.region.records, frame.region.record_bytes = 1 << 38, 1 << 36
    for slots, fits in (((1 << 24) - 16, "OK"), (1 << 24, "FRAME_RECORDS")):
        scene.slots = slots
        assert check_frame(lib, frame) == "OK" and check_frame(lib, frame, form=Form.CONIC) == fits


def test_two_frames_under_way(lib: ctypes.CDLL, chunk: PackedScene) -> None:
    first, scene = good_frame(lib, chunk)
    second, again = good_frame(lib, chunk)
    for name in ("records", "lists", "pointers"):
        setattr(second.region, name, getattr(second.region, name) + (1 << 36))
    assert check_frame(lib, second, first) == check_frame(lib, first, second) == "OK"  # scene and frame buffer are shared
    for name in ("records", "lists", "pointers"):
        away = getattr(second.region, name)
        setattr(second.region, name, getattr(first.region, name) + 64)
        assert check_frame(lib, second) in ("OK", "FRAME_OVERLAP")
        assert check_frame(lib, second, first) == "FRAME_OVERLAP", name
        setattr(second.region, name, away)
    before = second.region.lists
    second.region.lists = (1 << 39)
    first.frame_buffer = 1 << 39
    assert check_frame(lib, second) == check_frame(lib, first) == "OK"
    assert check_frame(lib, second, first) == check_frame(lib, first, second) == "FRAME_OVERLAP"
    second.region.lists = before


@pytest.mark.parametrize("form", list(PixelFormat), ids=lambda form: form.name)
def test_descriptor(lib: ctypes.CDLL, packed: PackedScene, chip: Chip, form: PixelFormat) -> None:
    """Every register of the descriptor is written, once, and none else; what they hold follows from the model."""
    width, height = 333, 250
    frame, scene = good_frame(lib, packed, width, height, int(form))
    frame.box, frame.by_distance = 7, -1
    assert chip.call("flk_frame_write", ctypes.byref(frame), None) == "OK"
    centred = {REGISTERS[name].offset + 4 * i for name in ("middle", "least") for i in range(2)}  # of a principal point off the middle
    kept = {REGISTERS[name].offset for name in ("store_low", "store_high", "store_beats", "tolerance")}  # of frames that keep colours
    descriptor = {offset for offset in chip.value if offset >= 0x100 and offset not in centred | kept}
    assert {offset for offset, _ in chip.writes} == descriptor and len(chip.writes) == len(descriptor)

    def fields(name: str) -> dict[str, int]:
        return {field: chip.get(name) >> low & ((1 << bits) - 1) for field, (low, bits) in REGISTERS[name].fields.items()}

    assert fields("frame") == {
        "tag": 0xBEEF, "mode": 3, "rgba": int(form is PixelFormat.RGBA16F), "box": 1, "chunked": int(packed.format is PackedFormat.CHUNK), "antialiased": 0,
        "off_centre": 0, "by_distance": 1,
    }
    assert fields("background") == {"red": 10, "green": 20, "blue": 30} and fields("size") == {"width": width, "height": height}
    at = scene.address + HEADER_BYTES
    for name, part in zip(("table", "headers", "geometry", "colours"), packed.sections().values()):
        assert chip.get(f"{name}_low") | chip.get(f"{name}_high") << 32 == at
        at += len(part)
    region = frame.region
    for name, address in (("records", region.records), ("lists", region.lists), ("pointers", region.pointers), ("frame_buffer", frame.frame_buffer)):
        assert chip.get(f"{name}_low") | chip.get(f"{name}_high") << 32 == address
    assert chip.get("clusters") == len(packed.table) and chip.get("record_beats") * 64 == len(packed.geometry) * RecordKind.FACTORED16.bytes
    assert chip.get("chunks") == list_chunks(width, height, 2 * len(packed)) and chip.get("stride") == least_stride(width, form)
    assert chip.get("deadline") == 123_456
    for name, numbers in expected_numbers(camera_of(width, height)).items():
        if name not in ("middle", "least"):
            assert [chip.get(name, i) for i in range(REGISTERS[name].count)] == numbers, name


def test_descriptor_with_all_features(lib: ctypes.CDLL, chunk: PackedScene, chip: Chip) -> None:
    """Of an antialiased scene through a camera whose principal point is off the middle, with kept colours."""
    packed = dataclasses.replace(chunk, antialiased=True)
    frame, scene = good_frame(lib, packed, 333, 250)
    camera = dataclasses.replace(camera_of(333, 250), cx=200.125, cy=-7.75)
    frame.camera = c_camera(camera)
    store = CStore(1 << 38, 1 << 30, 1, 0.5)
    frame.store = ctypes.pointer(store)
    assert scene.antialiased == 1
    assert chip.call("flk_frame_write", ctypes.byref(frame), None) == "OK"
    written = {offset for offset, _ in chip.writes}
    assert written == {offset for offset in chip.value if offset >= 0x100} and len(written) == len(chip.writes)
    flags = [REGISTERS["frame"].fields[name][0] for name in ("antialiased", "off_centre", "by_distance")]
    assert [chip.get("frame") >> bit & 1 for bit in flags] == [1, 1, 0]
    for name, numbers in expected_numbers(camera).items():
        assert [chip.get(name, i) for i in range(REGISTERS[name].count)] == numbers, name
    assert [chip.get("middle", i) for i in range(2)] == [int(200.125 * 128), (1 << 23) - int(7.75 * 128)]


def test_descriptor_is_not_written(lib: ctypes.CDLL, chunk: PackedScene, chip: Chip) -> None:
    """While the chip is busy or dead, with a fault of the frame, of the camera, or of the two frames together."""
    frame, scene = good_frame(lib, chunk)
    other, _scene = good_frame(lib, chunk)
    write = lambda second=None: chip.call("flk_frame_write", ctypes.byref(frame), None if second is None else ctypes.byref(second))  # noqa: E731
    chip.field("status", front_busy=1)
    assert write() == "BUSY"
    chip.field("status", ready=1, dead=1)
    assert write() == "DEAD"
    chip.field("status", ready=1)
    assert write(other) == "FRAME_OVERLAP"
    frame.camera.fx = 0.0
    assert write() == "CAMERA_FOCAL"
    frame.camera.fx = 1.0
    frame.by_distance, chip.device.minor = 1, 1
    assert write() == "FRAME_ORDER"
    frame.by_distance, chip.device.minor, scene.sh_bits = 0, 4, 1
    assert write() == "FRAME_SH_BITS"
    chip.device.minor = 5
    chip.device.lists = 8
    assert write() == "FRAME_LISTS"
    assert not chip.writes


def test_a_chip_without_deadlines(lib: ctypes.CDLL, chunk: PackedScene, chip: Chip) -> None:
    """Of version 3.0: its registers of deadlines are not touched, and a frame with one is refused."""
    frame, scene = good_frame(lib, chunk)
    chip.device.minor = 0
    chip.set("progress", 5)
    assert chip.call("flk_frame_write", ctypes.byref(frame), None) == "FRAME_DEADLINE" and not chip.writes
    frame.deadline = 0
    assert chip.call("flk_frame_write", ctypes.byref(frame), None) == "OK"
    assert REGISTERS["deadline"].offset not in dict(chip.writes) and lib.flk_result(ctypes.byref(chip.device)).pairs == 0


@pytest.mark.parametrize("form", list(PixelFormat))
def test_fill(lib: ctypes.CDLL, chunk: PackedScene, form: PixelFormat) -> None:
    """All that a frame can write, and nothing behind its rows."""
    frame, scene = good_frame(lib, chunk, 40, 20, form)
    frame.stride += 64
    rows, row = 2 * TILE, least_stride(40, form)
    buffer = np.full((rows + 1) * frame.stride, 77, np.uint8)
    lib.flk_frame_fill(ctypes.byref(frame), ctypes.c_void_p(buffer.ctypes.data))
    got = buffer.reshape(rows + 1, frame.stride)
    pixel = [0] if form is PixelFormat.RGBA16F else [10, 20, 30]
    assert np.array_equal(got[:rows, :row], np.tile(pixel, (rows, row // len(pixel))))
    assert (got[:rows, row:] == 77).all() and (got[rows] == 77).all()


def test_a_large_region_of_records(lib: ctypes.CDLL, chunk: PackedScene, chip: Chip) -> None:
    frame, scene = good_frame(lib, chunk)
    frame.region.records, frame.region.record_bytes = 1 << 38, 1 << 36
    assert chip.call("flk_frame_write", ctypes.byref(frame), None) == "OK"
    assert chip.get("record_beats") == (1 << 23) - 1


def test_probe(lib: ctypes.CDLL) -> None:
    chip = Chip(lib)
    chip.field("frames", started=0xFFFF, finished=0xFFFE)
    assert chip.probe() == "OK"
    device = chip.device
    assert (device.minor, device.stage, device.form, device.precision, device.vrus, device.mask_generator, device.lanes) == (7, 1, 1, 2, 2, 3, 32)
    assert device.colour_store == 1
    assert (device.lists, device.beat) == (16384, 64)
    assert (device.cores, device.preproc_lanes, device.list_writers, device.sort_units, device.preproc_interval) == (2, 1, 4, 2, 4)
    assert device.started == 0xFFFF and not chip.writes
    chip.set("version", 3 | 3 << 8)  # of before these
    assert chip.probe() == "OK" and not device.colour_store and device.preproc_interval == 2
    assert (device.cores, device.preproc_lanes, device.list_writers, device.sort_units) == (4, 4, 4, 4)
    chip.set("version", 2)
    assert chip.probe() == "DEVICE_VERSION"
    chip.set("id", 0xFFFFFFFF)
    assert chip.probe() == "DEVICE_ID"


def test_sequence_of_frames(lib: ctypes.CDLL, chip: Chip) -> None:
    """Numbers, regions and ends of frames over the wrap of the counts."""
    control = REGISTERS["control"].offset
    chip.field("frames", started=0xFFFD, finished=0xFFFD)
    assert chip.probe() == "OK"
    number = u16()
    seen = []
    for k in range(6):
        assert lib.flk_next_region(ctypes.byref(chip.device)) == k % 2
        assert chip.call("flk_start", ctypes.byref(number)) == "OK" and chip.writes.pop() == (control, 1)
        seen.append(number.value)
        assert chip.call("flk_poll", number) == "BUSY"
        if k:  # the one before ends now
            chip.field("frames", started=number.value, finished=seen[-2])
            assert chip.call("flk_poll", u16(seen[-2])) == "OK" and chip.call("flk_poll", number) == "BUSY"
    assert seen == [0xFFFE, 0xFFFF, 0, 1, 2, 3]
    chip.field("status", ready=0)
    assert chip.call("flk_start", ctypes.byref(number)) == "BUSY" and number.value == 3 and not chip.writes
    assert lib.flk_next_region(ctypes.byref(chip.device)) == 0
    assert chip.call("flk_ready") == "BUSY"
    chip.field("status", ready=1, dead=1)
    assert chip.call("flk_ready") == chip.call("flk_start", None) == chip.call("flk_poll", number) == "DEAD" and not chip.writes
    chip.field("frames", started=3, finished=3)  # as the time-out leaves them: the frames that it forgets count as finished
    assert chip.call("flk_poll", number) == chip.call("flk_wait", number, u32(0), None, None) == "DEAD"
    chip.field("interrupt", frame_done=1)  # it ended before, and waits for its release
    assert chip.call("flk_poll", number) == chip.call("flk_wait", number, u32(0), None, None) == "OK" and chip.call("flk_poll", u16(4)) == "DEAD"
    chip.set("interrupt", 0)
    for count, other, status in ((1, 0xFFFF, "OK"), (0xFFFF, 1, "BUSY"), (0, 0x8000, "BUSY"), (0x8001, 0, "BUSY"), (0x7FFF, 0, "OK")):
        chip.field("frames", finished=count)
        chip.field("status", ready=1)
        assert chip.call("flk_poll", u16(other)) == status, (count, other)
    lib.flk_reset(ctypes.byref(chip.device))
    assert chip.writes.pop() == (control, 4) and chip.device.started == 0 and chip.device.region == 0
    chip.field("status", ready=1)
    assert chip.call("flk_start", None) == "OK" and chip.device.started == 1


def test_wait(lib: ctypes.CDLL, chip: Chip) -> None:
    number = u16()
    assert chip.call("flk_start", ctypes.byref(number)) == "OK"
    chip.reads.clear()
    frames = REGISTERS["frames"].offset
    assert chip.call("flk_wait", number, u32(7), None, None) == "WAITED" and chip.reads.count(frames) == 7
    turns = []

    @PAUSE
    def pause(user: int) -> int:
        assert user == 0x77
        turns.append(1)
        if len(turns) == 5:
            chip.field("frames", started=1, finished=1)
        return 0

    assert chip.call("flk_wait", number, u32(0), pause, ctypes.c_void_p(0x77)) == "OK" and len(turns) == 5
    chip.field("frames", started=1, finished=0)
    turns.clear()
    give_up = PAUSE(lambda user: turns.append(1) or len(turns) == 3)
    assert chip.call("flk_wait", number, u32(100), give_up, None) == "WAITED" and len(turns) == 3
    chip.field("status", dead=1)
    assert chip.call("flk_wait", number, u32(0), None, None) == "DEAD"


def test_the_rest(lib: ctypes.CDLL, chip: Chip) -> None:
    """Result, counters, interrupts, abort, time-out."""
    device = ctypes.byref(chip.device)
    chip.field("result", tag=0xBEEF, error=1 << ResultError.LIST_MEMORY | 1 << ResultError.TIMED_OUT)
    result = lib.flk_result(device)
    chip.set("progress", 0xABCD)
    assert lib.flk_result(device).pairs == 0xABCD
    assert result.tag == 0xBEEF and [k for k in range(16) if result.error >> k & 1] == [ResultError.LIST_MEMORY, ResultError.TIMED_OUT]
    assert lib.flk_error_text(int(ResultError.LIST_MEMORY)) == b"out of list memory"
    chip.set("counter_value", 0xFEDCBA98)
    assert lib.flk_counter(device, u32(777)) == 0xFEDCBA98
    lib.flk_interrupt_enable(device, u32(0b10110))
    chip.set("interrupt", 0b00101)
    assert lib.flk_interrupt_pending(device) == 0b00101
    lib.flk_interrupt_acknowledge(device, u32(0b00100))
    lib.flk_release(device)
    lib.flk_abort(device)
    lib.flk_set_timeout(device, u32(12345))
    released = 1 << REGISTERS["interrupt"].fields["frame_done"][0]  # an error may have come since: it stays
    assert chip.writes == [(REGISTERS[name].offset, value) for name, value in (
        ("counter_select", 777), ("interrupt_enable", 0b10110), ("interrupt", 0b00100), ("interrupt", released), ("control", 2), ("timeout", 12345),
    )]
