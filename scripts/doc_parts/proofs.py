"""`make docs PART=proofs`: what is proved, in docs/reference/formal.md: proofs of formal/proofs.toml with what the comment at the head of each top says."""

from __future__ import annotations

import tomllib

from flicker import markdown
from flicker.errors import FlickerError
from flicker.toolchain import ROOT

from .common import Say

FORMAL = ROOT / "formal"
HOW = {"induction": "induction", "combinational": "all inputs"}


def tables(say: Say) -> dict[str, str]:
    rows = []
    for proof in tomllib.loads((FORMAL / "proofs.toml").read_text())["proof"]:
        how = HOW.get(proof["method"]) or f"bounded, {proof['steps']} cycles"
        rows.append([f"`{proof['name']}`", said(proof.get("top", f"fv_{proof['name']}")), how, sets(proof.get("parameters", []))])
    return {"": markdown.table(["proof", "what is proved", "how", "parameters"], rows)}


def said(top: str) -> str:
    """The comment at the head of a top, as one line, without what links registers to the specification for induction (assertions l_*)."""
    lines: list[str] = []
    for line in (FORMAL / f"{top}.sv").read_text().splitlines():
        if not line.startswith("//"):
            break
        lines.append(line.removeprefix("//").strip())
    text = " ".join(filter(None, lines)).partition(" The assertions l_")[0].replace("|", "\\|").replace("*", "\\*").replace("[", "\\[")
    if not text:
        raise FlickerError(f"formal/{top}.sv: begins with no comment")
    return text


def sets(parameters: list[dict[str, int]]) -> str:
    """The values of each parameter over all sets that name it; its default, which others take, is not said."""
    values: dict[str, list[int]] = {}
    for one in parameters:
        for name, value in one.items():
            values.setdefault(name, [])
            if value not in values[name]:
                values[name].append(value)
    return "; ".join(f"`{name}` {', '.join(map(str, found))}" for name, found in values.items()) or "defaults"
