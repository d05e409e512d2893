"""Scenes to a budget: scores, least squares, SH degrees, reductions, files, the command.

Scores and losses are compared with pictures drawn without a Gaussian or a degree; the matrix of a view with the renderer and with its own transpose; a run that
is interrupted anywhere with one that is not, bit for bit; a poisoned scene with the scene without the poison. Not covered: how much of a real scene can go
(docs/results/budget.md has figures).
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scene_samples as samples
from flicker_tb.command import flicker
from flicker_tb.runner import seed
from scipy.spatial.transform import Rotation

from flicker.budget.curve import Curve
from flicker.budget.degrees import cut, cuts, losses
from flicker.budget.goal import Goal, Kind, chip_cost, price
from flicker.budget.merge import COLOUR, loss, merge, united
from flicker.budget.reduce import Options, Phase, Reducer, Row, sound
from flicker.budget.refit import ViewMatrix, refit
from flicker.budget.score import Score, scores
from flicker.budget.sh_bits import choose
from flicker.budget.tune import Rates, quality
from flicker.budget.views import HOLD_EVERY, cameras_of, machine_psnr, reference_psnr
from flicker.budget.write import save
from flicker.chip.scene_cost import scene_cost
from flicker.errors import FlickerError
from flicker.fit.loss import log_error_slope
from flicker.fit.parameters import LOGIT, QUAT, SCALE, SH, Parameters
from flicker.fit.render import render
from flicker.front.projection import colours
from flicker.scene.camera import Camera, cameras_text, orbit_camera
from flicker.scene.clusters import cluster_order, reorder
from flicker.scene.files import Scene, load_scene, save_ply
from flicker.scene.gaussians import SH_C0
from flicker.scene.packed import PackedFormat, load_packed
from flicker.scene.packing import coded_sh, pack

FRAME = (96, 64)


def small(count: int = 400, degree: int = 1) -> Scene:
    scene = samples.random_scene(seed() + 3, count, degree)
    scene.scales *= np.float32(1.5)
    return scene


def look(scene: Scene, number: int, size: tuple[int, int] = (48, 40)) -> list[Camera]:
    return [orbit_camera(scene, k, number, *size) for k in range(number)]


def without(parameters: Parameters, i: int) -> Parameters:
    return Parameters(np.delete(parameters.values, i, axis=0))


def start(scene: Scene, options: Options, number: int = 12) -> Reducer:
    fitted, held = cameras_of(scene, count=number, size=(48, 40))
    clean, pictures, _ = sound(scene, [*fitted, *held])
    return Reducer(clean, fitted, held, pictures, options)


def keeping(share: float, **more) -> Options:
    return Options(**({"goal": Goal(Kind.KEEP, share), "rounds": 2, "steps": 12, "last": 24, "frame": FRAME} | more))


# -- what Gaussians give --------------------------------------------------------------------------------------------------------------


def test_scores() -> None:
    """Weights add up to what the pictures are opaque; the change without a Gaussian is that of the picture drawn without it, where it does not decide where
    pixels finish."""
    scene = small(80)
    scene.opacities *= np.float32(0.8)
    parameters, cameras = Parameters.of(scene), look(scene, 2)
    found = scores(parameters, cameras)
    frames = [render(parameters, camera) for camera in cameras]
    assert found.weight.sum() == pytest.approx(sum((1 - frame.transmittance).sum() for frame in frames), rel=1e-9)
    assert (found.peak <= np.minimum(found.weight, 0.99)).all() and (found.frames <= 2).all() and found.pixels.sum() > 1000
    assert found.tiles.sum() == sum(len(frame.entry) for frame in frames)
    same = 0
    for i in range(len(parameters)):
        change = sum(((render(without(parameters, i), c).image - f.image) ** 2).sum() for c, f in zip(cameras, frames))
        same += found.change[i] == pytest.approx(change, rel=1e-6, abs=1e-12)
    assert same > 70
    assert np.array_equal(found.by(Score.PEAK), found.peak)


def test_price() -> None:
    """Bytes by Gaussian follow those of `flicker cost`; for a budget of Gaussians each costs 1."""
    scene = small()
    cameras = look(scene, 2, FRAME)
    found, cost = scores(Parameters.of(scene), cameras), scene_cost(scene, cameras)
    of = price(found, Kind.MBYTES, 1.0, np.full(len(scene), 4))
    assert np.corrcoef(of, cost.moved)[0, 1] > 0.9 and of.sum() == pytest.approx(cost.moved.sum(), rel=0.15)
    assert (price(found, Kind.KEEP, 1.0, np.full(len(scene), 4)) == 1).all()
    assert (price(found, Kind.CYCLES, 4.0, np.full(len(scene), 4)) > price(found, Kind.CYCLES, 1.0, np.full(len(scene), 4)))[found.pixels > 0].all()


# -- merging --------------------------------------------------------------------------------------------------------------------------


def moments(row: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Opacity times the area of the broadest side, mean and covariance of a row of parameters."""
    scales = np.exp(row[SCALE:QUAT].astype(np.float64))
    axes = Rotation.from_quat(row[QUAT:LOGIT], scalar_first=True).as_matrix() * scales
    return np.prod(np.sort(scales)[1:]) / (1 + np.exp(-float(row[LOGIT]))), row[:SCALE].astype(np.float64), axes @ axes.T


