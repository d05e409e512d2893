"""What the firmware finds in RAM, and the pictures that it should make of it."""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from flicker.golden.chip import render_chip
from flicker.golden.front.frame import ListKind, run_front
from flicker.golden.front.record import RecordKind
from flicker.golden.lanes.lists import front_lists
from flicker.params import RenderConfig
from flicker.scene.camera import Camera
from flicker.scene.packed import PackedScene
from flicker.sim.driver import CCamera

BLOCK = 1 << 16  # the firmware looks at every so many bytes (BLOCK of firmware.h)


def path_block(cameras: Sequence[Camera]) -> bytes:
    """A path of cameras: magic, count, flk_camera_t each."""
    data = struct.pack("<8sII", b"FLKPATH\0", len(cameras), 0) + b"".join(bytes(CCamera.of(camera)) for camera in cameras)
    assert len(data) <= BLOCK
    return data


def golden_picture(packed: PackedScene, camera: Camera, config: RenderConfig) -> np.ndarray:
    """uint8 (H, 3 W): the rows of the picture that the chip makes, bit for bit."""
    front = run_front(packed, camera, ListKind.ELLIPSE, RecordKind.of(config.form))
    frame = render_chip(front_lists(front) if config.by_lanes else front.subtile_lists(), config)
    return frame.buffer[: camera.height, : 3 * camera.width]


def word_sum(picture: np.ndarray) -> int:
    """The firmware's sum of a picture: 32-bit words of each row, the last one filled with zeros, modulo 2^32."""
    height, width = picture.shape
    padded = np.zeros((height, -(-width // 4) * 4), np.uint8)
    padded[:, :width] = picture
    return int(padded.reshape(height, -1).view("<u4").sum(dtype=np.uint64)) & 0xFFFFFFFF
