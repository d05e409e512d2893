"""`flicker convert`: every pair of formats there and back, what is told, what is selected, what is refused.

Scenes are small and their means far apart along x, so that Gaussians are told by it whatever order a format has. Not covered: what other programs make of the
files.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from flicker_tb.runner import seed
from scene_samples import random_scene
from typer.testing import CliRunner

from flicker.cli.main import app
from flicker.errors import FlickerError
from flicker.scene import load_scene
from flicker.scene.files import save_ply
from flicker.scene.gaussians import SH_C0, Scene
from flicker.scene.packing import pack
from flicker.scene.sog_write import _codes
from flicker.scene.write import WRITERS, write_scene

# What a format may change: position, share of a size, angle in degrees, opacity, colour, harmonics. The scene is about 6 units long, log sizes span 12.
ANY = {
    ".ply": (1e-6, 1e-5, 0.1, 1e-6, 1e-6, 1e-6),
    ".compressed.ply": (0.002, 0.007, 0.25, 0.002, 0.004, 0.032),
    ".spz": (1e-6, 0.033, 0.4, 0.002, 0.004, 0.004),
    ".sog": (2e-4, 0.03, 0.7, 0.002, 0.01, 0.004),
    ".splat": (0.0, 1e-6, 0.9, 0.002, 0.002, 0.0),
    ".flk": (0.003, 0.012, 0.25, 0.002, 0.004, 0.003),
}
FLAG = {".ply", ".compressed.ply", ".spz", ".sog"}


def scene_of(degree: int = 2, antialiased: bool = True) -> Scene:
    """120 Gaussians, one opaque, one flat; colours that every format holds."""
    scene = random_scene(seed(), 120, degree)
    scene.means[:, 0] = np.random.default_rng(seed()).permutation(120) * 0.05 - 3
    scene.opacities[7] = 1.0
    scene.scales[9] = (0.1, 2.0**-16 * 0.12, 0.12)
    scene.sh[:, 0] = scene.sh[:, 0].clip(-0.45 / SH_C0, 0.45 / SH_C0)
    return replace(scene, antialiased=antialiased)


def by_x(scene: Scene) -> Scene:
    order = np.argsort(scene.means[:, 0])
    return Scene(scene.means[order], scene.scales[order], scene.quats[order], scene.opacities[order], scene.sh[order], antialiased=scene.antialiased)


@pytest.mark.parametrize("first, second", list(product(WRITERS, WRITERS)))
def test_there_and_back(tmp_path: Path, first: str, second: str) -> None:
    """A scene through one format into another: all within the steps of both."""
    source = scene_of()
    write_scene(source, tmp_path / f"a{first}", first)
    write_scene(load_scene(tmp_path / f"a{first}"), tmp_path / f"b{second}", second)
    a, b = by_x(source), by_x(load_scene(tmp_path / f"b{second}"))
    position, size, angle, opacity, colour, harmonics = (x + y for x, y in zip(ANY[first], ANY[second]))
    assert len(a) == len(b) and np.abs(a.means - b.means).max() <= position
    thinnest = np.exp(-10.0) if ".spz" in (first, second) else 0.0
    assert np.abs(np.log(np.maximum(a.scales, thinnest)) - np.log(np.maximum(b.scales, thinnest))).max() <= size
    assert np.degrees(2 * np.arccos(np.minimum(np.abs((a.quats.astype(float) * b.quats).sum(axis=1)), 1))).max() <= angle
    assert np.abs(a.opacities - b.opacities).max() <= opacity
    assert b.opacities[a.opacities == 1].min() > 0.9999  # gsply reads a code of 255 so
    assert SH_C0 * np.abs(a.sh[:, 0] - b.sh[:, 0]).max() <= colour
    assert b.sh_degree == (0 if ".splat" in (first, second) else 2)
    if b.sh_degree:
        assert np.abs(a.sh[:, 1:] - b.sh[:, 1:]).max() <= harmonics
    if {first, second} <= FLAG:
        assert b.antialiased
    if ".splat" in (first, second):
        assert not b.antialiased


def test_losses_are_those_of_the_file(tmp_path: Path) -> None:
    """Nothing is lost in a PLY; what a .splat cannot say is said; the faintest are counted."""
    source = scene_of(3)
    source.opacities[3] = 0.001
    whole = write_scene(source, tmp_path / "a.ply", ".ply")
    assert (whole.count, whole.left_out, whole.losses, whole.notes) == (120, {}, {}, [])
    lost = write_scene(source, tmp_path / "a.splat", ".splat")
    assert lost.count == 119 and list(lost.left_out.values()) == [1]
    assert lost.notes[0] == "harmonics of degree 3 are cut to 0" and "antialiased" in lost.notes[1]
    back = by_x(load_scene(tmp_path / "a.splat"))
    kept = by_x(source).opacities > 0.002
    change = np.abs(by_x(source).opacities[kept].astype(np.float64) - back.opacities)
    assert lost.losses["opacity"] == pytest.approx((change.max(), change.mean()))
    assert "position, units of the scene" not in lost.losses


def test_positions_far_away(tmp_path: Path) -> None:
    """SPZ takes the finest fraction that holds all positions; what it cannot hold is refused."""
    source = scene_of(0)
    source.means[0] = (1e5, 0, 0)  # 16 bits above the point leave 6 below; half of a step is lost
    assert write_scene(source, tmp_path / "a.spz", ".spz").losses["position, units of the scene"][0] == pytest.approx(2.0**-7, rel=0.2)
    source.means[0] = (1e7, 0, 0)
    with pytest.raises(FlickerError, match="a position of 1e\\+07: SPZ holds up to 4.19e\\+06; --no-flyaways"):
        write_scene(source, tmp_path / "b.spz", ".spz")


def test_codebook() -> None:
    """Few values are exact; one far off takes nothing from the others."""
    rng = np.random.default_rng(seed())
    few = rng.choice(rng.normal(size=100), 1000)
    codes, book = _codes(few)
    assert np.abs(np.array(book)[codes] - few).max() < 1e-9
    many = np.append(rng.uniform(0, 1, 5000), 1000.0)
    codes, book = _codes(many)
    assert np.abs(np.array(book)[codes] - many)[:-1].max() < 0.02 and book[codes[-1]] == pytest.approx(1000.0)


def run(*words: object, command: str = "convert") -> tuple[int, str]:
    result = CliRunner().invoke(app, [command, *map(str, words)])
    return (result.exit_code if not isinstance(result.exception, FlickerError) else 2), str(result.exception or result.output)


def test_command_selects(tmp_path: Path) -> None:
    """Box, flyaways and degree; all counts are told and right."""
    scene = scene_of()
    scene.means[:5] *= 1e5
    save_ply(scene, tmp_path / "a.ply")
    code, told = run(tmp_path / "a.ply", tmp_path / "b.ply", "--no-flyaways", "--degree", 1, "--box", "-1,-9,-9,1,9,9")
    back = load_scene(tmp_path / "b.ply")
    inside = (np.abs(scene.means[5:, 0]) <= 1).sum()
    assert code == 0 and len(back) == inside and back.sh_degree == 1 and back.antialiased
    words = " ".join(told.split())
    assert "harmonics of degree 2 are cut to 1" in words and "│ 5 │ left out" in words and f"│ {115 - inside} │ left out" in words


@pytest.mark.parametrize("words, told", [
    (("/dev/full",), "/dev/full: no suffix, which says the format; written are .compressed.ply, .ply, .spz, .sog, .splat, .flk"),
    (("b.obj",), "unknown suffix '.obj'; written are .compressed.ply, .ply, .spz, .sog, .splat, .flk"),
    (("b.ply", "--box", "1,2,3"), "--box: expected six numbers"),
    (("b.ply", "--box", "1,0,0,0,1,1"), "--box: x0 = 1 is above x1 = 0"),
    (("b.ply", "--box", "90,90,90,91,91,91"), "no Gaussian is left: outside the box: 120"),
    (("no/b.ply",), "no such folder"),
])
def test_command_refuses(tmp_path: Path, words: tuple[str, ...], told: str) -> None:
    save_ply(scene_of(0), tmp_path / "a.ply")
    code, said = run(tmp_path / "a.ply", tmp_path / words[0], *words[1:])
    assert code == 2 and told in said and sorted(p.name for p in tmp_path.iterdir()) == ["a.ply"]


@pytest.mark.parametrize("words", ["convert {0} {0} --degree 0", "convert {0} {1}", "budget {0} -o {0} --keep 0.5", "pack {2} -o {2}"])
def test_a_scene_is_not_written_over_itself(tmp_path: Path, words: str) -> None:
    """Also by another name of the file."""
    names = [tmp_path / name for name in ("a.ply", "b.ply", "c.flk")]
    save_ply(scene_of(1), names[0])
    names[1].symlink_to(names[0])
    names[2].write_bytes(pack(scene_of(0)).packed.image())
    before = [name.read_bytes() for name in names]
    command, *rest = words.format(*names).split()
    code, said = run(*rest, command=command)
    assert code == 2 and "is the scene itself" in said and [name.read_bytes() for name in names] == before


def test_nothing_half_written(tmp_path: Path) -> None:
    """A format that cannot hold the scene leaves the file that was there."""
    scene = scene_of(0)
    scene.means[0] = (1e7, 0, 0)
    save_ply(scene, tmp_path / "a.ply")
    (tmp_path / "b.spz").write_bytes(b"before")
    assert run(tmp_path / "a.ply", tmp_path / "b.spz")[0] == 2
    assert (tmp_path / "b.spz").read_bytes() == b"before" and len(list(tmp_path.iterdir())) == 2
