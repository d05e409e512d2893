"""What the paper claims, what is measured here, and whether it holds: every verdict is computed.

A claim has a measure per scene (means over its views, as the paper averages) and a condition. The paper's losses are against photographs. Where a view has
one, so are ours. Where it has none, `drop` stands in: the loss of PSNR that the error against the float64 reference would cause in a picture
that is already as far from its photograph as the paper's, if the two errors are uncorrelated; its verdicts say so.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from ..cost.area import in_table, part
from ..cost.chip_area import components, in_all, square_millimetres
from .collect import ViewResult, by_scene

PAPER_VANILLA_PSNR = 25.56  # dB, Fig. 3a: vanilla 3DGS against photographs
PAPER_PRUNED_PSNR = 25.99  # dB, Table 1: the pruned model, average


@dataclass(frozen=True)
class Verdict:
    """figure: of the paper. claim: its words, shortened. paper: its number. ours: title of the view to text. verdict: starts with
    `holds`, `does not hold here`, `published only` or `not evaluated`."""

    figure: str
    claim: str
    paper: str
    ours: dict[str, str]
    verdict: str

    @property
    def kind(self) -> str:
        """`yes`, `no`, `partly` or `open`."""
        if self.verdict.startswith("holds on"):
            return "partly"
        return "yes" if self.verdict.startswith("holds") else "no" if self.verdict.startswith("does not") else "open"


@dataclass(frozen=True)
class Claim:
    """measure: value of a view, or KeyError when a configuration it needs is not in this run. holds: condition. because: one line on a view in
    which it does not hold. unmeasured: of a claim about photographs, what to say where there are none. detail: the figures behind the value of a view."""

    figure: str
    text: str
    paper: str
    measure: Callable[[ViewResult], float]
    holds: Callable[[float], bool]
    rule: str
    form: str = "{:.2f}"
    because: Callable[[ViewResult], str] = field(default=lambda view: "")
    average: bool = False
    best: bool = False
    unmeasured: str = ""
    detail: Callable[[ViewResult], str] = field(default=lambda view: "")

    def verdicts(self, views: Sequence[ViewResult]) -> list[Verdict]:
        """One verdict over all scenes; a claim about photographs has one over those that have some, one over the others. An "up to" (`best`) is of
        single views."""
        if not self.unmeasured:
            return [self.judge(views if self.best else by_scene(views))]
        measured, others = (by_scene([v for v in views if v.photographed == there]) for there in (True, False))
        found = [replace(self, rule=f"{self.rule}, measured against photographs").judge(measured)] if measured else []
        return found + ([replace(self, rule=f"{self.rule}{self.unmeasured}").judge(others)] if others else [])

    def judge(self, views: Sequence[ViewResult]) -> Verdict:
        """The verdict over all views: over their mean (`average`), their best one (`best`), or each alone."""
        values: dict[str, float] = {}
        missing = asked = ""
        for view in views:
            try:
                values[view.title] = self.measure(view)
            except KeyError as error:
                missing = str(error.args[0])
        details = {view.title: self.detail(view) for view in views if view.title in values}
        ours = {title: self.form.format(v) + (f" ({details[title]})" if details[title] else "") for title, v in values.items()}
        if not values:
            return Verdict(self.figure, self.text, self.paper, {}, f"not evaluated: this run has no {missing}")
        if self.average or self.best:
            value = max(values.values()) if self.best else sum(values.values()) / len(values)
            kind = "largest" if self.best else "mean"
            if len(values) > 1:
                ours[kind] = self.form.format(value)
            if self.holds(value):
                return Verdict(self.figure, self.text, self.paper, ours, f"holds ({kind} {self.form.format(value)}; {self.rule})")
            asked = f"{kind} {self.form.format(value)}; "
            worst = [view for view in views if view.title in values]
            failed = {view.title for view in worst}
        else:
            failed = {title for title, v in values.items() if not self.holds(v)}
            worst = [view for view in views if view.title in failed]
        if not failed:
            return Verdict(self.figure, self.text, self.paper, ours, f"holds ({self.rule})")
        reasons = []
        for view in worst:
            with contextlib.suppress(KeyError):  # of a configuration that only the reason speaks of
                reasons += [f"{view.title}: {reason}"] if (reason := self.because(view)) else []
        why = "; ".join(reasons) or f"not {self.rule}"
        if len(failed) == len(values):
            return Verdict(self.figure, self.text, self.paper, ours, f"does not hold here, because {why} ({asked}asked for: {self.rule})")
        good = ", ".join(t for t in values if t not in failed)
        return Verdict(self.figure, self.text, self.paper, ours, f"holds on {good}; not on {', '.join(t for t in values if t in failed)}, "
                       f"because {why} (asked for: {self.rule})")


def drop(psnr_db: float, base_db: float) -> float:
    """PSNR lost by a picture at base_db from its photograph when an uncorrelated error of psnr_db is added."""
    return 10 * math.log10(1 + 10 ** ((base_db - psnr_db) / 10))


# -- measures -------------------------------------------------------------------------------------------------------------------------


def _psnr(view: ViewResult, name: str) -> float:
    return float(view.rows[name]["psnr_db"])


def _photo(view: ViewResult, name: str, key: str = "photo_psnr_db") -> float:
    """Of a configuration against the photograph; `FLOAT64`: of the reference."""
    if name == FLOAT64:
        return float(next(iter(view.rows.values()))["reference_" + key])
    return float(view.rows[name][key])


def test_loss(view: ViewResult, name: str, without: str, base_db: float) -> float:
    """PSNR that a configuration loses against another one: against the photograph, or at base_db by `drop` where there is none."""
    if view.photographed:
        return _photo(view, without) - _photo(view, name)
    return drop(_psnr(view, name), base_db) - (0.0 if without == FLOAT64 else drop(_psnr(view, without), base_db))


def _ssim_loss(view: ViewResult, name: str, without: str) -> float:
    """SSIM that it loses, against the photograph, or against float64 where there is none."""
    if view.photographed:
        return _photo(view, without, "photo_ssim") - _photo(view, name, "photo_ssim")
    return (1.0 if without == FLOAT64 else float(view.rows[without]["ssim"])) - float(view.rows[name]["ssim"])


def _cycles(view: ViewResult, name: str) -> float:
    return float(view.rows[name]["cycles"])


def _speed(view: ViewResult, name: str, other: str) -> float:
    """How many times faster `name` is than `other`."""
    return _cycles(view, other) / _cycles(view, name)


def _energy(view: ViewResult, name: str, other: str) -> float:
    """How many times less energy `name` takes than `other`."""
    return float(view.rows[other]["energy_uj"]) / float(view.rows[name]["energy_uj"])


def _extra(view: ViewResult, name: str, key: str) -> float:
    return float(view.rows[name][key])


def _interval(view: ViewResult, name: str) -> float:
    return float(view.facts["chip"][name]["interval_cycles"])


def _chip_energy(view: ViewResult, name: str) -> float:
    return float(view.facts["chip"][name]["energy_uj"])


# -- claims ---------------------------------------------------------------------------------------------------------------------------

DENSE, SPARSE, SMOOTH, SPIKY = (f"flicker-{mode}-mixed-conic" for mode in ("dense", "sparse", "smooth", "spiky"))
FAITHFUL = "faithful"
FLOAT64 = "float64"  # no configuration: the reference renderer
WIDE, NARROW = "flicker-smooth-fp16-conic", "flicker-smooth-fp8-conic"
NO_CTU, NO_CTU_64, GSCORE, VANILLA = "no-ctu-32-conic", "no-ctu-64-conic", "gscore-conic", "vanilla"


def _assumed(base_db: float) -> str:
    return f" at {base_db} dB, assumed uncorrelated errors; no photographs"


def _chain(*names: str) -> Callable[[ViewResult], str]:
    """PSNR and SSIM of configurations against the photographs, where there are some."""
    return lambda view: "" if not view.photographed else ", ".join(
        f"{name} {_photo(view, name):.2f} dB and {_photo(view, name, 'photo_ssim'):.4f}" for name in names)


def _loss_reason(name: str, without: str) -> Callable[[ViewResult], str]:
    """Why a loss is larger than asked for: the VRU's own share, or errors that follow the picture's."""
    def reason(view: ViewResult) -> str:
        if not view.photographed:
            return f"{name} is {_psnr(view, name):.1f} dB from float64" if without == FLOAT64 else _vru_noise(view)
        return f"{_photo(view, without):.2f} dB with {without}, {_photo(view, name):.2f} dB with {name}, which is {_psnr(view, name):.1f} dB from float64"

    return reason


def _vru_noise(view: ViewResult) -> str:
    return f"the VRU alone (FP16, conic, no test) is {_psnr(view, NO_CTU):.1f} dB from float64"


def _saved_loss(view: ViewResult) -> float:
    sparse, smooth = (test_loss(view, name, NO_CTU, PAPER_VANILLA_PSNR) for name in (SPARSE, SMOOTH))
    return 1 - smooth / sparse if sparse > 0 else math.nan


def _saved_leaders(view: ViewResult) -> float:
    dense, sparse, smooth = (_extra(view, name, "evaluations") for name in (DENSE, SPARSE, SMOOTH))
    return (dense - smooth) / (dense - sparse)


def _pixel_share(view: ViewResult) -> float:
    return _extra(view, DENSE, "visited_per_pixel") / _extra(view, VANILLA, "visited_per_pixel")


def _lowest(view: ViewResult) -> float:
    others = [_extra(view, name, "visited_per_pixel") for name in (VANILLA, NO_CTU, GSCORE)]
    return min(others) / _extra(view, DENSE, "visited_per_pixel")


def _ctu_load(view: ViewResult) -> float:
    pairs = view.facts["duplicates"]
    return 1 - pairs["8"] / (4 * pairs["16"])


def _growth(view: ViewResult) -> float:
    pairs = view.facts["duplicates"]
    return pairs["4"] / pairs["16"]


def _sent_share(view: ViewResult) -> float:
    return _extra(view, FAITHFUL, "minitiles_sent") / _extra(view, VANILLA, "minitiles_masked")


def _fifo_gain(view: ViewResult) -> float:
    cycles = view.facts["fifo"]["cycles"]
    return cycles[0] / cycles[-1]


def _fifo_16(view: ViewResult) -> float:
    fifo = view.facts["fifo"]
    return fifo["cycles"][-1] / fifo["cycles"][fifo["depth"].index(16)]


def _fifo_falls(view: ViewResult) -> float:
    rates = view.facts["fifo"]["stall_rate"]
    return max(b - a for a, b in zip(rates, rates[1:]))


def _work_ratio(view: ViewResult, name: str, other: str) -> str:
    ratio = _extra(view, other, "minitiles_sent") / _extra(view, name, "minitiles_sent")
    return f"the VRUs of {other} are sent {ratio:.2f} times the mini-tiles of {name}"


def _no_ctu_reason(view: ViewResult) -> str:
    less = _extra(view, NO_CTU, "elements") / _extra(view, GSCORE, "elements")
    return f"oriented boxes make the lists {less:.2f} times shorter and twice the VRUs can give 2, so {2 * less:.1f} is what both explain"


def _match_reason(view: ViewResult) -> str:
    rows = view.rows[FAITHFUL]
    return f"{_work_ratio(view, FAITHFUL, GSCORE)}, and half the VRUs need 2; channels are unequal ({rows['imbalance']:.2f}), CTU stalled " \
        f"{view.rows[FAITHFUL]['ctu_stall_rate']:.0%} of the cycles"


def _sparse_reason(view: ViewResult) -> str:
    rows = view.rows[SMOOTH]
    return f"with {SMOOTH} the CTU takes {rows['test_cycles'] / max(rows['elements'], 1):.2f} cycles an element and VRUs are busy " \
        f"{rows['vru_utilisation']:.0%} of the time: testing is hardly the limit"


def _system_reason(view: ViewResult) -> str:
    return ", ".join(f"{name} limited by {view.facts['chip'][name]['bottleneck']}" for name in (FAITHFUL, GSCORE))


def claims() -> list[Claim]:
    """All claims that can be checked here, in the order of the paper. Those about losses are measured where there are photographs."""
    return [
        Claim("3a", "Uniform-Dense: negligible loss, 0.08 dB against vanilla at 25.56 dB", "0.08 dB",
              lambda v: test_loss(v, DENSE, NO_CTU, PAPER_VANILLA_PSNR), lambda x: x <= 0.08, "at most 0.08 dB", "{:.3f} dB",
              _loss_reason(DENSE, NO_CTU), unmeasured=_assumed(PAPER_VANILLA_PSNR), detail=_chain(NO_CTU, DENSE)),
        Claim("3a", "Uniform-Sparse: noticeable degradation", "shown", lambda v: test_loss(v, SPARSE, NO_CTU, PAPER_VANILLA_PSNR),
              lambda x: x > 0.08, "more than 0.08 dB", "{:.3f} dB",
              lambda v: f"splats are few or large: {SPARSE} is still {_psnr(v, SPARSE):.1f} dB from float64", unmeasured=_assumed(PAPER_VANILLA_PSNR),
              detail=_chain(NO_CTU, SPARSE)),
        Claim("3a", "Smooth-Focused loses 73 % less than Uniform-Sparse", "73 %", _saved_loss, lambda x: x >= 0.63, "at least 63 %", "{:.0%}",
              lambda v: f"spiky splats carry the picture: {SPIKY} has {_psnr(v, SPIKY):.1f} dB, {SMOOTH} {_psnr(v, SMOOTH):.1f} dB against float64",
              unmeasured=_assumed(PAPER_VANILLA_PSNR), detail=_chain(NO_CTU, SPARSE, SMOOTH)),
        Claim("3a", "Smooth-Focused retains 57 % of Uniform-Sparse's savings of leader pixels", "57 %", _saved_leaders, lambda x: x >= 0.47,
              "at least 47 %", "{:.0%}", lambda v: f"{1 - _saved_leaders(v):.0%} of the stream's elements are smooth and tested densely"),
        Claim("3a", "Smooth-Focused has a higher PSNR than Spiky-Focused", "shown", lambda v: _psnr(v, SMOOTH) - _psnr(v, SPIKY), lambda x: x > 0,
              "difference above 0 dB", "{:+.2f} dB", lambda v: f"{_saved_leaders(v):.0%} of the stream's elements are spiky; the paper foresees "
              "Spiky-Focused for such scenes"),
        Claim("4", "Mini-Tile CAT with 4 leaders: each pixel processes 10 % of the Gaussians of AABB on 16x16", "10 %", _pixel_share,
              lambda x: x <= 0.12, "at most 12 %", "{:.1%}", lambda v: f"{_extra(v, VANILLA, 'visited_per_pixel'):.0f} Gaussians a pixel on 16x16, "
              f"{_extra(v, DENSE, 'visited_per_pixel'):.0f} with the test, {_extra(v, DENSE, 'contributing_per_pixel'):.0f} contribute"),
        Claim("4", "Mini-Tile CAT is the lowest of all tested methods", "lowest", _lowest, lambda x: x > 1, "ratio to the next above 1", "{:.2f}x"),
        Claim("4", "A sub-tile AABB first reduces the CTU's load by 30 %", "30 %", _ctu_load, lambda x: x >= 0.3, "at least 30 %, same boxes", "{:.0%}",
              lambda v: "large splats cover whole tiles"),
        Claim("4", "Tiles of 4x4 instead of 16x16: 4 times the duplicated Gaussians", "4x", _growth, lambda x: 3 <= x <= 5, "3 to 5 times", "{:.2f}x",
              lambda v: f"splats here are {'larger' if _growth(v) > 5 else 'smaller'}: {v.facts['duplicates']['16'] / max(v.facts['duplicates']['visible'], 1):.1f} "
              "tiles of 16x16 each; for very large ones the factor tends to 16"),
        Claim("6", "Hierarchical testing leaves about 10 % of the Gaussians of AABB on 16x16", "10 %", _sent_share, lambda x: x <= 0.12, "at most 12 %, "
              "mini-tiles of the faithful configuration", "{:.1%}", lambda v: f"mini-tiles sent are {_sent_share(v):.0%}"),
        Claim("7c", "Mixed precision maintains quality", "shown", lambda v: test_loss(v, SMOOTH, WIDE, PAPER_PRUNED_PSNR), lambda x: x <= 0.1,
              "at most 0.1 dB below full FP16", "{:.3f} dB",
              lambda v: f"terms of the conic form cancel in E4M3 ({_psnr(v, WIDE):.1f} dB with FP16, {_psnr(v, SMOOTH):.1f} dB mixed, against float64)",
              unmeasured=_assumed(PAPER_PRUNED_PSNR), detail=_chain(WIDE, SMOOTH)),
        Claim("7c", "Full FP8: severe degradation", "shown", lambda v: _psnr(v, SMOOTH) - _psnr(v, NARROW), lambda x: x >= 3,
              "at least 3 dB below mixed, against float64", "{:.1f} dB", lambda v: f"FP8 coordinates are relative to the sub-tile here, so pixels are exact "
              f"and only means are coarse: {_psnr(v, NARROW):.1f} dB"),
        Claim("8a", "FLICKER without CTU (32 VRUs) is 4 times slower than GSCore (64 VRUs)", "4x", lambda v: _speed(v, GSCORE, NO_CTU),
              lambda x: 3 <= x <= 5, "3 to 5 times", "{:.2f}x", _no_ctu_reason),
        Claim("8a", "The CTU makes it 4 times faster", "4x", lambda v: _speed(v, FAITHFUL, NO_CTU), lambda x: x >= 3, "at least 3 times", "{:.2f}x",
              lambda v: _work_ratio(v, FAITHFUL, NO_CTU)),
        Claim("8a", "With 32 VRUs FLICKER matches GSCore with 64", "1x", lambda v: _speed(v, FAITHFUL, GSCORE), lambda x: x >= 0.9, "at least 0.9 times",
              "{:.2f}x", _match_reason),
        Claim("8a", "Uniform-Sparse gives a further 1.1x", "1.1x", lambda v: _speed(v, SPARSE, SMOOTH), lambda x: x >= 1.05, "at least 1.05 times",
              "{:.2f}x", _sparse_reason),
        Claim("8b", "Rendering stage: up to 1.6 times less energy than GSCore", "1.6x", lambda v: _energy(v, FAITHFUL, GSCORE), lambda x: x >= 1.5,
              "at least 1.5 times on the best view", "{:.2f}x", lambda v: _work_ratio(v, FAITHFUL, GSCORE), best=True),
        Claim("9", "FIFO depth 128 is 1.36 times faster than depth 1", "1.36x", _fifo_gain, lambda x: 1.2 <= x <= 1.6, "1.2 to 1.6 times", "{:.2f}x",
              lambda v: f"stall rate at depth 1 is {v.facts['fifo']['stall_rate'][0]:.0%}, at 128 {v.facts['fifo']['stall_rate'][-1]:.0%}"),
        Claim("9", "Depth 16 has 96 % of the speed of depth 128", "96 %", _fifo_16, lambda x: x >= 0.94, "at least 94 %", "{:.1%}",
              lambda v: f"channels stay unequal over long stretches ({_extra(v, FAITHFUL, 'imbalance'):.2f} within a sub-tile), deeper FIFOs even that out"),
        Claim("9", "Deeper FIFOs stall the CTU less", "shown", _fifo_falls, lambda x: x <= 0.002, "no step rises by more than 0.2 points", "{:+.2%}"),
        Claim("10a", "Whole system: 1.1 times faster than GSCore on average", "1.1x", lambda v: _interval(v, GSCORE) / _interval(v, FAITHFUL),
              lambda x: x >= 1.05, "mean at least 1.05 times", "{:.2f}x", _system_reason, average=True),
        Claim("10a", "Whole system: up to 1.5 times faster than GSCore", "1.5x", lambda v: _interval(v, GSCORE) / _interval(v, FAITHFUL), lambda x: x >= 1.4,
              "at least 1.4 times on the best view", "{:.2f}x", _system_reason, best=True),
        Claim("10b", "Whole system: up to 2.6 times less energy than GSCore", "2.6x", lambda v: _chip_energy(v, GSCORE) / _chip_energy(v, FAITHFUL),
              lambda x: x >= 2.3, "at least 2.3 times on the best view", "{:.2f}x",
              lambda v: f"front end and DRAM are the same in both here; {_work_ratio(v, FAITHFUL, GSCORE)}", best=True),
        Claim("10", "The CTU makes the whole system up to 2.3 times faster", "2.3x", lambda v: _interval(v, NO_CTU) / _interval(v, FAITHFUL),
              lambda x: x >= 2.0, "at least 2 times on the best view", "{:.2f}x",
              lambda v: f"{FAITHFUL} is limited by {v.facts['chip'][FAITHFUL]['bottleneck']}", best=True),
        Claim("Table 1", "Ours against the same model as the paper renders it: 0.11 dB at 25.99 dB on average", "0.11 dB",
              lambda v: test_loss(v, FAITHFUL, FLOAT64, PAPER_PRUNED_PSNR), lambda x: x <= 0.11, "mean at most 0.11 dB below float64", "{:.3f} dB",
              _loss_reason(FAITHFUL, FLOAT64), average=True, unmeasured=_assumed(PAPER_PRUNED_PSNR), detail=_chain(FLOAT64, FAITHFUL)),
        Claim("Table 1", "Of it the contribution test, against the same VRU without", "0.11 dB",
              lambda v: test_loss(v, FAITHFUL, NO_CTU, PAPER_PRUNED_PSNR), lambda x: x <= 0.11, "mean at most 0.11 dB", "{:.3f} dB",
              _loss_reason(FAITHFUL, NO_CTU), average=True, unmeasured=_assumed(PAPER_PRUNED_PSNR), detail=_chain(NO_CTU, FAITHFUL)),
        Claim("Table 1", "SSIM of ours and of the same model is the same to two digits", "0.00", lambda v: _ssim_loss(v, FAITHFUL, FLOAT64),
              lambda x: abs(x) <= 0.01, "mean difference at most 0.01", "{:.4f}", average=True, unmeasured=", against float64; no photographs",
              detail=_chain(FLOAT64, FAITHFUL)),
        Claim("Table 1", "SSIM with and without the contribution test is the same to two digits", "0.00", lambda v: _ssim_loss(v, FAITHFUL, NO_CTU),
              lambda x: abs(x) <= 0.01, "mean difference at most 0.01", "{:.4f}", average=True, unmeasured=", both against float64; no photographs",
              detail=_chain(NO_CTU, FAITHFUL)),
    ]


def area_verdicts(areas: dict[tuple[str, str], float], rows: dict[str, dict]) -> list[Verdict]:
    """Table 2 and Sec. III-B, from the synthesised areas. rows: of any one view."""
    texts = [
        ("Sec. III-B", "A pixel rectangle nearly halves the cost of four single-pixel tests", "about 50 %"),
        ("Table 2a", "The CTUs take less than 10 % of the rendering cores' area", "9.4 %"),
        ("Table 2b", "14 % less total area than 64 VRUs without CTU", "14 %"),
    ]
    if not areas:
        return [Verdict(f, c, p, {}, "not evaluated: no areas") for f, c, p in texts]
    verdicts = []

    def add(index: int, ours: dict[str, str], good: bool, rule: str, why: str) -> None:
        verdicts.append(Verdict(*texts[index], ours, f"holds ({rule})" if good else f"does not hold here, because {why} (asked for: {rule})"))

    try:
        ratio = areas["prtu", "conic mixed"] / (4 * areas["prtu", "conic mixed, 1 pixel"])
        add(0, {"synthesis": f"{ratio:.0%}"}, ratio <= 0.6, "at most 60 %, conic mixed",
            "the multiplications that can be shared are only part of a unit: squares, differences and comparisons stay")
        ctu, core = areas["ctu", "conic mixed"], areas["rendering_core", "conic"]
        add(1, {"synthesis": f"{ctu / core:.1%}"}, ctu / core <= 0.1, "at most 10 %, conic mixed",
            f"our CTU has {ctu:,.0f} GE, of them {1 - 2 * areas['prtu', 'conic mixed'] / ctu:.0%} outside its PRTUs (registers for what is in flight), "
            f"a rendering core {core:,.0f} GE")
    except KeyError as error:
        missing = Verdict("Table 2", "", "", {}, f"not evaluated: areas.csv has no {' '.join(error.args[0])}")
        return [Verdict(*texts[i], {}, missing.verdict) for i in range(2)] + [Verdict(*texts[2], {}, missing.verdict)]
    try:
        ours, other = (float(rows[name]["area_ge"]) for name in (FAITHFUL, NO_CTU_64))
    except (KeyError, TypeError):
        verdicts.append(Verdict(*texts[2], {}, f"not evaluated: this run has no area of {FAITHFUL} and {NO_CTU_64}"))
        return verdicts
    chip = in_all(components(FAITHFUL, in_table))
    rest = chip - square_millimetres(part("render_stage", FAITHFUL).ge)
    total = [rest + square_millimetres(ge) for ge in (ours, other)]
    saved = 1 - total[0] / total[1]
    add(2, {"rendering stage": f"{1 - ours / other:.0%}", "chip": f"{saved:.0%}"}, saved >= 0.12, "at least 12 % of the total",
        f"the rendering stage is {ours / 1e6:.2f} against {other / 1e6:.2f} million GE, and {rest:.2f} mm2 of the chip around it are the same in both")
    return verdicts


def published_verdicts(views: Sequence[ViewResult] = ()) -> list[Verdict]:
    """What cannot be measured here, with what is nearest to it. views: one a scene."""
    published = "published only: not measured here"
    seen = [v for v in views if v.photographed]
    base = {v.title: f"{_photo(v, FLOAT64):.2f} dB, float64" for v in seen}
    ours = {v.title: f"{_photo(v, FAITHFUL):.2f} dB, {FAITHFUL}" for v in seen if FAITHFUL in v.rows}
    missing = "published only: of the paper's own scenes; beside it the photographs of this run" if seen else "not evaluated: no photographs in this run"
    pruned = "published only: no pruned and fine-tuned models of the paper's scenes here; give such a model as a scene to measure it"
    return [
        Verdict("1a", "Vanilla 3DGS: above 100 FPS on an RTX 3090, around 5 FPS on a Jetson XNX", ">100, 5", {}, published),
        Verdict("1b", "On the XNX compute units are busy 85 %, floating-point units 29 %", "85 %, 29 %", {}, published),
        Verdict("10a", "14.4 times (average) and 19.8 times (at most) faster than a Jetson XNX", "14.4x, 19.8x", {}, published),
        Verdict("10b", "26.7 times the energy efficiency of a Jetson XNX", "26.7x", {}, published),
        Verdict("Table 1", "Base.: vanilla 3DGS against photographs, average 26.56 dB", "26.56 dB", base, missing),
        Verdict("Table 1", "Prun.: pruned and fine-tuned, average 25.99 dB", "25.99 dB", {}, pruned),
        Verdict("Table 1", "Ours against photographs, average 25.88 dB", "25.88 dB", ours, missing),
    ]


def all_verdicts(views: Sequence[ViewResult], areas: dict[tuple[str, str], float]) -> list[Verdict]:
    """Every claim with its verdict, in the order of the paper's figures and tables."""
    rows = next(iter(views)).rows
    found = [verdict for claim in claims() for verdict in claim.verdicts(views)] + area_verdicts(areas, rows) + published_verdicts(by_scene(views))
    order = ["1a", "1b", "Sec. III-B", "3a", "4", "6", "7c", "8a", "8b", "9", "10a", "10b", "10", "Table 1", "Table 2a", "Table 2b"]
    return sorted(found, key=lambda v: order.index(v.figure))
