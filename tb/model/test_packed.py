"""The memory image: what its bits mean, what packing may change, which images are refused.

A second decoder, written from docs/reference/memory_image.md with `struct`, one Gaussian at a time, says what an image means; the reader is held against
it. Real scenes (FLICKER_SCENES) show how much of the picture packing costs.
"""

from __future__ import annotations

import math
import re
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.command import flicker
from flicker_tb.real import real_views
from flicker_tb.runner import seed
from scene_samples import random_scene

from flicker.errors import FlickerError
from flicker.fit.parameters import Parameters
from flicker.front.view import View, load_view
from flicker.scene import packing
from flicker.scene.clusters import build_clusters, cut_clusters, morton_order, reorder
from flicker.scene.files import Scene, half_turn, load_scene, save_ply
from flicker.scene.memory import MemoryFormat, decode_chunks, encode_chunks, load_chunks, rotation_of, save_chunks, through_memory
from flicker.scene.metrics import psnr
from flicker.scene.packed import (
    SH_BITS,
    PackedFormat,
    PackedScene,
    bounds,
    chunk_codes,
    decode,
    fp16_bits,
    load_packed,
    parse,
    too_long,
    upper_half,
    values,
)
from flicker.scene.packing import Packing, Recipe, ShSteps, pack, pack_chunks, pack_file
from flicker.scene.real import real_scenes
from flicker.view.frames import largest

FORMATS = list(PackedFormat)


