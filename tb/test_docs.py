"""Tables of README.md and docs/: every mark belongs to a part of `make docs` and the reverse, and what can be made in seconds is what the pages hold.

Not covered: whether tables that take minutes (pictures, cycles, chip, stability) are of the present model; `make docs` writes them.
"""

from __future__ import annotations

import json
import re
from enum import Enum
from pathlib import Path
from typing import Annotated

import docs
import pages
import pytest
import typer
from doc_parts import areas, commands, fpga, frames, proofs

from flicker.chips import chips
from flicker.cost import stamp
from flicker.cost.area import TABLE, parts
from flicker.errors import FlickerError, Interrupted
from flicker.explore.configurations import get_configuration, group
from flicker.toolchain import ROOT

CHEAP = [part for part in docs.PARTS if part.cheap]
SYNTHESISED = [(part.name, place) for part in docs.PARTS if part.name == "synthesis" for place in part.places]


def quiet(text: str) -> None:
    pass


# ---- marks --------------------------------------------------------------------------------------


def test_every_mark_belongs_to_a_part_and_the_reverse() -> None:
    there = set(pages.places())
    listed = {(part.name, place) for part in docs.PARTS for place in part.places}
    assert there - listed == set(), "marks of no part in scripts/docs.py"
    assert listed - there == set(), "places that no page has"
    names = [part.name for part in docs.PARTS]
    assert len(set(names)) == len(names)


def test_no_place_is_empty_and_no_end_is_left_over() -> None:
    for place in pages.places():
        text = pages.get(place)
        assert "|" in text or "```" in text or text.startswith("**`fl"), f"{pages.mark(place)} holds no table: make docs PART={place[0]}"
    for page in pages.all_pages():
        text = page.read_text()
        assert len(pages.END_LINE.findall(text)) == len(pages.MARK.findall(text)), page


