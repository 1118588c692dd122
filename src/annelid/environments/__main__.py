"""Prints the spaces of an environment as the tables of docs/environments.md: ``python -m annelid.environments``."""

from __future__ import annotations

from annelid.environments.single import WormEnv


def observation_table(env: WormEnv) -> str:
    """Lays out what an observation contains as a table in Markdown."""
    rows = ["| numbers | entry | shape | unit | scaled from | meaning |", "|---|---|---|---|---|---|"]
    first = 0
    for entry in env.layout.entries:
        last = first + entry.size - 1
        shape = " x ".join(map(str, entry.shape))
        span = f"{entry.low:g} .. {entry.high:g}"
        rows.append(f"| {first} .. {last} | `{entry.name}` | {shape} | {entry.unit} | {span} | {entry.meaning} |")
        first = last + 1
    return "\n".join(rows)


def action_table(env: WormEnv) -> str:
    """Lays out what an action contains as a table in Markdown."""
    rows = ["| number | muscle | unit | range |", "|---|---|---|---|"]
    low, high = float(env.action_space.low.min()), float(env.action_space.high.max())  # type: ignore[attr-defined]
    rows += [f"| {k} | `{name}` | 1 | {low:g} .. {high:g} |" for k, name in enumerate(env.worm.anatomy.muscle_names)]
    return "\n".join(rows)


if __name__ == "__main__":
    shown = WormEnv()
    print(f"Observation\n\n{observation_table(shown)}\n\nAction\n\n{action_table(shown)}")
