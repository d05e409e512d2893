"""`make docs PART=parameters`: constants and counters from model/flicker/params.py."""

from __future__ import annotations

import re

from flicker import markdown, params
from flicker.toolchain import ROOT

from .common import Say

PACKAGE = ROOT / "rtl" / "generated" / "flk_param_pkg.sv"
CONSTANT = re.compile(r"^\s*localparam .*?(\w+) = (.*?);(?:\s*// (.*))?$")
HEADING = re.compile(r"^\s*// (?!Generated)(.*)$")


def tables(say: Say) -> dict[str, str]:
    return {"constants": constants(), "counters": counters()}


def constants() -> str:
    """What the generated package holds, but for the counters' indices."""
    rows, heading = [], ""
    for line in PACKAGE.read_text().splitlines():
        if found := CONSTANT.match(line):
            if not found[1].startswith("CNT_"):
                rows.append([heading, f"`{found[1]}`", f"`{found[2]}`", found[3] or ""])
                heading = ""
        elif found := HEADING.match(line):
            heading = found[1]
    return markdown.table(["", "constant", "value", ""], rows)


def counters() -> str:
    """Performance counters in the order of their indices."""
    rows = [
        [str(index), f"`{name}`", per, note]
        for index, (name, per, note) in enumerate([
            *((name, "core", note) for name, note in params.CORE_COUNTERS), *((name, "channel", note) for name, note in params.CHANNEL_COUNTERS),
        ])
    ]
    return markdown.table(["index", "counter", "per", "meaning"], rows)