def test_loss_of_a_merger() -> None:
    """The mixture's moments, one pair at a time; Runnalls' bound of them; colours differ as they do over all directions."""
    values = Parameters.of(small(40, 2)).values
    a, b = values[:20], values[20:]
    grey = b.copy()
    grey[:, SH:] = a[:, SH:]
    both, lost, apart = united(a, b), loss(a, b), loss(a, grey)
    for k in range(len(a)):
        (wa, ma, ca), (wb, mb, cb), (_, m, c) = moments(a[k]), moments(b[k]), moments(both[k])
        wa, wb = wa / (wa + wb), wb / (wa + wb)
        mean = wa * ma + wb * mb
        wide = wa * (ca + np.outer(ma - mean, ma - mean)) + wb * (cb + np.outer(mb - mean, mb - mean))
        assert np.allclose(m, mean, rtol=1e-5, atol=1e-5) and np.allclose(c, wide, rtol=1e-4, atol=1e-5 * wide.max())
        bound = 0.5 * (np.log(np.linalg.det(wide)) - wa * np.log(np.linalg.det(ca)) - wb * np.log(np.linalg.det(cb)))
        assert apart[k] == pytest.approx(bound, rel=1e-4, abs=1e-4) and bound > 0
    rays = np.random.default_rng(seed()).normal(size=(20_000, 3)).astype(np.float32)
    flat = np.zeros((len(rays), *a[:1, SH:].reshape(1, -1, 3).shape[1:]), np.float32)
    flat[:] = (a[0, SH:] - b[0, SH:]).reshape(-1, 3)
    seen = np.empty((len(rays), 3))
    flat[:, 0] += np.float32(100)  # no channel at its clamp
    colours(rays, flat, np.arange(len(rays)), np.zeros(3), seen)
    square = ((seen - 0.5 - 100 * SH_C0) ** 2).mean()
    assert lost[0] - apart[0] == pytest.approx(square / COLOUR**2, rel=0.05)


def test_merge() -> None:
    """Gaussians that lie twice at one place, each half as dense, become the one whose picture they have; others stay, bit for bit; what loses more than the
    limit stays."""
    scene = small(200)
    scene.opacities = np.minimum(scene.opacities, np.float32(0.9))
    values, cameras = Parameters.of(scene).values, look(scene, 3)
    halves = values.copy()
    opacity = 1 / (1 + np.exp(-values[:, LOGIT].astype(np.float64)))
    half = 1 - np.sqrt(1 - opacity)
    halves[:, LOGIT] = np.log(half / (1 - half))
    twins = np.concatenate([values[:50], np.repeat(halves[50:], 2, axis=0)])
    found = merge(twins, 1e-4)
    assert len(found) == 200 and found[:50].tobytes() == values[:50].tobytes()
    wanted = [render(Parameters(values), camera).image for camera in cameras]
    assert quality(Parameters(found), cameras, wanted) > 80
    other = twins.copy()
    other[51::2, SH] += np.float32(1.0)  # of one twin each, from 51 on
    assert len(merge(other, 1e-4)) == len(other)
    few = values[:9]  # all are neighbours
    least = min(loss(few[i : i + 1], few[k : k + 1])[0] for i in range(9) for k in range(i))
    assert merge(few, 0.999 * least).tobytes() == few.tobytes() and len(merge(few, 1.001 * least)) == 8
    assert len(merge(few[:1], 1.0)) == 1


