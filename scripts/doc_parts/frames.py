"""`make docs PART=frames`: few configurations on the real views, in docs/results/frames.md; from the default to lanes, in docs/results/exploration.md."""

from __future__ import annotations

from collections.abc import Sequence

from flicker import markdown
from flicker.explore.configurations import get_configuration, group
from flicker.explore.machine import Configuration
from flicker.explore.stages.lanes import Lanes
from flicker.explore.stages.log_lanes import LogLanes

from .areas import generator_errors
from .common import Rows, Say, measure, significant

SUMMARY, ABLATION, DEEPER = "summary", "ablation", "deeper FIFOs"
LISTS = {
    "subtile": "3-sigma boxes", "tile": "boxes on 16x16 tiles", "obb": "oriented boxes",
    "reach": "the box of alpha = 1/255, made on the host in float64", "ellipse": "the ellipse of alpha = 1/255, made on the host in float64",
    "squares": "boxes on 16x16 tiles and the ellipse of alpha = 1/255, made on the host in float64",
}
CHANGES = {
    "lists": "lists", "generator": "mask generator", "masks": "masks name pixels, VRUs visit pixels", "stop": "early exit", "stage": "rendering stage",
    "window": "entries in which a lane looks for its next pixel", "accumulator": "accumulators with their loop", "fifo_depth": "FIFO depth",
    "width": "elements a cycle", "vrus_per_channel": "VRUs", "lanes": "VRUs", "in_width": "elements a cycle", "slots": "splats in the store",
    "loop": "loop of a pixel",
}


def percent(change: float) -> str:
    """A relative change, 0 without sign."""
    return f"{round(change * 100) or 0:+d}%".replace("+0%", "0%")


def model_error() -> str:
    """How far the rule for mask generators without RTL is from those that are synthesised."""
    errors = generator_errors().values()
    return f"{percent(min(errors))} to {percent(max(errors))}"


def assumed(configuration: Configuration) -> list[str]:
    """What a configuration's figures rest on."""
    words = []
    if not configuration.model_only:
        words.append("RTL; its cycle model equals it in every cycle and counter")
    elif configuration.stage.idealised:
        words.append("no RTL: cycles are a closed form, at their least; areas of our own units")
    else:
        words.append(
            "no RTL: the cycle model has nothing to be held against; area of the mask generator by a rule whose error is "
            f"{model_error()} on those with RTL ([energy and area](../reference/energy.md))"
        )
    words += [f"lists by {LISTS[configuration.lists]}", *configuration.stage.assumed]
    return words + ["a finished sub-tile's list is left at once (early exit)"] * configuration.stop


def figures(row: dict | None) -> str:
    """Cycles in millions, PSNR in dB, energy in microjoules, each to what is known of it."""
    return "" if row is None else f"{significant(row['cycles'] / 1e6, 3)} / {row['psnr_db']:.1f} / {significant(row['energy_uj'], 2)}"


def _mge(configuration: Configuration) -> str:
    return significant(configuration.area() / 1e6, 2)


def summary(views: Rows) -> str:
    """A row a configuration; what each assumes is numbered below."""
    notes: dict[str, int] = {}
    rows = []
    for name in group(SUMMARY):
        configuration = get_configuration(name)
        numbers = [str(notes.setdefault(words, len(notes) + 1)) for words in assumed(configuration)]
        rows.append([
            f"`{name}`", configuration.title, _mge(configuration), *(figures(found.get(name)) for found in views.values()), ", ".join(numbers),
        ])
    below = "\n".join(f"{number}. {words}" for words, number in notes.items())
    return f"{markdown.table(['configuration', 'what', 'MGE', *views, 'assumes'], rows)}\n\nWhat is assumed:\n\n{below}"


def differences(a: Configuration, b: Configuration) -> list[str]:
    """What changes from one configuration to the other, keys of CHANGES: lists, generator, stop, the stage's kind, fields that both stages have.

    Four pairs are one change: masks that name pixels need a stage that visits pixels (`masks`), accumulators bring the loop that they allow, lanes leave a
    finished list of themselves, so that `stop` ends with them, and those in the log domain have masks of their own sums.
    """
    found = [name for name in ("lists", "generator", "stop") if getattr(a, name) != getattr(b, name)]
    before, after = a.stage, b.stage
    fields = [name for name in vars(after) if name in vars(before) and getattr(before, name) != getattr(after, name)]
    if {"accumulator", "loop"} <= set(fields):
        fields.remove("loop")
    if isinstance(after, Lanes) and not isinstance(before, Lanes) and "stop" in found and a.stop:
        found.remove("stop")
    if isinstance(after, LogLanes) and not isinstance(before, LogLanes) and "generator" in found:
        found.remove("generator")
    if type(before) is not type(after):
        if a.generator.pixels == b.generator.pixels or "generator" not in found or isinstance(after, Lanes) or isinstance(before, Lanes):
            fields.append("stage")
        else:
            found[found.index("generator")] = "masks"
    return found + fields


def ablation(views: Rows, names: Sequence[str]) -> str:
    """From the default to lanes, and to deeper FIFOs: cycles and energy of each step over those of the step before."""
    rows = []
    before: str | None = None
    for name in names:
        configuration = get_configuration(name)
        cells = []
        for found in views.values():
            row, old = found[name], found[before] if before else None
            change = f" ({percent(row['cycles'] / old['cycles'] - 1)})" if old else ""
            cells.append(f"{significant(row['cycles'] / 1e6, 3)}{change} / {row['psnr_db']:.1f} / {significant(row['energy_uj'], 2)}")
        changed = "" if before is None else ", ".join(CHANGES[key] for key in differences(get_configuration(before), configuration))
        rows.append([f"`{name}`", configuration.title, changed, _mge(configuration), *cells])
        before = name
    return markdown.table(["configuration", "what", "changed", "MGE", *views], rows)


def tables(say: Say) -> dict[str, str]:
    views = measure(list(dict.fromkeys([*group(SUMMARY), *group(ABLATION), *group(DEEPER)])), say)
    return {"summary": summary(views), "ablation": ablation(views, group(ABLATION)), "deeper": ablation(views, group(DEEPER))}