def test_pages_are_split_and_put_together(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("a\n<!-- make docs PART=one -->\nold\n<!-- end -->\nb\n")
    page = tmp_path / "docs" / "x.md"
    page.write_text("<!-- make docs PART=two here -->\n<!-- end -->\n<!-- make docs PART=two there -->\n1\n2\n<!-- end -->\n")
    assert pages.get(("two", "there"), tmp_path) == "1\n2" and pages.get(("two", "here"), tmp_path) == ""
    changed = pages.put({("one", ""): "new\n", ("two", "here"): "h", ("two", "there"): "1\n2"}, tmp_path)
    assert [path.name for path in changed] == ["README.md", "x.md"]
    assert (tmp_path / "README.md").read_text() == "a\n<!-- make docs PART=one -->\nnew\n<!-- end -->\nb\n"
    assert page.read_text() == "<!-- make docs PART=two here -->\nh\n<!-- end -->\n<!-- make docs PART=two there -->\n1\n2\n<!-- end -->\n"
    assert pages.put({("two", "here"): "h"}, tmp_path) == []
    before = page.read_text()
    with pytest.raises(FlickerError, match="PART=three"):
        pages.put({("two", "here"): "other", ("three", ""): ""}, tmp_path)
    assert page.read_text() == before
    for wrong in ("<!-- make docs PART=one -->\nno end\n", "<!-- make docs PART=a b c -->\n<!-- end -->\n", "<!-- make docs PART=one -->\n<!-- end -->\n"):
        page.write_text(wrong)  # without an end, of three words, twice
        with pytest.raises(FlickerError, match="PART=") as caught:
            pages.places(tmp_path)
        assert "\n" not in str(caught.value)


def test_unknown_part_is_one_line() -> None:
    with pytest.raises(FlickerError, match=r"^PART: no part 'nosuch'; there are [^\n]*areas[^\n]*$"):
        docs.main(["nosuch"])


def test_interruption_says_what_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which parts are written, that the one under way is not, and a command for the rest: of all parts without those that lack something."""
    def write(part: docs.Part, console: object) -> None:
        if part.name == "c":
            raise KeyboardInterrupt

    parts = [docs.Part(name, "", ("",), lambda say: {}, lambda name=name: "no input" if name in "be" else None) for name in "abcdef"]
    monkeypatch.setattr(docs, "PARTS", tuple(parts))
    monkeypatch.setattr(docs, "write", write)
    with pytest.raises(Interrupted, match="^c is not finished, a is written; to go on: make docs PART='c d f'$"):
        docs.main([])
    with pytest.raises(Interrupted, match="^c is not finished; to go on: make docs PART='c e'$"):
        docs.main(["c", "e"])


def test_missing_inputs_are_said_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A named part fails, as one of all it is skipped."""
    written = []
    here, away = (docs.Part(name, "", ("",), lambda say: {}, missing) for name, missing in (("here", lambda: None), ("away", lambda: "no input")))
    monkeypatch.setattr(docs, "PARTS", (away, here))
    monkeypatch.setattr(docs, "write", lambda part, console: written.append(part.name))
    assert docs.main([]) == 0 and written == ["here"]
    assert capsys.readouterr().out == "docs: away: skipped, no input\n"
    assert docs.main(["away"]) == 1 and written == ["here"]
    assert capsys.readouterr().out == "docs: away: not written, no input\n"
    monkeypatch.delenv("FLICKER_SCENES", raising=False)
    for part in docs.PARTS:
        assert "\n" not in (part.missing() or "")


# ---- pages are what the parts write -------------------------------------------------------------


@pytest.mark.parametrize("part", CHEAP, ids=lambda part: part.name)
def test_page_is_current(part: docs.Part) -> None:
    for place, text in docs.texts(part, quiet).items():
        assert pages.get(place) == text, f"{pages.places()[place].name}: stale, run make docs PART={part.name}"


def test_parts_give_what_they_say() -> None:
    part = docs.Part("x", "", ("a",), lambda say: {"b": ""})
    with pytest.raises(FlickerError, match="part x gave b, not a"):
        docs.texts(part, quiet)


# ---- stored results of synthesis ----------------------------------------------------------------


def test_stamp_sees_hardware_only(tmp_path: Path) -> None:
    source = tmp_path / "flk_x.sv"
    text = 'module flk_x;  // a\n  assign y = a + b; /* "c" */\n`ifndef SYNTHESIS\n  assert (x) else $error("// d");\n`endif\nendmodule\n'
    source.write_text(text)
    digest = stamp.digest([source])
    for same in (text.replace("// a", "// another"), text.replace("a + b", "a+\n  b"), text.replace('"c"', ""), text.replace("assert (x)", "assert (y)")):
        assert same != text
        source.write_text(same)
        assert stamp.digest([source]) == digest
    for other in (text.replace("a + b", "a - b"), text.replace("flk_x", "flk_y"), text.replace("`ifndef", "`ifdef"), text.replace("a + b", "a b +")):
        assert other != text
        source.write_text(other)
        assert stamp.digest([source]) != digest
    assert stamp.words("`ifdef SYNTHESIS a `else b `endif \"x // y\" // z") == ["a", '"x // y"']
    assert stamp.stamp_of("# by hand; RTL 0123456789ab") == "0123456789ab" and stamp.stamp_of("RTL default") is None


def test_every_source_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rtl" / "generated").mkdir(parents=True)
    names = ("flk_a.sv", "generated/flk_param_pkg.sv")
    for name in names:
        (tmp_path / "rtl" / name).write_text("x")
    monkeypatch.setattr(stamp, "FILELIST", tmp_path / "rtl" / "flk.f")
    found = {stamp.rtl_stamp()}
    for name in names:
        (tmp_path / "rtl" / name).write_text("y")
        found.add(stamp.rtl_stamp())
    assert len(found) == 3


def test_conditions_on_synthesis_are_not_nested() -> None:
    """As `stamp.words` wants them: no other condition inside."""
    for path in (ROOT / "rtl").rglob("*.sv"):
        for inside in re.findall(r"`ifn?def SYNTHESIS\b(.*?)`endif", path.read_text(), re.S):
            assert "`if" not in inside, path.name


def test_areas_are_of_this_rtl() -> None:
    assert stamp.stamp_of(TABLE.read_text()) == stamp.rtl_stamp(), (
        f"{TABLE.name}: rtl/ has changed since it was written; run make synth && make docs PART=areas"
    )


@pytest.mark.parametrize("place", SYNTHESISED, ids=" ".join)
def test_tables_of_synthesis_are_of_this_rtl(place: pages.Place) -> None:
    assert stamp.stamp_of(pages.get(place)) == stamp.rtl_stamp(), (
        f"{pages.places()[place].name}: rtl/ has changed since {pages.mark(place)} was written; run make synth && make docs PART={place[0]}"
    )


def test_table_of_another_library_says_of_which_rtl() -> None:
    """The library is no part of the environment, so this one may be older; it must say so to the reader, as the tables beside it do."""
    for place in (("library", ""), ("synthesis", "units")):
        assert pages.get(place).startswith("Synthesised from RTL ") and stamp.stamp_of(pages.get(place)), pages.mark(place)


def test_areas_and_tables_of_synthesis_agree() -> None:
    """areas.csv and the table of units in docs/results/synthesis.md are of one synthesis."""
    text = pages.get(("synthesis", "units"))
    rows = [line.strip("| ").split(" | ") for line in text[text.index("### Units") :].splitlines() if line.startswith("| ")]
    listed = {(row[0], row[1]): float(row[2].replace(",", "")) for row in rows if len(row) == 10 and row[2][:1].isdigit()}
    assert len(listed) > 80
    for key, ge in listed.items():
        assert parts()[key].ge == pytest.approx(ge, abs=0.6), key


def test_areas_without_synthesis(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Of this RTL the table stays; of other RTL nothing is written."""
    monkeypatch.setattr(areas, "UNITS", tmp_path / "none")
    monkeypatch.setattr(areas, "rtl_stamp", lambda: stamp.stamp_of(TABLE.read_text()))
    assert areas.missing() is None and "stays" in areas.save(quiet)
    monkeypatch.setattr(areas, "rtl_stamp", lambda: "0" * 12)
    assert re.fullmatch(r"model/flicker/cost/areas.csv is not of the RTL beside it, and make synth has not run: run make synth first", areas.missing() or "")


def test_chips_mapped_before(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Of chips on FPGAs the tables show what was mapped of this RTL with these parameters, and say where there is nothing."""
    monkeypatch.setattr(fpga, "FOLDER", tmp_path)
    tiny = chips()["tiny"]
    for rtl, parameters, taken in (
        (stamp.rtl_stamp(), tiny.parameters, True), ("0" * 12, tiny.parameters, False), (stamp.rtl_stamp(), tiny.parameters | {"Lanes": 16}, False),
    ):
        (tmp_path / "tiny-xcup.json").write_text(json.dumps({"rtl": rtl, "parameters": parameters, "all": {"lut": 1}, "units": {}}))
        assert ("tiny", "xcup") in fpga.mapped() if taken else "none mapped" in fpga.tables(quiet)["boards"]


# ---- what tables say ----------------------------------------------------------------------------


@pytest.mark.parametrize("name,first,last", [("ablation", "flicker", "log-lanes-64"), ("deeper FIFOs", "lanes", "lanes-deep")])
def test_ablations_change_one_thing_at_a_time(name: str, first: str, last: str) -> None:
    names = group(name)
    assert (names[0], names[-1]) == (first, last)
    for before, after in zip(names, names[1:]):
        changes = frames.differences(get_configuration(before), get_configuration(after))
        assert len(changes) == 1, (before, after, changes)
        assert changes[0] in frames.CHANGES


def test_differences_are_seen() -> None:
    def between(a: str, b: str) -> list[str]:
        return frames.differences(get_configuration(a), get_configuration(b))

    assert between("rows", "lanes") == ["lists", "accumulator", "stage"]
    assert between("exact", "rows") == ["masks"] and between("flicker", "flicker-stop") == ["stop"]
    assert between("lanes", "lanes-deep") == ["fifo_depth", "window", "width"]
    assert between("lanes", "log-lanes-64") == ["lanes", "stage"] and between("log-lanes-one", "log-lanes") == ["in_width"]
    assert between("flicker", "flicker-barrier") == ["stage"] and between("flicker", "flicker") == []


def test_summary_says_what_is_assumed() -> None:
    assert any("RTL;" in words for words in frames.assumed(get_configuration("flicker")))
    gscore, lanes = (" ".join(frames.assumed(get_configuration(name))) for name in ("gscore", "lanes"))
    assert "closed form" in gscore and "no RTL" in lanes and "host" in lanes and "early exit" in lanes and "%" in lanes
    row = {"cycles": 1_799_954, "psnr_db": 42.36, "energy_uj": 903.4}
    assert frames.figures(row) == "1.80 / 42.4 / 900"


class Size(str, Enum):
    SMALL = "small"
    LARGE = "large"


def test_tables_of_options() -> None:
    """Choices, words for types, defaults, pages; options of another command are named together; one without help is an error."""
    app = typer.Typer(add_completion=False)

    @app.command()
    def one(
        scene: Path, size: Annotated[Size, typer.Option(help="a|b (docs/reference/cli.md)")] = Size.SMALL,
        out: Annotated[Path | None, typer.Option("--out", "-o", help="a file [default: none]")] = None,
        steps: Annotated[int, typer.Option(help="how many")] = 1500, fast: Annotated[bool, typer.Option("--fast", help="hurry")] = False,
    ) -> None:
        pass

    command = typer.main.get_command(app)
    with pytest.raises(FlickerError, match="scene has no help"):
        commands.table(command, set())
    command.params[0].help = "a scene"
    assert commands.table(command, {("--fast", "hurry")}).splitlines()[2:] == [
        "| `SCENE` | a scene |", r"| `--size small\|large` | a\|b ([cli.md](cli.md)) (default: small) |", "| `--out FILE`, `-o` | a file (default: none) |",
        "| `--steps N` | how many (default: 1,500) |", "| `--fast` | as of [`flicker render`](cli.md#flicker-render) |",
    ]


def test_what_a_proof_says(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(proofs, "FORMAL", tmp_path)
    (tmp_path / "fv_a.sv").write_text("// One [a]\n//\n// two. The assertions l_* link.\nmodule fv_a;\n")
    (tmp_path / "fv_b.sv").write_text("module fv_b;\n")
    assert proofs.said("fv_a") == r"One \[a] two."
    with pytest.raises(FlickerError, match="fv_b.sv: begins with no comment"):
        proofs.said("fv_b")
    assert proofs.sets([{"A": 1}, {"A": 2, "B": 0}, {"A": 1}]) == "`A` 1, 2; `B` 0" and proofs.sets([]) == "defaults"
