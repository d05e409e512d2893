"""Area and energy: the parts add up to what was synthesised, energies are the counts times what an operation costs.

That area and energy are right in silicon is not covered; operators that no constant was chosen by are held against published figures.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scene_samples import random_scene

from flicker.cost import area, energy
from flicker.cost.area import ctu_area, fifo_area, generator_area, part, stage_parts, vru_area
from flicker.cost.synth import run as run_synthesis
from flicker.cost.synth.gates import DEFAULT_LIBERTY
from flicker.cost.synth.liberty import Library
from flicker.errors import FlickerError
from flicker.explore.configurations import CONFIGURATIONS, get_configuration
from flicker.explore.evaluate import evaluate
from flicker.explore.machine import MaskGenerator
from flicker.front.view import View
from flicker.params import CORES
from flicker.scene.camera import orbit_camera

# What the rendering stage has beside its parts: for each core a count of the tokens in its mask generator, of two bits without an output FIFO.
CELLS = {name: cell.area for name, cell in Library(DEFAULT_LIBERTY).cells.items()}
TOKEN_BITS = 2
# GE, a core. AND2: a token enters (2) and leaves (2), sub-tile finished (3), carry, clear (2). XOR2: step of bits 0 and 1 up or down.
COUNT_GATES = TOKEN_BITS * CELLS["DFFR"] + 10 * CELLS["AND2_X1"] + 4 * CELLS["XOR2_X1"]
MODE_GATES = (2 + CORES) * CELLS["AND2_X1"]  # GE, with a contribution test only: finished is low in the automatic mode


@pytest.fixture(scope="module")
def view() -> View:
    scene = random_scene(7, 300, 0)
    camera = orbit_camera(scene, 0).resized(64, 48)
    return View(camera, scene)


# ---- area ---------------------------------------------------------------------------------------


def own_gates() -> float:
    """GE of the stage in none of its parts, where it has no contribution test."""
    return part("render_stage", "no CTU").ge - get_configuration("no-ctu-32").area()


def own_flip_flops(stage: str, core: str, generator: area.Part) -> int:
    parts = part("rendering_core", core).ff + generator.ff + part("perf_counters", "default").ff
    return part("render_stage", stage).ff - CORES * parts - part("stage_control", "default").ff


def test_own_gates():
    assert CORES * TOKEN_BITS * CELLS["DFFR"] < own_gates() <= CORES * COUNT_GATES
    for stage, core in (("no CTU", "factored"), ("no CTU, 64 VRUs", "factored, 4 VRUs")):
        assert own_flip_flops(stage, core, part("mask_all", "default")) == CORES * TOKEN_BITS


@pytest.mark.parametrize("form", ["conic", "factored"])
@pytest.mark.parametrize("precision", ["fixed", "fp16", "mixed", "fp8"])
def test_rtl_stage_is_what_was_synthesised(form, precision):
    parts = sum(stage_parts(form, ctu_area(form, precision)).values())
    assert 0 < part("render_stage", f"{form} {precision}").ge - parts - own_gates() <= MODE_GATES
    assert own_flip_flops(f"{form} {precision}", form, part("ctu", f"{form} {precision}")) == CORES * TOKEN_BITS


def test_faithful_stage():
    """The CTU's output FIFO is interpolated by width, so within 0.1 %."""
    assert get_configuration("faithful").area() == pytest.approx(part("render_stage", "faithful").ge, rel=1e-3)


def test_fifo_area():
    for depth in (4, 8, 16, 32, 64, 128):
        assert fifo_area(depth) == part("fifo", f"145 x {depth}").ge
    areas = [fifo_area(depth) for depth in range(0, 129)]
    assert areas[0] == 0 and np.all(np.diff(areas) > 0)
    assert fifo_area(16, 290) == pytest.approx(2 * fifo_area(16))
    with pytest.raises(FlickerError, match="depth"):
        fifo_area(-1)