def test_merging_in_a_reduction() -> None:
    """A row says what merging cost; the share that is kept is of the full scene; in a search for dB it stays only where the held-out views allow it."""
    scene = small(300)
    found = start(scene, keeping(0.3, merge=5.0, steps=0, last=0, degrees=0, refit=0), 7)
    found.run()
    full, merged, *_ = found.rows
    assert merged.step == "merging" and 90 < merged.gaussians < full.gaussians and merged.decibels < 60 and merged.cost is not None
    assert full.cost is not None and merged.cost.bytes < full.cost.bytes and len(found.parameters) == 90
    found = start(scene, keeping(1.0, merge=5.0, rounds=1, steps=2, last=0, degrees=0, refit=0), 7)  # nothing is removed
    found.run()
    assert len(found.parameters) == merged.gaussians and found.rows[2].decibels == merged.decibels < found.rows[-1].decibels
    for wanted in (merged.decibels - 1e-9, merged.decibels + 1e-9):
        found = start(scene, keeping(0.5, goal=Goal(Kind.DB, wanted), merge=5.0, steps=0, last=0, degrees=0, refit=0, frame=(32, 32)), 7)
        found.advance()
        assert len(found.good[0]) == (merged.gaussians if wanted < merged.decibels else full.gaussians)


# -- least squares --------------------------------------------------------------------------------------------------------------------


def test_matrix() -> None:
    """A picture changes with the coefficients as the matrix says; the transpose is the transpose, the squares are the diagonal of the product; masks hold."""
    scene = small(60, 2)
    scene.sh[:, 0] += 1.5  # no colour near its clamp
    parameters, camera = Parameters.of(scene), look(scene, 1)[0]
    frame = render(parameters, camera)
    mask = np.random.default_rng(seed()).random(frame.image.shape) < 0.8
    matrix = ViewMatrix.of(frame, mask)
    rng = np.random.default_rng(seed())
    x = rng.normal(size=parameters.sh.shape) * 0.1
    moved = Parameters(parameters.values.copy())
    moved.values[:, SH:] += x.reshape(len(x), -1).astype(np.float32)
    assert np.abs(matrix.forward(x) - np.where(mask, render(moved, camera).image - frame.image, 0)).max() < 1e-5
    y, back = rng.normal(size=frame.image.shape), np.zeros(x.shape)
    matrix.back(y, back)
    assert (matrix.forward(x) * y).sum() == pytest.approx((x * back).sum(), rel=1e-6)
    diagonal = np.zeros(x.shape)
    matrix.back(y, diagonal, square=True)
    for at in ((0, 0, 0), (17, 3, 1), (40, 8, 2)):
        one = np.zeros(x.shape)
        one[at] = 1
        assert (matrix.forward(one) ** 2).sum() == pytest.approx(diagonal[at], rel=1e-5, abs=1e-12)


def test_refit() -> None:
    """Colours that were changed come back from the pictures; coefficients that may not change stay; what does not help is not taken."""
    scene = small(150)
    parameters, cameras = Parameters.of(scene), look(scene, 8)
    pictures = [render(parameters, camera).image.astype(np.float32) for camera in cameras]
    wrong = Parameters(parameters.values.copy())
    wrong.values[:, SH:] += np.random.default_rng(seed()).normal(scale=0.1, size=wrong.values[:, SH:].shape).astype(np.float32)
    free = (1e-4,) * 4
    before, found = quality(wrong, cameras, pictures), refit(wrong, cameras, pictures, ridge=free)
    assert quality(found, cameras, pictures) > before + 15 and np.array_equal(found.values[:, :SH], wrong.values[:, :SH])
    held = refit(wrong, cameras, pictures, np.ones(len(wrong), np.int64), ridge=free)
    assert np.array_equal(held.sh[:, 1:], wrong.sh[:, 1:]) and before < quality(held, cameras, pictures) < quality(found, cameras, pictures)
    assert refit(parameters, cameras, pictures, ridge=(1e9,) * 4) is parameters


