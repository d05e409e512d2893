"""The C driver (sw/flk.c) through ctypes, compiled with the machine's compiler (docs/guide/programming.md)."""

from __future__ import annotations

import ctypes
import functools

from ..chip_registers import REGISTERS
from ..scene.camera import Camera
from ..toolchain import ROOT, compile_library

SW = ROOT / "sw"
FLAGS = ("-O2", "-pedantic", "-Wconversion", "-Wno-sign-conversion", "-Werror", "-ffp-contract=off", "-lm")

u8, u16, u32, u64, double = ctypes.c_uint8, ctypes.c_uint16, ctypes.c_uint32, ctypes.c_uint64, ctypes.c_double
READ = ctypes.CFUNCTYPE(u32, ctypes.c_void_p, u32)
WRITE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, u32, u32)
PAUSE = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)


class CScene(ctypes.Structure):
    _fields_ = [
        ("address", u64), ("bytes", u64), ("format", u32), ("degree", u32), ("gaussians", u32), ("clusters", u32), ("slots", u32), ("part", u64 * 4),
        ("low", ctypes.c_float * 3), ("high", ctypes.c_float * 3), ("sigma", ctypes.c_float),
        ("antialiased", ctypes.c_int), ("sh_bits", ctypes.c_int),
    ]


class CCamera(ctypes.Structure):
    _fields_ = [
        ("rotation", double * 9), ("position", double * 3), ("fx", double), ("fy", double), ("width", u32), ("height", u32),
        ("off_x", double), ("off_y", double),
    ]

    @classmethod
    def of(cls, camera: Camera) -> CCamera:
        return cls(
            (double * 9)(*camera.rotation.ravel()), (double * 3)(*camera.position), camera.fx, camera.fy, camera.width, camera.height,
            camera.cx - 0.5 * (camera.width - 1), camera.cy - 0.5 * (camera.height - 1),
        )


NUMBERS = ("position", "normal", "offset", "reach", "view", "focal", "row_x", "row_x_z", "row_y", "row_y_z", "least", "limit", "middle")


class CCameraRegisters(ctypes.Structure):
    _fields_ = [*((name, u32 * REGISTERS[name].count) for name in NUMBERS), ("off_centre", ctypes.c_int)]


class CRegion(ctypes.Structure):
    _fields_ = [("records", u64), ("record_bytes", u64), ("lists", u64), ("chunks", u32), ("pointers", u64)]


class CStore(ctypes.Structure):
    _fields_ = [("address", u64), ("bytes", u64), ("generation", u32), ("tolerance", double)]


class CFrame(ctypes.Structure):
    _fields_ = [
        ("scene", ctypes.POINTER(CScene)), ("camera", CCamera), ("region", CRegion), ("frame_buffer", u64), ("stride", u32), ("pixel_format", ctypes.c_uint),
        ("background", u8 * 3), ("mode", ctypes.c_uint), ("box", ctypes.c_int), ("tag", u16), ("deadline", u32), ("by_distance", ctypes.c_int),
        ("store", ctypes.POINTER(CStore)),
    ]


class CBus(ctypes.Structure):
    _fields_ = [("read", READ), ("write", WRITE), ("user", ctypes.c_void_p)]


class CDevice(ctypes.Structure):
    _fields_ = [
        ("bus", CBus), ("minor", u32), ("stage", u32), ("form", u32), ("precision", u32), ("vrus", u32), ("mask_generator", u32), ("lanes", u32),
        ("lists", u32), ("beat", u32),
        ("cores", u32), ("preproc_lanes", u32), ("list_writers", u32), ("sort_units", u32), ("preproc_interval", u32),
        ("colour_store", ctypes.c_int), ("started", u16), ("region", ctypes.c_uint),
    ]


class CResult(ctypes.Structure):
    _fields_ = [("tag", u16), ("error", u16), ("pairs", u16)]


def statuses() -> list[str]:
    """Names of flk_status_t in order, without FLK_."""
    body = (SW / "flk.h").read_text().split("typedef enum {")[1].split("} flk_status_t")[0]
    lines = [line.strip() for line in body.splitlines()]
    return [line.split("=")[0].split(",")[0].strip().removeprefix("FLK_") for line in lines if line.startswith("FLK_")]


@functools.cache
def library() -> ctypes.CDLL:
    """The driver's functions, with types where ctypes has to know them."""
    lib = ctypes.CDLL(str(compile_library(
        "flk", [SW / "flk.c"], depends=[SW / "flk.h", SW / "flk_registers.h"], flags=FLAGS, language="c", standard="c99",
    )))
    for name in ("flk_status_text", "flk_error_text"):
        getattr(lib, name).restype = ctypes.c_char_p
    for name in ("flk_record_bytes", "flk_list_bytes", "flk_pointer_bytes", "flk_frame_bytes", "flk_store_bytes"):
        getattr(lib, name).restype = u64
    for name in ("flk_ff_bits", "flk_list_chunks", "flk_least_stride", "flk_counter", "flk_interrupt_pending"):
        getattr(lib, name).restype = u32
    lib.flk_scene_open.argtypes = [ctypes.POINTER(CScene), ctypes.c_void_p, ctypes.c_size_t, u64, ctypes.c_uint]
    lib.flk_ff_bits.argtypes = [double, ctypes.c_uint]
    lib.flk_record_bytes.argtypes = [ctypes.POINTER(CScene), u32]
    lib.flk_list_chunks.argtypes = [u32, u32, u64]
    lib.flk_pointer_bytes.argtypes = [u32, u32]
    lib.flk_frame_bytes.argtypes = [u32, u32]
    lib.flk_list_bytes.argtypes = [u32]
    lib.flk_result.restype = CResult
    return lib