def test_stage_without_generator_and_with_more_vrus():
    none = sum(stage_parts("factored").values())
    assert none == pytest.approx(get_configuration("flicker-dense-fp16-factored").area() - CORES * part("ctu", "factored fp16").ge)
    untested = none + CORES * part("mask_all", "default").ge
    assert untested == pytest.approx(get_configuration("no-ctu-32").area())
    assert get_configuration("no-ctu-64").area() + own_gates() == pytest.approx(part("render_stage", "no CTU, 64 VRUs").ge, abs=1)
    more = stage_parts("factored", vrus=64)
    assert more["VRUs"] == 64 * vru_area("factored", 4) and none < sum(more.values()) < 2 * none
    assert vru_area("factored", 4) < vru_area("factored", 8) == part("vru", "factored").ge < vru_area("factored", 16)
    assert vru_area("factored", 2) < vru_area("factored", 4) == part("vru", "factored, 4 pixels").ge
    for vrus, core in ((16, "factored, 1 VRU"), (64, "factored, 4 VRUs")):
        cores = sum(stage_parts("factored", vrus=vrus).values()) - CORES * part("perf_counters", "default").ge - part("stage_control", "default").ge
        assert cores == pytest.approx(CORES * part("rendering_core", core).ge)


def test_generators():
    """Every generator has an area; its estimate reproduces the CTU that it is scaled by, and is near the other FP16 CTU."""
    for c in CONFIGURATIONS.values():
        assert (c.generator.area() > 0) == (bool(c.generator.operations.per_element) or c.family in ("baseline", "lanes")), c.name
    factored, conic = (generator_area(get_configuration(f"flicker-dense-fp16-{form}").generator.operations) for form in ("factored", "conic"))
    assert factored == pytest.approx(part("ctu", "factored fp16").ge)
    assert conic == pytest.approx(part("ctu", "conic fp16").ge, rel=0.15)
    assert get_configuration("rows").area() > get_configuration("rows-minitile").area()


def test_bad_area_arguments():
    for make, message in (
        (lambda: stage_parts("round"), "unknown form 'round'"), (lambda: ctu_area("conic", "fp4"), "unknown precision 'fp4'"),
        (lambda: stage_parts("conic", vrus=33), "not 33"),
    ):
        with pytest.raises(FlickerError, match=message):
            make()


# ---- energy -------------------------------------------------------------------------------------


def test_constants_have_sources():
    names = {name for name in vars(energy) if re.fullmatch(r"[A-Z][A-Z0-9_]+", name)}
    imported = {"CHANNELS", "CORES", "PIXELS_PER_VRU", "RECORD_BITS", "VRUS_PER_CHANNEL", "SOURCES"}
    assert names - imported == set(energy.SOURCES)
    assert [value for _, value, _ in energy.constant_table()] == [getattr(energy, name) for name in energy.SOURCES]


# M. Horowitz, Computing's Energy Problem, ISSCC 2014: pJ in 45 nm at 0.9 V, one or two digits. Times 28/45 as everywhere in `energy`.
HOROWITZ = {"int add 8": 0.03, "int add 16": 0.05, "int add 32": 0.1, "float add 16": 0.4, "float mul 16": 1.1, "float add 32": 0.9, "float mul 32": 3.7}


def test_activity_is_what_its_source_says():
    """ACTIVITY was chosen by the FP16 multiplier and adder: with it they lie around the published figures. A check of that choice alone."""
    share = {unit: energy.switching_pj(part(f"fp_{unit}", "fp16").load) / (HOROWITZ[f"float {unit} 16"] * 28 / 45) for unit in ("mul", "add")}
    assert share["mul"] < 1 < share["add"] and share["mul"] * share["add"] == pytest.approx(1, rel=0.15)


@pytest.mark.parametrize("bits", [9, 12, 16, 20, 23])
def test_integer_adders_beside_published_figures(bits):
    """Operators by which nothing was chosen: integer adders, a fiftieth of the multiplier's energy. Straight lines between 8, 16 and 32 bits."""
    published = np.interp(bits, (8, 16, 32), [HOROWITZ[f"int add {n}"] for n in (8, 16, 32)]) * 28 / 45
    assert energy.switching_pj(part("op", f"add fixed {bits}").load) == pytest.approx(published, rel=1 / 3)


@pytest.mark.slow
def test_float32_beside_published_figures():
    """Our multiplier and adder as float32, which nothing in the design uses: synthesised here, four times the energy of those ACTIVITY was chosen by."""
    from doc_parts.areas import loads

    runner = run_synthesis.Runner(DEFAULT_LIBERTY)
    keys = {unit: runner.add(f"flk_fp_{unit}", {"ExpBits": 8, "ManBits": 23}) for unit in ("mul", "add")}
    runner.run_planned()
    for unit, key in keys.items():
        load = loads(run_synthesis.UNITS / key / "netlist.v", Library(DEFAULT_LIBERTY))["load"]
        assert energy.switching_pj(load) == pytest.approx(HOROWITZ[f"float {unit} 32"] * 28 / 45, rel=1 / 3)