def test_slope() -> None:
    """The derivative of the logarithm of the squared error, by central differences."""
    rng = np.random.default_rng(seed())
    image, wanted = rng.uniform(0.1, 0.9, (2, 5, 6, 3))
    error, slope = log_error_slope(image, wanted)
    assert error == pytest.approx(((image - wanted) ** 2).mean())
    step = np.zeros_like(image)
    step[2, 3, 1] = 1e-6
    wide = (np.log(log_error_slope(image + step, wanted)[0]) - np.log(log_error_slope(image - step, wanted)[0])) / 2e-6
    assert slope[2, 3, 1] == pytest.approx(wide, rel=1e-5)


# -- SH degrees -----------------------------------------------------------------------------------------------------------------------


def test_losses() -> None:
    """What a degree is worth is what the picture changes by without it; from one direction the mean in the constant term makes up for all of it."""
    scene = small(60, 2)
    scene.sh[:, 0] += 2.0
    parameters, cameras = Parameters.of(scene), look(scene, 4)
    one = losses(parameters, cameras[:1])
    seen = scores(parameters, cameras[:1]).weight > 0
    assert one.error.max() < 1e-9 and np.abs(one.shift[seen]).max() > 0.1
    lost = losses(parameters, cameras)
    assert (lost.error[:, 0] >= 0).all() and lost.error[:, 0].sum() > lost.error[:, 1].sum() > 0
    for i, degree in ((3, 0), (20, 1), (41, 0)):
        less, coefficients = Parameters(parameters.values.copy()), np.full(60, 9)
        found = cuts(less, coefficients, lost, np.ones(60))
        found = replace(found, members=[np.array([i])], degree=np.array([degree]))
        cut(less, coefficients, lost, found, np.array([0]))
        assert coefficients[i] == (degree + 1) ** 2 and (less.sh[i, coefficients[i] :] == 0).all() and coefficients.sum() == 59 * 9 + coefficients[i]
        change = sum(((render(less, c).image - render(parameters, c).image) ** 2).sum() for c in cameras)
        assert lost.error[i, degree] == pytest.approx(change, rel=0.02, abs=1e-9)


def test_cuts() -> None:
    """By cluster, dearer by byte from one cut of a cluster to its next; what says nothing costs nothing."""
    scene = small(700, 2)
    scene.sh[:, 4:] = 0
    parameters, coefficients = Parameters.of(scene), np.full(700, 9)
    lost = losses(parameters, look(scene, 4))
    found = cuts(parameters, coefficients, lost, np.ones(700))
    assert [len(m) for m in found.members] == [256, 256, 256, 256, 188, 188] and found.degree.tolist() == [1, 0] * 3
    assert (found.error[::2] == 0).all() and (found.error[1::2] > 0).all() and found.bytes.tolist() == [3840, 2304, 3840, 2304, 2820, 1692]
    cut(parameters, coefficients, lost, found, np.array([0, 2, 3, 4]))
    assert np.bincount(coefficients).tolist() == [0, 256, 0, 0, 444]
    again = cuts(parameters, coefficients, losses(parameters, look(scene, 4)), np.ones(700))
    assert again.degree.tolist() == [0, 0] and [len(m) for m in again.members] == [256, 188]


# -- bits of SH codes -----------------------------------------------------------------------------------------------------------------


def test_bits_by_cluster() -> None:
    """Pictures lose no more than is stated, and bytes fall with what they may lose; bits go first where coefficients say nothing, and what no camera sees
    keeps 8."""
    scene = small(1200, 2)
    order, begin = cluster_order(scene.means, 100, np.inf)[:2]
    scene = reorder(scene, order)
    scene.sh[:100, 1:] *= np.float32(1e-4)
    scene.opacities[-100:] = 1e-3
    cameras = look(scene, 6)
    sizes = []
    for decibels in (75.0, 55.0, 40.0):
        found = choose(scene, begin, cameras, decibels)
        assert found.views == 6 and decibels <= found.decibels and found.bits[-1] == 8
        base, drawn = (Parameters.of(replace(scene, sh=coded_sh(scene, begin, bits)[0])) for bits in (np.full(len(begin), 8), found.bits))
        lost = np.mean([((np.clip(render(base, c).image, 0, 1) - np.clip(render(drawn, c).image, 0, 1)) ** 2).mean() for c in cameras])
        assert -10 * np.log10(lost) == pytest.approx(found.decibels, abs=1e-6)
        sizes.append(int(found.bits.sum()))
        if decibels < 75:
            assert found.bits[0] == 3
    assert sizes[0] > sizes[1] > sizes[2]
    assert set(choose(scene, begin, cameras, 400.0).bits) == {8}


