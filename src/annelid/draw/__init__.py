"""Pictures of runs: plots, frames and videos."""