def test_stage_energy_counts(view):
    """Parts are counters times energy per operation."""
    result = evaluate(view, "flicker-dense-fp16-factored")
    parts, counters = result.energy, result.counters
    assert set(parts) == {"VRUs", "feature FIFOs", "mask generators", "counters, arbiters", "ungated clock", "leakage"}
    assert all(value > 0 for value in parts.values())
    assert parts["VRUs"] == pytest.approx(2 * counters.channel("vru_busy").sum() * energy.vru_pj("factored") * 1e-6)
    assert parts["feature FIFOs"] == pytest.approx(counters.core("minitiles_delivered").sum() * energy.fifo_pj(16) * 1e-6)
    assert parts["mask generators"] == pytest.approx(2 * result.work.elements * energy.ctu_pj("factored", "fp16") * 1e-6)
    twice = result.configuration.energy(result.work, 2 * counters.cycles, counters)
    assert twice["VRUs"] == parts["VRUs"] and twice["ungated clock"] == pytest.approx(2 * parts["ungated clock"])
    register = part("mask_all", "default")
    off = evaluate(view, "no-ctu-32")
    per_element = energy.switching_pj(register.load) + energy.clock_pj(register.clock_gated)
    assert off.energy["mask generators"] == pytest.approx(off.work.elements * per_element * 1e-6)
    # The estimate by operators reproduces the unit that it is scaled by.
    generator = result.configuration.generator
    tested = int(result.work.test_cycles.sum())
    assert MaskGenerator.energy_pj(generator, result.work, tested) * 1e-6 == pytest.approx(parts["mask generators"])
    # An output FIFO takes what passes through it.
    held, buffered = (evaluate(view, name) for name in ("flicker-smooth-mixed-conic", "faithful"))
    more = int((buffered.work.mask != 0).sum()) * energy.fifo_pj(16, area.RECORD_BITS + 4) * 1e-6
    assert buffered.energy["mask generators"] - held.energy["mask generators"] == pytest.approx(more)


def test_less_work_takes_less_energy(view):
    """Pixel masks visit fewer pixels than mini-tile masks, these fewer than none."""
    found = {}
    for name in ("no-ctu-32", "oracle-minitile", "oracle"):
        result = evaluate(view, name)
        found[name] = result.energy
        issued = result.counters.channel("vru_busy").sum() * 2 if name != "oracle" else result.work.totals()["pixels_visited"]
        assert found[name]["VRUs"] == pytest.approx(issued * energy.vru_pj("factored") * 1e-6)
    assert found["oracle"]["VRUs"] < found["oracle-minitile"]["VRUs"] < found["no-ctu-32"]["VRUs"]
    share = energy.ratios(found, "no-ctu-32")
    assert share["no-ctu-32"] == 1 and share["oracle"] < share["oracle-minitile"] < 1
    with pytest.raises(FlickerError, match="no configuration 'x'"):
        energy.ratios(found, "x")


def test_memories():
    """Published points of the SRAM, in 28 nm; LPDDR4 by the bit."""
    assert energy.sram_pj(64, 8192) == pytest.approx(10 * 28 / 45)
    assert energy.sram_pj(64, 32768) == pytest.approx(20 * 28 / 45)
    assert energy.sram_pj(64, 1 << 20) == pytest.approx(100 * 28 / 45, rel=0.15)
    assert energy.memory_energy(1_000_000)["LPDDR4"] == pytest.approx(64)


def test_a_busy_unit_takes_no_less_than_what_is_counted(view: View) -> None:
    """Of the stage of lanes: each cycle all of it, against its events; in proportion to cycles."""
    found = evaluate(view, "log-lanes")
    stage = part("lane_stage", "32 lanes")
    most = energy.busy_energy(stage, found.row["cycles"])
    assert sum(found.energy.values()) < most
    assert energy.busy_energy(stage, 2 * found.row["cycles"]) == pytest.approx(2 * most)
    # pJ a cycle: half of 0.1 transitions of 1000 inputs, two of 30 clock pins, each 3 fF at 0.9 V
    unit = replace(stage, ge=0.0, load=1000.0, clock_free=10.0, clock_gated=20.0)
    assert energy.busy_energy(unit, 1_000_000) == pytest.approx((0.05 * 1000 + 30) * 3e-3 * 0.81)
    idle = energy.busy_energy(replace(stage, load=0.0, clock_free=0.0, clock_gated=0.0), 1_000_000)
    assert idle == pytest.approx(stage.ge * 2e-9 * 1e-3 * 1e6)  # leakage: 2 nW a gate, for a millisecond
