"""The chip's picture: what `flk_rendering` makes of records and lists, to the byte of the frame buffer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..front.records import SubtileLists
from ..params import RenderConfig
from .frame_buffer import PixelFormat, frame_buffer, least_stride
from .lanes.lists import RecordLists
from .lanes.render import LaneFrame, render_lanes
from .render import Frame, render_golden
from .walk import tile_walk

Lists = TypeVar("Lists", SubtileLists, RecordLists)


def whole_pairs(lists: Lists) -> Lists:
    """The same with empty sub-tiles up to whole pairs of tiles, which the chip renders too; the automatic mode sees them."""
    cols, rows = -(-lists.cols // 4) * 4, -(-lists.rows // 2) * 2
    length = np.zeros((rows, cols), np.int64)
    length[: lists.rows, : lists.cols] = np.diff(lists.start).reshape(lists.rows, lists.cols)
    return replace(lists, start=np.concatenate([[0], np.cumsum(length)]), cols=cols, rows=rows)


def chip_walk(lists: Lists) -> tuple[np.ndarray, np.ndarray]:
    """`tile_walk` of lists in whole pairs."""
    return tile_walk(lists.cols // 4, lists.rows // 2)


@dataclass(eq=False)
class ChipFrame:
    """frame: of the padded grid of sub-tiles. buffer: uint8 (rows of pixels, stride)."""

    frame: Frame | LaneFrame
    buffer: np.ndarray


def render_chip(
    lists: SubtileLists | RecordLists, config: RenderConfig, format_: PixelFormat = PixelFormat.RGB8, background: tuple[int, int, int] = (0, 0, 0),
    stride: int | None = None,
) -> ChipFrame:
    """A frame, bit for bit; records of 16 bytes go to the lanes. stride: bytes from row to row; None: as few as a row needs."""
    frame: Frame | LaneFrame
    if isinstance(lists, RecordLists):
        frame = render_lanes(whole_pairs(lists))
    else:
        whole = whole_pairs(lists)
        frame = render_golden(whole, config, chip_walk(whole))
    stride = stride or least_stride(lists.width, format_)
    buffer = frame_buffer(frame.pixels, frame.lists.cols, frame.lists.rows, lists.width, lists.height, format_, stride, background)
    return ChipFrame(frame, buffer)
