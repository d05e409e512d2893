"""Records to splats: flk_record_to_splat against the scalar golden model, and that against what the golden stage takes of whole frames.

State space: every code of shape, opacity and colour, every exponent of a mean; means beside ties and limits, sub-tiles of the whole coordinate; all patterns
of idling and back-pressure, clear_i. Parameter space: the factored form, with SLOW=1 the conic one. Not covered:
NaN and infinity in a record of 32 bytes against the golden frame (they pass as they are).
"""

from __future__ import annotations

import random

import numpy as np
import pytest
import record_samples
from flicker_tb.runner import build_and_test, seed

from flicker.front.view import DEMO, load_view
from flicker.golden.front.frame import run_front
from flicker.golden.front.record import RecordKind, decode_records, decode_shape, fp16_features, fp16_means
from flicker.golden.front.to_splat import ToSplat, colour_to_fp16, opacity_to_fp16, record_to_splat, shape_to_fp16
from flicker.params import SUBTILE_COORD_BITS, Form
from flicker.scene.packing import pack

COLS = 1 << SUBTILE_COORD_BITS


@pytest.mark.parametrize("form", [pytest.param(form, marks=[pytest.mark.slow] * (form is Form.CONIC)) for form in Form])
def test_record_to_splat(form: Form) -> None:
    build_and_test("flk_record_to_splat", "cocotb_record_to_splat", parameters={"Form": int(form)}, config={"Form": int(form)})


def test_codes() -> None:
    """Every code of a shape, an opacity and a colour against NumPy's conversion of what the code means."""
    codes = np.arange(1 << 14)
    shapes = decode_shape(codes)
    for negative in (False, True):
        want = (np.where(negative, -1.0, 1.0) * shapes).astype(np.float16).view(np.uint16)
        assert [shape_to_fp16(c, negative) for c in codes.tolist()] == want.tolist()
    assert [opacity_to_fp16(c) for c in range(256)] == (np.arange(256) / 255.0).astype(np.float16).view(np.uint16).tolist()
    assert [colour_to_fp16(c) for c in range(1024)] == (np.arange(1024) / 512.0).astype(np.float16).view(np.uint16).tolist()


def features(s: ToSplat) -> list[int]:
    """In the order of `feature_t`."""
    return [s.x.fp16, s.y.fp16, *s.shape, s.opacity, s.blue, s.green, s.red]


@pytest.mark.parametrize("kind", RecordKind)
def test_made_up_records(kind: RecordKind) -> None:
    """Against `decode_records`, `fp16_features`, `fp16_means`, for records of every kind."""
    items = record_samples.records(random.Random(seed()), kind, 5000)
    finite = [item for item in items if kind is RecordKind.FACTORED16 or all(item[1] >> 64 + 16 * k & 0x7C00 != 0x7C00 for k in range(7))]
    records = np.frombuffer(b"".join(item[1].to_bytes(kind.bytes, "little") for item in finite), np.uint8).reshape(-1, kind.bytes)
    splats = decode_records(records, kind)
    want, saturated = fp16_features(splats), 0
    for i, (_, record, subtile) in enumerate(finite):
        found = record_to_splat(record, kind, subtile % COLS, subtile // COLS)
        mean = [int(fp16_means_of(splats.mean[i, axis], place)) for axis, place in enumerate((subtile % COLS, subtile // COLS))]
        assert features(found) == [*mean, *want[i, 2:].tolist()] and found.spiky == splats.spiky[i], hex(record)
        saturated += found.x.fp16 & 0x7FFF == 0x7BFF
    assert len(finite) > 3000 and saturated > 100


def fp16_means_of(mean: int, place: int) -> np.uint16:
    """`fp16_means` along one axis."""
    with np.errstate(over="ignore"):
        return np.clip(((mean - place * 1024) / 128).astype(np.float16), -np.float16(65504), np.float16(65504)).view(np.uint16)


@pytest.mark.parametrize("kind", RecordKind)
def test_frame(kind: RecordKind) -> None:
    """Entries of a frame: the splats that the golden rendering stage takes."""
    view = load_view(DEMO, 0, (160, 90))
    frame = run_front(pack(view.scene).packed, view.camera, kind=kind)
    lists = frame.subtile_lists()
    start, entry = frame.sorted_subtiles()
    assert np.array_equal(fp16_means(frame.splats(), start, entry, lists.cols), lists.mean)
    subtile = np.searchsorted(lists.start, np.arange(len(lists.entry)), side="right") - 1
    for e in range(0, len(lists.entry), 7):
        record = int.from_bytes(frame.records[lists.entry[e]].tobytes(), "little")
        found = record_to_splat(record, kind, int(subtile[e]) % lists.cols, int(subtile[e]) // lists.cols)
        assert features(found) == lists.features(e).tolist() and found.spiky == lists.spiky[lists.entry[e]]
    assert len(lists.entry) > 5000
