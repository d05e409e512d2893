"""Memory formats of the chip model: bits survive memory, chunks are what PlayCanvas and gsply read and write."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import gsply
import numpy as np
import pytest
from flicker_tb.runner import seed
from scene_samples import as_gsply, random_scene

from flicker.errors import FlickerError
from flicker.scene.clusters import build_clusters
from flicker.scene.files import load_scene
from flicker.scene.memory import MemoryFormat, decode_chunks, decode_fp16, encode_chunks, encode_fp16, layout, load_chunks, save_chunks


def test_fp16_is_rounded_once():
    scene, _ = build_clusters(random_scene(seed(), 300, 2), 64)
    scene.means[:] += 100  # far from the origin, where FP16 is coarse
    plain, local = (encode_fp16(scene, 64, local) for local in (False, True))
    size = layout(MemoryFormat.FP16, 9)
    assert plain.geometry.nbytes + plain.colour.nbytes == 300 * (size.geometry + size.colour)
    assert np.array_equal(plain.geometry[:, :3].view(np.float16), scene.means.astype(np.float16))
    assert np.array_equal(plain.colour[:, 1:].view(np.float16), scene.sh.reshape(300, -1).astype(np.float16))
    error = [np.abs(decode_fp16(data).means - scene.means).max() for data in (plain, local)]
    assert error[0] > 0.02 and error[1] < 0.001
    assert plain.clamped == 0 and encode_fp16(replace(scene, means=scene.means * 1e4)).clamped > 0


def test_chunks_round_to_the_nearest_code():
    scene, _ = build_clusters(random_scene(seed(), 700, 2), 256)
    data = encode_chunks(scene)
    back = decode_chunks(data)
    steps = np.array([2047, 1023, 2047])
    chunk = np.arange(700) // 256
    for values, other, column in ((scene.means, back.means, 0), (np.log(scene.scales), np.log(back.scales), 6)):
        step = (data.bounds[:, column + 3 : column + 6] - data.bounds[:, column : column + 3]) / steps
        assert (np.abs(values.astype(float) - other) <= step[chunk] * 0.5 + 1e-6).all()
    assert np.abs(scene.opacities - back.opacities).max() <= 0.5 / 255 + 1e-6
    assert np.abs(scene.sh[:, 1:] - back.sh[:, 1:]).max() <= 0.5 / 32 + 1e-6
    along = np.abs((scene.quats * back.quats).sum(axis=1))
    assert along.min() > 1 - 3e-6  # half a step of 1/1023 * sqrt(2) in three components
    again = encode_chunks(back, bounds=data.bounds)
    assert np.array_equal(again.packed[:, [0, 2, 3]], data.packed[:, [0, 2, 3]]) and np.array_equal(again.sh, data.sh)
    assert (again.packed[:, 1] == data.packed[:, 1]).mean() > 0.99  # the two largest components may tie


def test_scaled_sh_codes(tmp_path):
    scene, _ = build_clusters(random_scene(seed(), 700, 2), 256)
    scene.sh[256:512, 1:] = 0  # a chunk without any
    scene.sh[300, 0] = 5
    data = encode_chunks(scene, scaled_sh=True)
    back = decode_chunks(data)
    largest = np.repeat([np.abs(scene.sh[k : k + 256, 1:]).max() for k in (0, 256, 512)], 256)[:700]
    assert (np.abs(back.sh[:, 1:] - scene.sh[:, 1:]).max(axis=(1, 2)) <= largest / 254 + 1e-6).all()
    assert (back.sh[256:512, 1:] == 0).all() and data.sh.min() >= 1
    assert np.array_equal(decode_chunks(encode_chunks(scene)).means, back.means)
    with pytest.raises(FlickerError, match="scaled"):
        save_chunks(data, tmp_path / "a.ply")


@pytest.mark.parametrize("degree", [0, 1, 3])
def test_chunks_in_a_file_are_what_gsply_reads(tmp_path, degree):
    scene, _ = build_clusters(random_scene(seed(), 600, degree), 256)
    data = encode_chunks(scene)
    save_chunks(data, tmp_path / "a.compressed.ply")
    theirs, ours = load_scene(tmp_path / "a.compressed.ply"), decode_chunks(data)
    for name, tolerance in (("means", 1e-6), ("scales", 1e-6), ("quats", 1e-6), ("opacities", 6e-5), ("sh", 1e-5)):
        assert np.abs(getattr(theirs, name) - getattr(ours, name)).max() < tolerance, name
    bits = load_chunks(tmp_path / "a.compressed.ply")
    assert all(np.array_equal(getattr(bits, n), getattr(data, n)) for n in ("bounds", "packed", "sh"))
    assert data.bounds.nbytes + data.packed.nbytes + data.sh.nbytes == layout(MemoryFormat.CHUNK, (degree + 1) ** 2).total(600, 3)
    (tmp_path / "b.ply").write_bytes((tmp_path / "a.compressed.ply").read_bytes()[:-1])
    with pytest.raises(FlickerError, match="b.ply"):
        load_chunks(tmp_path / "b.ply")


def test_chunks_equal_gsplys_writer(tmp_path):
    """gsply computes in float32: a value on the edge of a code may fall one code lower or higher."""
    scene, _ = build_clusters(random_scene(seed(), 2000, 1), 256)
    gsply.plywrite(tmp_path / "a.ply", as_gsply(scene), compressed=True)
    (written,) = tmp_path.glob("*.ply")
    theirs, ours = load_chunks(written), encode_chunks(scene)
    assert np.allclose(theirs.bounds, ours.bounds, atol=1e-6)
    for column, widths in ((0, (11, 10, 11)), (1, (2, 10, 10, 10)), (2, (11, 10, 11)), (3, (8, 8, 8, 8))):
        shift = 32
        for width in widths:
            shift -= width
            a, b = ((d.packed[:, column].astype(np.int64) >> shift) & ((1 << width) - 1) for d in (theirs, ours))
            assert np.abs(a - b).max() <= 1 and (a == b).mean() > 0.98, (column, shift)
    assert (theirs.sh == ours.sh).all()


def test_own_decoder_on_a_file_of_playcanvas():
    folder = os.environ.get("FLICKER_SCENES")
    if not folder:
        pytest.skip("FLICKER_SCENES names no folder of scenes")
    path = Path(folder) / "flowers" / "flowers.compressed.ply"
    data, theirs = load_chunks(path), load_scene(path)
    ours = decode_chunks(data)
    for name, tolerance in (("means", 1e-6), ("scales", 1e-6), ("quats", 1e-6), ("opacities", 6e-5), ("sh", 1e-5)):
        assert np.abs(getattr(theirs, name) - getattr(ours, name)).max() < tolerance, name
    again = encode_chunks(ours, bounds=data.bounds)
    assert np.array_equal(again.packed[:, [0, 2, 3]], data.packed[:, [0, 2, 3]]) and np.array_equal(again.sh, data.sh)