def mixed_scene(count: int = 1500, degree: int = 3) -> Scene:
    """A random scene in Morton order whose higher coefficients fade out: clusters of every degree up to `degree`."""
    scene = random_scene(seed(), count, degree)
    scene = reorder(scene, morton_order(scene.means))
    for d in range(degree, 0, -1):
        scene.sh[count * (4 - d) // 4 :, d * d :] = 0
    return scene


# ---- the second decoder --------------------------------------------------------------------------------------------------------------


def fields(word: int, *widths: int) -> list[int]:
    """Bit fields of a 32-bit word, uppermost first."""
    text, found = f"{word:032b}", []
    for width in widths:
        found.append(int(text[:width], 2))
        text = text[width:]
    return found


def read_image(data: bytes) -> list[dict]:
    """Every Gaussian of an image: slot, mean, scale, quat, opacity, sh; box and sigma of its cluster."""
    magic, version, form, degree, gaussians, clusters, slots, beats = struct.unpack_from("<8sHHIIIII", data, 0)
    assert magic == b"FLKSCENE" and version in (1, 2) and beats * 64 == len(data) and zlib.crc32(data[:252]) == struct.unpack_from("<I", data, 252)[0]
    places = {}
    for k, name in enumerate(("table", "headers", "geometry", "colour")):
        offset, size, crc = struct.unpack_from("<III", data, 32 + 12 * k)
        places[name] = offset * 64
        assert zlib.crc32(data[offset * 64 : (offset + size) * 64]) == crc
    found = []
    for cluster in range(clusters):
        *box, sigma, last, flags, first = struct.unpack_from("<6fHBBI", data, places["table"] + 32 * cluster)
        own = flags & 3
        k = (own + 1) ** 2
        assert own <= degree and (form == 0 or flags >> 2 == 0)
        header = places["headers"] + (128 if form == 0 else 64) * cluster
        colours = places["colour"] + 64 * struct.unpack_from("<I", data, header + 12)[0]
        floats = np.frombuffer(data, "<f4", 32 if form == 0 else 16, header).astype(np.float64)
        for rank in range(last + 1):
            slot = 16 * first + rank
            if form == 0:
                position, rotation, scale = struct.unpack_from("<III", data, places["geometry"] + 12 * slot)
                zero = struct.unpack_from("<I", data, header + 28)[0]
                bits = {8: 3, 16: 4, 32: 5, 64: 6}[zero] if version == 2 and zero < 255 else 8
                stride = 4 + math.ceil(3 * (k - 1) * bits / 8)
                stride += -stride % 4 if bits == 8 else 0
                at = colours + stride * rank
                r, g, b, a = fields(struct.unpack_from("<I", data, at)[0], 8, 8, 8, 8)
                largest, *three = fields(rotation, 2, 10, 10, 10)
                three = [(code / 1023 - 0.5) * math.sqrt(2) for code in three]
                three.insert(largest, math.sqrt(1 - sum(x * x for x in three)))
                rest = int.from_bytes(data[at + 4 : at + stride], "little")
                sh = [[(low + step * code - 0.5) * 2 * math.sqrt(math.pi) for low, step, code in zip(floats[16:19], floats[20:23], (r, g, b))]]
                for n in range(1, k):
                    codes = [rest >> bits * (3 * (n - 1) + channel) & (1 << bits) - 1 for channel in range(3)]
                    steps = floats[23 + 3 * (math.isqrt(n) - 1) :][:3]
                    sh.append([(2 * code - zero) * step for code, step in zip(codes, steps)])
                found.append({
                    "means": [low + step * code for low, step, code in zip(floats[0:3], floats[4:7], fields(position, 11, 10, 11))],
                    "scales": [2.0 ** (low + step * code) for low, step, code in zip(floats[8:11], floats[12:15], fields(scale, 11, 10, 11))],
                    "quats": three, "opacities": a / 255,
                })
            else:
                numbers = struct.unpack_from("<10e", data, places["geometry"] + 20 * slot)
                stride = -(-2 * (1 + 3 * k) // 4) * 4
                opacity, *flat = struct.unpack_from(f"<{1 + 3 * k}e", data, colours + stride * rank)
                sh = np.reshape(flat, (k, 3)).tolist()
                mean = [x + o for x, o in zip(numbers, floats[:3])]
                found.append({"means": mean, "scales": list(numbers[3:6]), "quats": list(numbers[6:]), "opacities": opacity})
            sh += [[0.0] * 3] * ((degree + 1) ** 2 - k)
            found[-1] |= {"sh": sh, "slot": slot, "box": box, "sigma": struct.unpack("<f", struct.pack("<I", sigma << 16))[0]}
    assert len(found) == gaussians and slots >= found[-1]["slot"] + 1
    return found


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("form", FORMATS)
def test_image_means_what_the_page_says(form: PackedFormat, degree: int) -> None:
    """Every value of every Gaussian, bounds, slots; the image is made again bit for bit."""
    packed = pack(mixed_scene(degree=degree), form).packed
    image = packed.image()
    wanted = read_image(image)
    loaded = parse(image, Path("a.flk"))
    assert loaded.image() == image
    for scene in (packed, loaded):
        got = values(scene)
        for name in ("means", "scales", "quats", "opacities", "sh"):
            theirs = np.array([g[name] for g in wanted])
            assert getattr(got, name).shape == theirs.shape
            assert np.allclose(getattr(got, name), theirs, rtol=1e-12, atol=1e-12), name
        assert scene.slot.tolist() == [g["slot"] for g in wanted]
    for g in wanted:
        assert all(low <= x <= high for low, x, high in zip(g["box"][:3], g["means"], g["box"][3:])) and max(g["scales"]) <= g["sigma"]
    assert set(packed.degrees.tolist()) == set(range(degree + 1))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_sh_codes_of_fewer_bits(degree: int) -> None:
    """Clusters of each number of bits: values as the page says, within half a step of the scene's; no more bytes than the codes take."""
    scene = random_scene(seed(), 256 * 2 * len(SH_BITS), degree)
    result = pack(scene, recipe=Recipe(cuts=0, sh_bits=lambda scene, start: np.resize(SH_BITS, len(start))))
    image = result.packed.image()
    loaded = parse(image, Path("a.flk"))
    assert loaded.image() == image and loaded.sh_bits.tolist() == ([*SH_BITS, *SH_BITS] if degree else [8] * 2 * len(SH_BITS))
    wanted, got = np.array([g["sh"] for g in read_image(image)]), values(loaded).sh
    assert np.allclose(got, wanted, rtol=1e-12, atol=1e-12)
    bits = loaded.sh_bits[loaded.cluster]
    source = reorder(scene, result.order).sh
    for k in range(1, wanted.shape[1]):
        largest = np.maximum.reduceat(np.abs(source[:, k]), loaded.start[:-1])[loaded.cluster]
        half = loaded.headers["sh_step"][loaded.cluster, math.isqrt(k) - 1] * 1.001
        assert (np.abs(got[:, k] - source[:, k]) <= half).all() and (largest <= half * (2.0**bits - 2)[:, None]).all()
    size = [64 * math.ceil(256 * (4 + math.ceil(3 * ((degree + 1) ** 2 - 1) * b / 8)) / 64) for b in SH_BITS if b < 8]
    assert len(loaded.colour) == 2 * (sum(size) + 256 * PackedFormat.CHUNK.colour_stride(degree))
    one = pack(scene, recipe=Recipe(sh_bits=SH_BITS[0])).packed
    assert (one.sh_bits == (SH_BITS[0] if degree else 8)).all() and parse(one.image(), Path("a.flk")).image()[8] == (2 if degree else 1)


def test_image_of_version_1() -> None:
    """Where all codes have 8 bits the image is of version 1; narrower ones under its number are refused."""
    assert pack(mixed_scene()).packed.image()[8] == 1
    narrow = pack(mixed_scene(), recipe=Recipe(sh_bits=4)).packed.image()
    with pytest.raises(FlickerError, match="cluster 0: sh_zero: none of 255, 256"):
        parse(sealed(at(8, "<H", 1)(narrow)), Path("a"))
    for wrong in (2, 7, 9):
        with pytest.raises(FlickerError, match=f"SH bits: {wrong}, not 3, 4, 5, 6 or 8"):
            pack(mixed_scene(), recipe=Recipe(sh_bits=wrong))
    with pytest.raises(FlickerError, match="SH bits: 4"):
        pack(mixed_scene(), recipe=Recipe(sh=ShSteps.PLAYCANVAS, sh_bits=4))


# ---- what packing may change ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", FORMATS)
def test_alignment(form: PackedFormat) -> None:
    packed = pack(mixed_scene(), form).packed
    assert packed.counts.max() <= 256 and (packed.first % 16 == 0).all() and len(packed.geometry) % 16 == 0
    assert (np.diff(packed.first) == -(-packed.counts[:-1] // 16) * 16).all() and (np.diff(packed.slot) > 0).all()
    unused = np.setdiff1d(np.arange(len(packed.geometry)), packed.slot)
    assert not packed.geometry[unused].any() and len(unused) == len(packed.geometry) - len(packed)
    spans = [packed.colour_span(k) for k in range(len(packed.table))]
    assert all(first % 64 == 0 and stride % 4 == 0 for first, _, stride in spans)
    assert all(0 <= b[0] - a[1] < 64 for a, b in zip(spans, spans[1:]))
    assert len(packed.image()) % 64 == 0 and len(packed.geometry) * (12 if form is PackedFormat.CHUNK else 20) % 64 == 0


@pytest.mark.parametrize("form", FORMATS)
def test_bounds_hold_and_are_tight(form: PackedFormat) -> None:
    packed = pack(mixed_scene(), form).packed
    v = values(packed)
    for k in range(len(packed.table)):
        of = slice(packed.start[k], packed.start[k + 1])
        low, high = packed.table["low"][k].astype(np.float64), packed.table["high"][k].astype(np.float64)
        assert (low <= v.means[of].min(axis=0)).all() and (v.means[of].max(axis=0) <= high).all()
        assert np.allclose(low, v.means[of].min(axis=0), rtol=2e-7) and np.allclose(high, v.means[of].max(axis=0), rtol=2e-7)
        assert v.scales[of].max() <= packed.sigma[k] <= v.scales[of].max() * (1 + 2**-7)
        assert (decode(packed).means[of] >= packed.table["low"][k]).all()


def test_upper_half_rounds_up() -> None:
    """On exact numbers, just above them, and where the exponent changes."""
    for exact in (1.0, 0.0078125, 3.0, 255.0):
        bits = struct.unpack("<I", struct.pack("<f", exact))[0] >> 16
        assert upper_half(np.array([exact])) == bits and upper_half(np.array([np.nextafter(exact, 9e9)])) == bits + 1
        assert upper_half(np.array([np.nextafter(exact, 0)])) == bits
    with np.errstate(over="ignore"):
        assert upper_half(np.array([1e39])) >= 0x7F80


def test_chunks_round_to_the_nearest_code() -> None:
    scene = mixed_scene()
    result = pack(scene)
    packed, source = result.packed, reorder(scene, result.order)
    v, headers, cluster = values(packed), packed.headers, packed.cluster
    assert (np.abs(v.means - source.means) <= headers["position_step"][cluster] * 0.500001 + 1e-7).all()
    assert (np.abs(np.log2(v.scales) - np.log2(source.scales.astype(np.float64))) <= headers["scale_step"][cluster] * 0.500001 + 1e-5).all()
    assert np.abs(v.opacities - source.opacities).max() <= 0.5 / 255 + 1e-7
    assert (np.abs(v.sh[:, 0] - source.sh[:, 0]) <= headers["dc_step"][cluster] * 0.500001 / 0.28209479 + 1e-6).all()
    for d in (1, 2, 3):
        of = slice(d * d, (d + 1) ** 2)
        assert (np.abs(v.sh[:, of] - source.sh[:, of]) <= headers["sh_step"][:, d - 1][cluster, None] * 1.000001).all()  # steps are of half codes
        assert (v.sh[:, of][source.sh[:, of] == 0] == 0).all()
    assert np.abs((v.quats * source.quats).sum(axis=1)).min() > 1 - 3e-6
    assert np.allclose(np.linalg.norm(v.quats, axis=1), 1, atol=1e-12)
    codes = chunk_codes(packed)
    assert codes.position.max(axis=0).tolist() == [2047, 1023, 2047] and codes.dc.max() == 255 and np.abs(codes.sh).max() == 254


def test_fp16_is_rounded_once() -> None:
    scene = mixed_scene()
    scene.means[:] += 100  # far from the origin, where FP16 is coarse
    plain, local = (pack(scene, form) for form in (PackedFormat.FP16, PackedFormat.FP16_LOCAL))
    source = reorder(scene, plain.order)
    bits = fp16_bits(plain.packed)
    for name, array in (("mean", source.means), ("scale", source.scales), ("quat", source.quats), ("opacity", source.opacities), ("sh", source.sh)):
        assert np.array_equal(getattr(bits, name).view(np.float16), array.astype(np.float16)), name
    error = [np.abs(values(r.packed).means - source.means).max() for r in (plain, local)]
    assert error[0] > 0.02 and error[1] < 0.001 and not plain.packed.headers["origin"].any()


@pytest.mark.parametrize("form", FORMATS)
def test_no_more_coefficients_than_the_cluster_needs(form: PackedFormat) -> None:
    """A single coefficient keeps its degree in its cluster; without any there are none."""
    scene = random_scene(seed(), 700, 3)
    scene = reorder(scene, morton_order(scene.means))
    scene.sh[:, 1:] = 0
    scene.sh[300, 5, 2] = 1e-3
    result = pack(scene, form, Recipe(cuts=0))
    assert result.packed.degrees.tolist() == [0, 2, 0] and values(result.packed).sh.shape == (700, 9, 3)
    first, last, _ = zip(*(result.packed.colour_span(k) for k in range(3)))
    small, large = (4, 28) if form is PackedFormat.CHUNK else (8, 56)
    assert [b - a for a, b in zip(first, last)] == [256 * small, 256 * large, 188 * small]
    assert np.count_nonzero(values(result.packed).sh[:, 1:]) == 1 and np.isclose(values(result.packed).sh[300, 5, 2], 1e-3, rtol=1e-3)


def test_what_is_left_out_and_changed() -> None:
    scene = mixed_scene(600, 1)
    scene.opacities[[3, 5]] = np.nextafter(np.float32(1 / 255), np.float32(0)), 1e-5
    scene.opacities[7] = np.float32(1 / 255)  # just visible
    scene.scales[10] = 2.0**-40, 1, 1
    for form, reason in ((PackedFormat.CHUNK, "log2 of a scale beyond -30 to 30"), (PackedFormat.FP16, "scale below FP16")):
        result = pack(scene, form)
        assert result.left_out == {"opacity below 1/255": 2} and result.clamped == {reason: 1}
        assert sorted(result.order.tolist()) == sorted(set(range(600)) - {3, 5}) and len(result.packed) == 598
        assert (values(result.packed).opacities > 0).all() and (values(result.packed).scales > 0).all()
    scene.means[20, 1] = 1e6
    assert pack(scene, PackedFormat.FP16).clamped == {"mean beyond FP16": 1, "scale below FP16": 1}
    assert pack(scene).packed.table["high"].max() >= 1e6
    scene.opacities[:] = 1e-3
    with pytest.raises(FlickerError, match="every opacity is below 1/255"):
        pack(scene)


def test_one_gaussian() -> None:
    scene = random_scene(seed(), 1, 2)
    for form in FORMATS:
        packed = parse(pack(scene, form).packed.image(), Path("a"))
        assert len(packed) == 1 and len(packed.geometry) == 16
        assert np.allclose(values(packed).means, scene.means, atol=1e-3) and np.allclose(values(packed).sh, scene.sh, atol=5e-3)


def test_cuts_make_steps_finer_and_stay_within_their_bytes() -> None:
    """Two blobs far apart: the cluster across the gap is cut there."""
    scene = random_scene(seed(), 1000, 0)
    scene.means[:700] += 10
    sizes, steps = [], []
    for cuts in (0.0, 0.03, 0.2):
        packed = pack(scene, recipe=Recipe(cuts=cuts)).packed
        sizes.append(len(packed.image()))
        steps.append(packed.headers["position_step"].max(axis=1)[packed.cluster])
        assert packed.counts.max() <= 256 and packed.counts.min() >= 1
    coarse = [(step > 0.004).sum() for step in steps]
    assert coarse[0] == 256 and coarse[1] < 64 and coarse[2] == 0 and steps[2].max() < 0.002
    assert sizes[0] < sizes[1] <= sizes[0] + 0.03 * 16 * 1000 + 64 * 4 and sizes[2] <= sizes[0] + 0.2 * 16 * 1000 + 64 * 4


def test_cuts_spend_no_more_than_is_there() -> None:
    means = np.random.default_rng(seed()).normal(size=(2000, 3))
    means = means[morton_order(means)]
    start = np.arange(0, 2000, 256)
    for spare in (0, 191, 192, 5000):
        found = cut_clusters(means, start, spare, (2047, 1023, 2047), 192, 12, 16)
        counts = np.diff(np.append(found, 2000))
        lost = (-(-counts // 16) * 16).sum() - 2000
        assert (len(found) - len(start)) * 192 + 12 * (lost - 0) <= spare and set(start) <= set(found.tolist())
    same = np.zeros((600, 3))
    assert cut_clusters(same, np.array([0, 256, 512]), 10**6, (2047, 1023, 2047), 192, 12, 16).tolist() == [0, 256, 512]


@pytest.mark.parametrize("steps", list(ShSteps))
def test_steps_of_sh_codes(steps: ShSteps) -> None:
    """Coarser sharing, larger steps; PlayCanvas' codes have no zero."""
    scene = mixed_scene()
    result = pack(scene, recipe=Recipe(sh=steps))
    source = reorder(scene, result.order)
    error = np.abs(values(result.packed).sh - source.sh)[:, 1:]
    finest = np.abs(values(pack(scene).packed).sh - source.sh)[:, 1:]
    assert (error**2).sum() >= (finest**2).sum()
    assert parse(result.packed.image(), Path("a")).headers["sh_zero"].tolist() == [255 if steps is ShSteps.PLAYCANVAS else 256] * len(result.packed.table)
    assert (error.min() == 1 / 64) if steps is ShSteps.PLAYCANVAS and not scene.sh[:, 1:].any() else error.max() < 1 / 31


# ---- scenes that come in chunks ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_chunks_are_kept(degree: int, tmp_path: Path) -> None:
    """Order, codes and values of a compressed PLY, through its file."""
    data = encode_chunks(random_scene(seed(), 700, degree))  # not in Morton order
    save_chunks(data, tmp_path / "a.compressed.ply")
    result = pack_file(tmp_path / "a.compressed.ply")
    assert result.kept_chunks and result.order.tolist() == list(range(700)) and result.clamped == {}
    packed = parse(result.packed.image(), Path("a"))
    assert packed.counts.tolist() == [256, 256, 188] and packed.degrees.tolist() == [degree] * 3
    assert np.array_equal(packed.geometry[packed.slot], data.packed[:, :3])
    codes = chunk_codes(packed)
    rgba = np.column_stack([codes.dc, codes.opacity])
    assert np.array_equal(rgba[:, 0] << 24 | rgba[:, 1] << 16 | rgba[:, 2] << 8 | rgba[:, 3], data.packed[:, 3])
    assert np.array_equal((codes.sh.transpose(0, 2, 1).reshape(700, -1) + 255) // 2, data.sh)
    ours, theirs = decode(packed), decode_chunks(data)
    for name, tolerance in (("means", 2e-7), ("scales", 1e-6), ("quats", 0), ("opacities", 0), ("sh", 1e-6)):
        assert np.abs(getattr(ours, name) - getattr(theirs, name)).max() <= tolerance, name


def test_chunks_of_another_format_are_made_anew(tmp_path: Path) -> None:
    save_chunks(encode_chunks(random_scene(seed(), 300, 1)), tmp_path / "a.ply")
    result = pack_file(tmp_path / "a.ply", PackedFormat.FP16_LOCAL)
    assert not result.kept_chunks and result.packed.format is PackedFormat.FP16_LOCAL
    loaded = load_scene(tmp_path / "a.ply")
    assert np.allclose(decode(result.packed).means, loaded.means[result.order], atol=1e-3)


def test_rotations_longer_than_one_are_shortened() -> None:
    """No writer makes them; the largest component is then 0 and the length 1, to a code."""
    data = encode_chunks(random_scene(seed(), 300, 0))
    words = np.random.default_rng(seed()).integers(0, 1 << 32, 300, dtype=np.uint32)
    words[:8] = [0x3FFFFFFF, 0x7FF00000, 0, 0x40000000, 0x3FF003FF, 0x800FFC00, 0xC00003FF, 0xBFFFFC00]
    packed = pack_chunks(replace(data, packed=np.column_stack([data.packed[:, 0], words, data.packed[:, 2:]])))
    long = too_long(words)
    assert packed.clamped == {"rotation longer than 1": int(long.sum())} and long.sum() > 20
    after = packed.packed.geometry[packed.packed.slot, 1]
    assert np.array_equal(after[~long], words[~long]) and not too_long(after).any()
    three = rotation_of(words)[long]
    assert (np.abs(rotation_of(after)[long] - three / np.linalg.norm(three, axis=1, keepdims=True)).max(axis=1) < 0.08).all()
    parse(packed.packed.image(), Path("a"))


@pytest.mark.parametrize(("column", "value", "says"), [
    (0, np.nan, "chunk 1: bounds of position: not finite"), (9, np.inf, "chunk 1: bounds of scale: not finite"),
    (15, -np.inf, "chunk 1: bounds of colour: not finite"), (3, -50, "chunk 1: bounds of position: min above max"),
    (9, 100, "chunk 1: bounds of scale: not a normal float32 number"), (6, -100, "chunk 1: bounds of scale: not a normal"),
    (5, 3e38, None), (2, -3.4e38, None),
])
def test_bounds_of_chunks(column: int, value: float, says: str | None, tmp_path: Path) -> None:
    data = encode_chunks(random_scene(seed(), 300, 1))
    limits = data.bounds.copy()
    limits[1, column] = value
    save_chunks(replace(data, bounds=limits), tmp_path / "a.ply")
    if says is None:
        parse(pack_file(tmp_path / "a.ply").packed.image(), Path("a"))
        return
    with pytest.raises(FlickerError, match=re.escape(f"{tmp_path / 'a.ply'}: {says}")):
        pack_file(tmp_path / "a.ply")


def test_damaged_chunks(tmp_path: Path) -> None:
    path = tmp_path / "a.compressed.ply"
    save_chunks(encode_chunks(random_scene(seed(), 300, 1)), path)
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    with pytest.raises(FlickerError, match="a.compressed.ply: truncated: element 'sh'"):
        pack_file(path)
    path.write_bytes(whole.replace(b"element vertex 300", b"element vertex 0"))
    with pytest.raises(FlickerError, match="no Gaussians"):
        pack_file(path)


# ---- images as scenes ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", PackedFormat)
def test_antialiased_travels(form: PackedFormat, tmp_path: Path) -> None:
    """Through the image, where it is a bit that others have not, and through all that copies a scene."""
    scene, path = random_scene(seed(), 300, 1), tmp_path / "scene.flk"
    plain, flagged = (pack(replace(scene, antialiased=on), form).packed.image() for on in (False, True))
    assert {i for i in range(252) if plain[i] != flagged[i]} == {108} and (plain[108], flagged[108]) == (0, 1) and plain[256:] == flagged[256:]
    for data, on in ((plain, False), (flagged, True)):
        path.write_bytes(data)
        found = load_scene(path)
        assert found.antialiased is on and pack_file(path, form).packed.image() == data
        assert pack_file(path, PackedFormat.FP16).packed.antialiased is on
        for copy in (reorder(found, np.arange(300)[::-1]), half_turn(found), largest(found, 4), Parameters.of(found).scene(), build_clusters(found)[0],
                     *(through_memory(found, kind) for kind in MemoryFormat)):
            assert copy.antialiased is on
        save_chunks(encode_chunks(build_clusters(found)[0]), tmp_path / "scene.compressed.ply")
        kept = pack_file(tmp_path / "scene.compressed.ply")
        assert kept.kept_chunks and kept.packed.antialiased is on


def test_an_image_is_a_scene(tmp_path: Path) -> None:
    """Under any name; packed again in its own format it stays as it is, in another it is converted."""
    result = pack(mixed_scene())
    path = tmp_path / "a.flk"
    path.write_bytes(result.packed.image())
    scene, wanted = load_scene(path), decode(result.packed)
    for name in ("means", "scales", "quats", "opacities", "sh"):
        assert np.allclose(getattr(scene, name), getattr(wanted, name), atol=1e-7), name
    assert pack_file(path).packed.image() == path.read_bytes()
    other = pack_file(path, PackedFormat.FP16_LOCAL)
    assert other.packed.format is PackedFormat.FP16_LOCAL and np.allclose(decode(other.packed).means, scene.means[other.order], atol=1e-3)


# ---- images that are refused ---------------------------------------------------------------------------------------------------------


def sealed(image: bytes) -> bytes:
    """The image with checksums that fit."""
    data = bytearray(image)
    for k in range(4):
        offset, beats, _ = struct.unpack_from("<III", data, 32 + 12 * k)
        struct.pack_into("<I", data, 40 + 12 * k, zlib.crc32(data[offset * 64 : (offset + beats) * 64]))
    struct.pack_into("<I", data, 252, zlib.crc32(data[:252]))
    return bytes(data)


def at(place: int, kind: str, value: object) -> Callable[[bytes], bytes]:
    """Write a number, whatever the checksums then are."""
    def change(image: bytes) -> bytes:
        data = bytearray(image)
        struct.pack_into(kind, data, place, value)
        return bytes(data)

    return change


TABLE, CHUNK_HEADERS = 256, 256 + 3 * 64  # six clusters
SOUND = {  # what is wrong with an image whose checksums are right: change, format, message
    "format": (at(10, "<H", 3), "chunk", "format: 3, not 0 to 2"),
    "other format": (at(10, "<H", 1), "chunk", "headers_beats: 12, not 6"),
    "no Gaussians": (at(16, "<I", 0), "chunk", "gaussians: 0"),
    "no clusters": (at(20, "<I", 0), "chunk", "clusters: 0"),
    "slots": (at(24, "<I", 17), "chunk", "slots: 17, not a multiple of 16"),
    "many slots": (at(24, "<I", (1 << 24) + 16), "chunk", "slots: 16777232"),
    "other slots": (at(24, "<I", 64), "chunk", "geometry_beats"),
    "beats": (at(28, "<I", 10), "chunk", "beats: the file has"),
    "offset in another part": (at(32, "<I", 0), "chunk", "table_offset: 0, not 4"),
    "offset outside": (at(56, "<I", 1 << 30), "chunk", "geometry_offset: 1073741824"),
    "long part": (at(72, "<I", 1 << 20), "chunk", "colour_beats: ends at beat"),
    "number of Gaussians": (at(16, "<I", 1501), "chunk", "gaussians: 1501, the cluster table says 1500"),
    "degree": (at(12, "<I", 2), "chunk", "degree: 2, the cluster table says 3"),
    "box of all": (at(80, "<f", 0.5), "chunk", "low: "),
    "sigma of all": (at(104, "<f", np.nan), "chunk", "sigma: nan"),
    "reserved": (at(200, "<I", 1), "chunk", "reserved: not zero"),
    "flags of the image": (at(108, "<I", 3), "chunk", "flags: 3: reserved bits"),
    "box not a number": (at(TABLE + 32, "<f", np.nan), "chunk", "cluster 1: low: not finite"),
    "box infinite": (at(TABLE + 32 + 20, "<f", np.inf), "chunk", "cluster 1: high: not finite"),
    "box turned": (at(TABLE + 64, "<f", 5.0), "chunk", "cluster 2: low: above high"),
    "box too small": (at(TABLE + 64 + 12, "<f", -0.999), "chunk", "cluster 2: low"),
    "sigma infinite": (at(TABLE + 24, "<H", 0x7F80), "chunk", "cluster 0: sigma: not a positive"),
    "sigma zero": (at(TABLE + 24, "<H", 0), "chunk", "cluster 0: sigma: not a positive"),
    "sigma negative": (at(TABLE + 24, "<H", 0xBF80), "chunk", "cluster 0: sigma: not a positive"),
    "count": (at(TABLE + 26, "<B", 3), "chunk", "cluster 1: first: not where"),
    "flags": (at(TABLE + 27, "<B", 7), "fp16", "cluster 0: flags: reserved"),
    "slope": (at(TABLE + 27, "<B", 3 | 8 << 2), "chunk", "cluster 0: slope: below that of its colours"),
    "degree of a cluster": (at(TABLE + 27, "<B", 2), "chunk", "cluster 1: colour: not where"),
    "first slot": (at(TABLE + 32 + 28, "<I", 1 << 28), "chunk", "cluster 1: first: not where"),
    "low not finite": (at(CHUNK_HEADERS + 128 + 4, "<f", np.inf), "chunk", "cluster 1: position_low: not finite"),
    "step not a number": (at(CHUNK_HEADERS + 16, "<f", np.nan), "chunk", "cluster 0: position_step: not finite"),
    "step negative": (at(CHUNK_HEADERS + 48, "<f", -1e-3), "chunk", "cluster 0: scale_step: negative"),
    "steps of SH": (at(CHUNK_HEADERS + 124, "<f", np.nan), "chunk", "cluster 0: sh_step: not finite"),
    "colours outside": (at(CHUNK_HEADERS + 12 + 5 * 128, "<I", 0xFFFFFFFF), "chunk", "cluster 5: colour: ends outside"),
    "colours elsewhere": (at(CHUNK_HEADERS + 12 + 128, "<I", 0), "chunk", "cluster 1: colour: not where"),
    "zero of SH": (at(CHUNK_HEADERS + 28, "<I", 254), "chunk", "cluster 0: sh_zero: none of 255, 256"),
    "reserved word": (at(CHUNK_HEADERS + 44, "<I", 1), "chunk", "cluster 0: reserved_0: not zero"),
    "position outside the box": (at(CHUNK_HEADERS + 16, "<f", 1.0), "chunk", "cluster 0: low, high: a mean lies outside"),
    "scale above sigma": (at(CHUNK_HEADERS + 32, "<f", 1.0), "chunk", "cluster 0: sigma: below a standard deviation"),
    "scale too small": (at(CHUNK_HEADERS + 32, "<f", -200.0), "chunk", "scale: slot 0: below 2^-126"),
    "rotation": (at(CHUNK_HEADERS + 6 * 128 + 4, "<I", 0x3FFFFFFF), "chunk", "rotation: slot 0: longer than 1"),
    "unused slot": (at(CHUNK_HEADERS + 6 * 128 + 12 * 1503, "<I", 1), "chunk", "geometry: slot 1503: not used"),
    "mean infinite": (at(TABLE + 192 + 6 * 64, "<H", 0x7C00), "fp16", "mean: slot 0: not finite"),
    "scale zero": (at(TABLE + 192 + 6 * 64 + 6, "<H", 0), "fp16", "scale: slot 0: not positive"),
    "scale negative": (at(TABLE + 192 + 6 * 64 + 26, "<H", 0xBC00), "fp16", "scale: slot 1: not positive"),
    "rotation zero": (at(TABLE + 192 + 6 * 64 + 12, "<Q", 0x8000), "fp16", "quat: slot 0: zero"),
    "origin": (at(TABLE + 192, "<f", 1.0), "fp16", "cluster 0: origin: not zero"),
    "origin not a number": (at(TABLE + 192, "<f", np.nan), "fp16-local", "cluster 0: origin: not finite"),
    "reserved bytes": (at(TABLE + 192 + 63, "<B", 1), "fp16-local", "cluster 0: reserved: not zero"),
    "opacity": (at(-1, "<B", 0), "fp16", "opacity: slot 0: not 0 to 1"),
    "colour not a number": (at(-1, "<B", 0), "fp16", "sh: slot 0: not finite"),
}
BROKEN = {  # changes that the checksums or the first look find
    "empty": (lambda image: b"", "magic: not a memory image"),
    "text": (lambda image: b"hello", "magic: not a memory image"),
    "cut in the image header": (lambda image: image[:100], "truncated: 100 bytes"),
    "cut": (lambda image: image[:-1], "truncated: the file has"),
    "cut by a beat": (lambda image: image[:-64], "truncated: the file has"),
    "longer": (lambda image: image + bytes(64), "beats: the file has"),
    "version": (lambda image: sealed(at(8, "<H", 3)(image)), "version: 3, not 1 or 2"),
    "version, unsealed": (at(8, "<H", 9), "version: 9, not 1 or 2"),
    "bit in the image header": (at(17, "<B", 77), "image header: checksum is"),
    "bit in the table": (at(260, "<B", 77), "table: checksum is"),
    "bit in the headers": (at(CHUNK_HEADERS + 5, "<B", 77), "headers: checksum is"),
    "bit in the geometry": (at(CHUNK_HEADERS + 6 * 128, "<B", 77), "geometry: checksum is"),
    "bit in the colours": (lambda image: image[:-100] + bytes([image[-100] ^ 1]) + image[-99:], "colour: checksum is"),
}


@pytest.fixture(scope="module")
def images() -> dict[str, bytes]:
    return {form.value: pack(mixed_scene(), form, Recipe(cuts=0)).packed.image() for form in FORMATS}


def refuses(image: bytes, folder: Path, says: str) -> None:
    """One line that names file and field, from the reader and through `load_scene`."""
    path = folder / "bad.flk"
    path.write_bytes(image)
    for read in (load_packed, load_scene) if image[:8] == b"FLKSCENE" else (load_packed,):
        with pytest.raises(FlickerError) as caught:
            read(path)
        text = str(caught.value)
        assert text.startswith(f"{path}: {says}") and "\n" not in text, text


@pytest.mark.parametrize("case", SOUND)
def test_wrong_fields_are_refused(case: str, images: dict[str, bytes], tmp_path: Path) -> None:
    change, form, says = SOUND[case]
    image = images[form]
    if case in ("opacity", "colour not a number"):
        colours = 64 * struct.unpack_from("<I", image, 68)[0]
        change = at(colours, "<H", 0x3C01) if case == "opacity" else at(colours + 4, "<H", 0x7E00)
    changed = change(image)
    assert changed != image
    refuses(sealed(changed) if case not in ("offset in another part", "offset outside", "long part") else resealed_header(changed), tmp_path, says)


def resealed_header(image: bytes) -> bytes:
    """Only the image header's checksum made right: the offsets lead nowhere."""
    return image[:252] + struct.pack("<I", zlib.crc32(image[:252])) + image[256:]


@pytest.mark.parametrize("case", BROKEN)
def test_broken_images_are_refused(case: str, images: dict[str, bytes], tmp_path: Path) -> None:
    change, says = BROKEN[case]
    refuses(change(images["chunk"]), tmp_path, says)


def test_every_bit_is_under_a_checksum_or_checked(images: dict[str, bytes]) -> None:
    rng = np.random.default_rng(seed())
    for image in images.values():
        for place in [*range(256), *rng.integers(256, len(image), 200)]:
            data = bytearray(image)
            data[place] ^= 1 << int(rng.integers(8))
            with pytest.raises(FlickerError):
                parse(bytes(data), Path("a"))


def test_random_fields_behind_right_checksums(images: dict[str, bytes]) -> None:
    """Whatever is refused is refused in one line; what is not is a sound scene."""
    rng = np.random.default_rng(seed())
    for image in images.values():
        end = 64 * struct.unpack_from("<I", image, 56)[0]
        for _ in range(150):
            data = bytearray(image)
            data[int(rng.integers(12, end))] ^= int(rng.integers(1, 256))
            try:
                packed = parse(sealed_safely(bytes(data)), Path("a"))
            except FlickerError as error:
                assert "\n" not in str(error)
            else:
                assert sound(packed)


def sealed_safely(image: bytes) -> bytes:
    """As `sealed`, where the offsets may lead outside."""
    return resealed_header(sealed(image)) if struct.unpack_from("<I", image, 28)[0] * 64 == len(image) else resealed_header(image)


def sound(packed: PackedScene) -> bool:
    low, high, sigma = bounds(packed)
    v = values(packed)
    return bool(
        (low >= packed.table["low"]).all() and (high <= packed.table["high"]).all() and (sigma <= packed.table["sigma"]).all()
        and np.isfinite(v.sh).all() and (v.scales > 0).all() and len(decode(packed)) == len(packed)
    )


def test_scenes_too_large_for_the_fields(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = mixed_scene(300, 0)
    monkeypatch.setattr(packing, "SLOT_LIMIT", 299)
    with pytest.raises(FlickerError, match="300 Gaussians, more than 299: a record's number has 24 bits"):
        pack(scene)
    monkeypatch.setattr(packing, "SLOT_LIMIT", 300)  # 304 slots
    with pytest.raises(FlickerError, match="304 slots, more than 300"):
        pack(scene)
    monkeypatch.undo()
    scene.means[5] = 3.4e38, -3.4e38, 0
    assert np.isfinite(pack(scene).packed.table["low"]).all()
    scene.sh[7] = 3.3e38
    pack(scene)


# ---- the command line ----------------------------------------------------------------------------------------------------------------


def test_command(tmp_path: Path) -> None:
    """Packs, reads back, opens as a scene; bad input is one line and no file."""
    scene = mixed_scene(600, 2)
    scene.opacities[0] = 1e-3
    save_ply(scene, tmp_path / "a.ply")
    run = flicker("pack", tmp_path / "a.ply", "-o", tmp_path / "a.flk", "--format", "fp16-local")
    assert run.returncode == 0, run.stderr
    packed = load_packed(tmp_path / "a.flk")
    assert packed.format is PackedFormat.FP16_LOCAL and len(packed) == 599
    info = flicker("pack", "--info", tmp_path / "a.flk")
    assert info.returncode == 0, info.stderr
    for out in (run.stdout, info.stdout):
        for word in ("fp16-local", "599", "608", "9 unused", f"{len(packed.image()):,} bytes", "SH degree 2", "SH degree 0", "geometry"):
            assert word in out, (word, out)
    assert "opacity below 1/255" in run.stdout and "left out" in run.stdout
    narrow = flicker("pack", tmp_path / "a.ply", "-o", tmp_path / "n.flk", "--sh-bits", "5")
    assert narrow.returncode == 0 and "SH codes of 5 bits" in narrow.stdout, narrow.stderr
    for same in ((), ("--sh-bits", "5")):
        assert flicker("pack", tmp_path / "n.flk", "-o", tmp_path / "m.flk", *same).returncode == 0
        assert (tmp_path / "m.flk").read_bytes() == (tmp_path / "n.flk").read_bytes()
    again = flicker("pack", tmp_path / "n.flk", "-o", tmp_path / "m.flk", "--sh-bits", "auto", "--db", "60", "--rechunk")
    assert again.returncode == 0 and "to 8 bits, in 8 views" in again.stdout, again.stderr
    (tmp_path / "b.flk").write_bytes((tmp_path / "a.flk").read_bytes()[:-5])
    before = sorted(tmp_path.iterdir())
    for args, named in (
        ((tmp_path / "a.ply",), "--out"), ((tmp_path / "a.ply", "-o", tmp_path / "c.bin"), ".flk"), ((tmp_path / "none.ply", "-o", tmp_path / "c.flk"), "none"),
        (("--info", tmp_path / "b.flk"), "b.flk: truncated"), (("--info", tmp_path / "a.ply"), "a.ply: magic"),
        (("--info", tmp_path / "a.flk", "--format", "fp16"), "--format"), ((tmp_path / "b.flk", "-o", tmp_path / "c.flk"), "b.flk: truncated"),
        ((tmp_path / "a.ply", "-o", tmp_path / "no" / "c.flk"), "no such folder"),
        ((tmp_path / "a.ply", "-o", tmp_path / "c.flk", "--sh-bits", "7"), "--sh-bits: 3, 4, 5, 6, 8 or auto, not 7"),
        ((tmp_path / "a.ply", "-o", tmp_path / "c.flk", "--sh-bits", "4", "--format", "fp16"), "--sh-bits: of --format chunk alone"),
        ((tmp_path / "a.ply", "-o", tmp_path / "c.flk", "--db", "50"), "--db: of --sh-bits auto alone"),
        ((tmp_path / "a.ply", "-o", tmp_path / "c.flk", "--sh-bits", "auto", "--db", "nan"), "--db: 20 to 120, not nan"),
        *(((tmp_path / "n.flk", "-o", tmp_path / "c.flk", "--sh-bits", bits), "n.flk: brings its own SH codes") for bits in ("4", "8", "auto")),
        (("--info", tmp_path / "n.flk", "--sh-bits", "4"), "--info: reads an image, so it cannot be combined with --sh-bits"),
    ):
        bad = flicker("pack", *args)
        assert bad.returncode == 2 and bad.stderr.count("\n") == 1 and named in bad.stderr, bad.stderr
    assert sorted(tmp_path.iterdir()) == before


# ---- real scenes ---------------------------------------------------------------------------------------------------------------------


def picture_db(view: View, packing: Packing) -> float:
    """PSNR of the packed scene in float64 against the scene as loaded."""
    whole = View(view.camera, reorder(view.scene, packing.order))
    return psnr(View(view.camera, decode(packing.packed)).reference, whole.reference)


@pytest.mark.parametrize("real", real_views())
def test_real_scenes_keep_their_picture(real) -> None:
    folder = real_scenes()
    if folder is None:
        pytest.skip("FLICKER_SCENES names no folder of real scenes")
    view = load_view(real.path(folder), real.number, (1280, 720))
    packing = pack_file(real.path(folder))
    assert picture_db(view, packing) > {"flowers": 100, "playbot": 60, "guitar": 63, "stpeter": 67}[real.folder]
    if packing.kept_chunks:
        data = load_chunks(real.path(folder))
        packed = packing.packed
        assert np.array_equal(packed.geometry[packed.slot], data.packed[:, :3])
    assert parse(packing.packed.image(), Path("a")).image() == packing.packed.image()


def test_demo_scene_keeps_its_picture() -> None:
    view = load_view("demo", 0, (640, 360))
    assert picture_db(view, pack(view.scene)) > 57
