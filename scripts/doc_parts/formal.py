"""`make docs PART=formal`: table of docs/results/formal.md from the results of `make formal`."""

from __future__ import annotations

import formal

from flicker import markdown

from .common import Say


def missing() -> str | None:
    """Why there is nothing to write."""
    lacking = [task for task, result in formal.known() if result is None]
    return f"build/formal lacks {len(lacking)} results of this RTL ({lacking[0].proof.name}, ...); run make formal first" if lacking else None


def tables(say: Say) -> dict[str, str]:
    pairs = [(task, result) for task, result in formal.known() if result is not None]
    proofs = list({task.proof.name: task.proof for task, _ in pairs}.values())
    total = sum(result.seconds for _, result in pairs)
    return {"": markdown.table(formal.COLUMNS, formal.rows(proofs, pairs)) + f"\n\n{len(pairs)} tasks, {total:.0f} s one after the other."}