# -- reductions -----------------------------------------------------------------------------------------------------------------------


def test_keep() -> None:
    """As many as wanted stay, better than by removal alone, and no step makes the held-out views worse but removal and the cut of coefficients."""
    scene = small()
    found = start(scene, keeping(0.5, last=60))
    found.run()
    small_ = found.scene()
    assert len(small_) == 200 == len(found.parameters) and found.removed == 0
    names = [row.step for row in found.rows]
    assert names == ["full scene", "1: removal", "1: tuning", "2: removal", "2: tuning", "SH coefficients", "least squares", "tuning, 60 steps"]
    by = {row.step: row.decibels for row in found.rows}
    assert by["1: tuning"] >= by["1: removal"] > by["2: removal"] and by["2: tuning"] >= by["2: removal"]
    assert by["tuning, 60 steps"] >= by["least squares"] >= by["SH coefficients"]
    best = scores(Parameters.of(scene), found.fitted)
    order = np.sort(np.argsort(-best.change)[:200])
    alone = quality(Parameters(Parameters.of(scene).values[order]), found.held, found.wanted_held)
    assert found.rows[-1].decibels > alone + 1
    assert np.mean(reference_psnr(scene, small_, found.held)) == pytest.approx(found.rows[-1].decibels, abs=0.01)
    first, last = found.rows[0].cost, found.rows[-1].cost
    assert first and last and last.bytes < first.bytes and last.image_bytes < first.image_bytes and (last.lane_cycles or 0) > 0


