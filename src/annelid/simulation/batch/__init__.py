"""Many worms at once: one engine batch on a few threads, one network batch, and a run file for each worm."""

from __future__ import annotations

from annelid.simulation.batch.loop import BatchResult, simulate_batch

__all__ = ["BatchResult", "simulate_batch"]