def test_rates_of_a_reduction(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps are the longest at the beginning of every tuning, after a removal and at the end, and fall evenly, in logarithms, to a twentieth."""
    asked: list[float] = []

    def step(parameters, moments, camera, wanted, rates, *rest):
        asked.append(float(rates[SCALE]))
        return 20.0, np.zeros(0, np.int64)

    monkeypatch.setattr("flicker.budget.reduce.tune_step", step)
    start(small(100), keeping(0.3, rounds=2, steps=3, last=5, degrees=0, refit=0, frame=(32, 32)), 7).run()
    wanted = [Rates().scale * 20 ** -(k / steps) for steps in (3, 3, 5) for k in range(steps)]
    assert asked == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(("gains", "ends"), [([2, 7], 1300), ([2, 7, 12], 1600), ([2, 7, 12, 15, 18], 1999)])
def test_end_of_the_last_tuning(gains: list[int], ends: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Four measurements without gain end it, but only in its second half: long steps lose what the shorter ones then win back. gains: measurements that are
    better than all before."""
    found = start(small(), keeping(0.5, last=1999))
    found._keep_best(20.0)
    found.phase, measured = Phase.LAST, 0

    def tune(rates: Rates, done: float) -> None:
        found.step += 1

    def measure() -> float:
        nonlocal measured
        measured += 1
        return 20.0 + 0.1 * measured if measured in gains else 20.0 if measured > 1 else 10.0

    monkeypatch.setattr(found, "_tune", tune)
    monkeypatch.setattr(found, "measure", measure)
    while found.phase is Phase.LAST:
        found.advance()
    assert found.phase is Phase.DONE and found.rows[-1].step == f"tuning, {ends} steps"
    assert found.best is not None and found.best[2] == 20.0 + 0.1 * gains[-1]


def test_through() -> None:
    """All Gaussians, drawn through a contribution test: measured and tuned as the machine draws them, which wins back a part of what it loses."""
    scene = small(600)
    options = keeping(1.0, rounds=1, steps=0, last=100, degrees=0, through="flicker-sparse-fixed-factored")
    found = start(scene, options)
    found.run()
    assert len(found.parameters) == 600
    first, removal, *_, last = (row.decibels for row in found.rows)
    machine = found.machine
    assert machine is not None and first == removal == pytest.approx(np.mean(machine_psnr(scene, found.held, found.wanted_held, machine)), abs=0.05)
    assert last > first + 0.05 and last == pytest.approx(np.mean(machine_psnr(found.scene(), found.held, found.wanted_held, machine)), abs=0.05)
    assert np.mean(reference_psnr(scene, found.scene(), found.held)) != pytest.approx(last, abs=0.05)


def test_least() -> None:
    """No Gaussian of the small scene is smaller than asked for, some would be; the full scene's row is the full scene's. No least squares where none are
    asked for."""
    scene = small()
    for least in (0.0, 1.0):
        found = start(scene, keeping(0.5, least=least, refit=0))
        found.run()
        below = found.parameters.log_scales.min(axis=1) < np.log(samples.least_scales(found.parameters.means, found.fitted, 1.0)) - 1e-4
        assert below.any() == (least == 0.0) and found.rows[0].decibels == float("inf") and len(found.parameters) == 200
        assert "least squares" not in {row.step for row in found.rows}
    # Sizes are held, too, where no removal reaches the goal and all Gaussians come back.
    found = start(scene, keeping(0.5, goal=Goal(Kind.DB, 150.0), steps=2, last=2, least=1.0, refit=0))
    found.run()
    assert (found.parameters.log_scales.min(axis=1) > np.log(samples.least_scales(found.parameters.means, found.fitted, 1.0)) - 1e-4).all()


@pytest.mark.parametrize("goal", [Goal(Kind.KEEP, 0.5), pytest.param(Goal(Kind.DB, 45.0), marks=pytest.mark.slow)])
def test_interrupted(goal: Goal, tmp_path: Path) -> None:
    """Continued from any of its checkpoints, a run ends with the same bits and the same table."""
    scene, options = small(150), keeping(0.5, goal=goal, steps=4, last=8, degrees=0.1, frame=(32, 32), merge=0.5)
    whole = start(scene, options, 7)
    states: list[Path] = []

    def kept() -> None:
        states.append(tmp_path / f"{len(states)}.npz")
        whole.save(states[-1])

    seen = set()
    while whole.phase is not Phase.DONE:
        before = whole.phase
        whole.advance()
        if whole.phase not in (before, Phase.DONE) and (before, whole.phase) not in seen or whole.step == 3:
            seen.add((before, whole.phase))
            kept()
    assert {phase for pair in seen for phase in pair} >= {Phase.MERGE, Phase.REMOVE, Phase.TUNE, Phase.DEGREES, Phase.REFIT, Phase.LAST}
    for state in states[:: 2 if goal.kind is Kind.KEEP else 5]:
        other = start(scene, options, 7)
        other.restore(state)
        other.run()
        assert other.parameters.values.tobytes() == whole.parameters.values.tobytes() and other.rows == whole.rows, state
    with pytest.raises(FlickerError, match="has steps 4, not 5"):
        start(scene, replace(options, steps=5), 7).restore(states[0])
    with pytest.raises(FlickerError, match="is of another scene"):
        start(small(151), options, 7).restore(states[0])
    with pytest.raises(FlickerError, match="is of another view"):
        start(scene, options, 13).restore(states[0])
    states[0].write_bytes(states[0].read_bytes()[:300])
    with pytest.raises(FlickerError, match="not a checkpoint"):
        start(scene, options, 7).restore(states[0])


def test_decibels() -> None:
    """As few as reach the wanted quality; a few less do not."""
    found = start(small(), keeping(0.5, goal=Goal(Kind.DB, 36.0), steps=6, last=6, frame=(32, 32)), 7)
    found.run()
    assert found.rows[-1].decibels >= 36.0 and len(found.parameters) < 380
    tried = [row for row in found.rows if row.step.endswith("tuning")]
    assert min(row.gaussians for row in tried if row.decibels < 36.0) > 0.9 * len(found.parameters)


@pytest.mark.parametrize(("kind", "share"), [(Kind.MBYTES, 0.6), (Kind.CYCLES, 0.7)])
def test_chip(kind: Kind, share: float) -> None:
    """No more than the wanted bytes or cycles, and not much less; bytes take SH coefficients, too."""
    scene = small(2000)
    scene.sh[:, 1:] *= np.float32(0.05)
    found = start(scene, keeping(0.5, goal=Goal(kind, 1.0)), 6)
    full = found.frame_cost()
    goal = Goal(kind, full.fixed(kind) + share * (full.of(kind) - full.fixed(kind)))
    found = start(scene, keeping(0.5, goal=goal, degrees=0.0, steps=4, last=4), 6)
    found.run()
    cost = found.rows[-1].cost
    assert cost is not None and 0.85 * goal.value < cost.of(kind) <= goal.value, (cost, goal)
    assert (found.coefficients < 4).any() == (kind is Kind.MBYTES)
    if kind is Kind.MBYTES:
        with pytest.raises(FlickerError, match="--mbytes: 1e-05: the picture alone takes"):
            start(scene, keeping(0.5, goal=Goal(kind, 1e-5)), 6).run()


def test_poison() -> None:
    """Gaussians that overflow in themselves or in a view are left out before, those that go bad on the way are taken out; the rest is as without them."""
    scene = small(200)
    bad = {3: ("means", np.nan), 50: ("scales", np.inf), 90: ("sh", 1e30), 130: ("means", np.inf), 160: ("quats", np.nan)}
    poisoned = replace(scene, **{name: getattr(scene, name).copy() for name in ("means", "scales", "quats", "sh")})
    for i, (name, value) in bad.items():
        getattr(poisoned, name)[i] = value
    cameras = look(scene, 3)
    with np.errstate(all="ignore"):
        clean, pictures, count = sound(poisoned, cameras)
    kept = np.setdiff1d(np.arange(200), list(bad))
    assert count == 5 and np.array_equal(clean.means, scene.means[kept]) and all(np.isfinite(picture).all() for picture in pictures)
    found = start(clean, keeping(0.5))
    while found.phase is not Phase.LAST or found.step < 3:
        found.advance()
    found.parameters.values[7, 0], found.parameters.values[11, LOGIT], found.moments.second[20, SH] = np.nan, np.nan, np.nan
    found.best = None if found.best is None else (found.parameters.values.copy(), *found.best[1:])  # the bad ones are in what is returned to, too
    found.run()
    assert np.isfinite(found.scene().means).all() and len(found.scene()) <= 96 and np.isfinite(found.rows[-1].decibels)
    with pytest.raises(FlickerError, match="no Gaussian whose numbers are finite"):
        sound(replace(scene, means=np.full_like(scene.means, np.nan)), cameras)


def test_views(tmp_path: Path) -> None:
    """Every sixth is held out; orbits have several distances and heights; files are resized, and say what is wrong with them."""
    scene = small()
    fitted, held = cameras_of(scene)
    assert (len(fitted), len(held)) == (120, 24) and HOLD_EVERY == 6
    middle = np.mean([c.position for c in [*fitted, *held]], axis=0)
    distances = [np.linalg.norm(c.position - middle) for c in held]
    assert max(distances) > 1.3 * min(distances) and np.ptp([c.position[1] for c in held]) > 0.3
    other, _ = cameras_of(scene, seed=2)
    assert not np.allclose(other[0].position, fitted[0].position)
    path = tmp_path / "cameras.json"
    path.write_text(cameras_text(look(scene, 7)))
    fitted, held = cameras_of(scene, path, size=(24, 20))
    assert (len(fitted), len(held), fitted[0].width) == (5, 2, 24)
    path.write_text(cameras_text(look(scene, 2)))
    with pytest.raises(FlickerError, match="cameras.json: 2 cameras: at least 3"):
        cameras_of(scene, path)
    with pytest.raises(FlickerError, match="only orbit cameras can be turned"):
        cameras_of(scene, path, up="y")


# -- files and the command ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "least"), [("a.ply", 100), ("a.compressed.ply", 40), pytest.param("a.spz", 40, marks=pytest.mark.slow), ("a.flk", 40)])
def test_files(name: str, least: float, tmp_path: Path) -> None:
    scene = small(600, 2)
    scene.scales *= np.float32(0.5)
    scene.sh[scene.means[:, 0] < 0, 1:] = 0
    scene.opacities[:5] = 1.0  # has no logit
    save(scene, tmp_path / name, tmp_path / f"temporary.{name}")
    (tmp_path / f"temporary.{name}").rename(tmp_path / name)
    found = load_scene(tmp_path / name)
    assert len(found) == 600 and min(reference_psnr(scene, found, look(scene, 3))) > least
    if name.endswith(".flk"):
        assert load_packed(tmp_path / name).image() == pack(scene, PackedFormat.CHUNK).packed.image() and chip_cost(
            scene, look(scene, 1, FRAME), PackedFormat.CHUNK).image_bytes == len((tmp_path / name).read_bytes())


def test_command(tmp_path: Path) -> None:
    """A file with bad Gaussians to a share; the same bits after an interruption; what is refused, and that nothing is left of it."""
    scene = small()
    scene.means[5, 0], scene.sh[9, 0, 1] = np.nan, np.inf
    save_ply(scene, tmp_path / "in.ply")
    few = ("--count", 6, "--size", "48x40", "--frame", "96x64", "--rounds", 2, "--steps", 3, "--last", 6)

    def run(*more: object, code: int = 0) -> str:
        done = flicker("budget", tmp_path / "in.ply", "-o", tmp_path / "out.ply", *more)
        assert done.returncode == code, done.stderr
        return done.stdout if code == 0 else done.stderr

    told = run("--keep", 0.4, *few, "--json", tmp_path / "a.json", "--checkpoint", tmp_path / "state.npz")
    assert "2 Gaussians were left out" in told and "what each step gave" in told and "PSNR of the file" in told and "at 96x64, mean" in told
    kept, written = json.loads((tmp_path / "a.json").read_text()), (tmp_path / "out.ply").read_bytes()
    assert kept["gaussians"] == [398, 159] and kept["left_out"] == 2 and len(load_scene(tmp_path / "out.ply")) == 159
    assert kept["steps"][0]["decibels"] is None and kept["steps"][-1]["cost"]["bytes"] < kept["steps"][0]["cost"]["bytes"]
    curve = Curve.load(tmp_path / "a.json")
    assert curve.title == "in" and [point.kept for point in curve.points][-1] == pytest.approx(159 / 398) and len(curve.points) == 3
    (tmp_path / "b.json").write_text(json.dumps(kept | {"steps": [{}]}))
    with pytest.raises(FlickerError, match="b.json: not what flicker budget --json writes .KeyError: 'decibels'"):
        Curve.load(tmp_path / "b.json")
    told = run("--keep", 0.4, *few, "--checkpoint", tmp_path / "state.npz", "--resume")
    assert "continues after 8 steps" in told and (tmp_path / "out.ply").read_bytes() == written
    assert Row(**kept["steps"][1]).step == "1: removal"
    told = run("--keep", 0.9, *few, "--through", "faithful", "--merge", 0.5, "--json", tmp_path / "c.json")
    assert "merging" in told
    drawn = json.loads((tmp_path / "c.json").read_text())["drawn_db"]
    assert f"{np.mean(drawn['scene']):.2f} dB, the full scene {np.mean(drawn['full']):.2f} dB" in told
    before = sorted(tmp_path.iterdir())
    for wrong, text in (
        ((), "one is needed, not none"), (("--keep", 0.4, "--db", 40), "one is needed, not --keep and --db"), (("--keep", 1.4), "--keep: 1.4 is not above 0"),
        (("--db", "nan"), "--db: nan is not a positive number"), (("--mbytes", -3), "--mbytes: -3 is not a positive number"),
        (("--keep", 0.4, "--views", tmp_path / "no.json"), "no.json: cannot be read"),
        (("--keep", 0.4, "--views", tmp_path / "a.json", "--count", 9), "--count: all cameras of"), (("--keep", 0.4, "--size", "ab"), "--size"),
        (("--keep", 0.4, "--up", "w"), "up: 'w'"), (("--keep", 0.4, "-o", tmp_path / "a.sog"), "gsply writes no SOG"),
        (("--keep", 1, "--through", "log-lanes"), "its masks are not of 4x4"),
        (("--keep", 0.4, "-o", tmp_path / "no" / "a.ply"), "no such folder"), (("--keep", 0.4, "--frame", "0x9"), "width"),
    ):
        said = run(*wrong, code=2)
        assert text in said and said.count("\n") == 1, said
    assert sorted(tmp_path.iterdir()) == before
