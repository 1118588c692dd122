"""Measurements, one file a case, written as they come; each case measured in a process of its own."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from annelid.errors import AnnelidError
from annelid.experiment import case_key, code_fingerprint
from annelid.output import write_text
from annelid.textfiles import read_json
from annelid_studies.bench.cases import BenchCase

MEASURING, PEER_CODE = "annelid_studies.bench.measure", "annelid_studies.bench.peer"
"""The code that a measurement depends on beside the physics, and that of the peer."""

Share = Callable[[float], object]
"""Called with the share of a case that is done."""


class MeasurementFailed(AnnelidError):
    """A case could not be measured; the text says why."""


class Measurements:
    """A folder of measurements of cases, and of the peer for None; it is made with the first."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def find(self, case: BenchCase | None) -> dict[str, Any] | None:
        """Returns what was measured before with the same configuration, code and engine, or None."""
        try:
            return read_json(self._path(case))
        except (OSError, ValueError):
            return None

    def measure(self, case: BenchCase | None, progress: Share) -> dict[str, Any]:
        """Measures a case, and keeps the numbers.

        Raises:
            MeasurementFailed: The process died, or the case cannot be built.
        """
        request = {} if case is None else {"config": case.case.config.model_dump(mode="json")}
        measured = _in_a_process(request, progress)
        # A peer that is missing may be installed before the next call.
        if measured.get("installed", True):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_text(self._path(case), json.dumps(measured, indent=1, allow_nan=False))
        return measured

    def _path(self, case: BenchCase | None) -> Path:
        code = code_fingerprint(PEER_CODE) if case is None else case_key(case.case) + code_fingerprint(MEASURING)
        stem = "peer" if case is None else case.name.replace(", ", "-").replace(" ", "-")
        return self.folder / f"{stem}-{hashlib.sha256(code.encode()).hexdigest()[:12]}.json"


def _in_a_process(request: dict[str, Any], progress: Share) -> dict[str, Any]:
    with tempfile.TemporaryFile("w+", encoding="utf-8") as complaints:
        child = subprocess.Popen(
            [sys.executable, "-m", MEASURING],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
            encoding="utf-8",
        )
        assert child.stdin is not None
        assert child.stdout is not None
        answer: dict[str, Any] = {}
        try:
            # A process that dies at once leaves its reason on stderr. Its stdin stays open: it ends when that closes.
            with suppress(BrokenPipeError):
                child.stdin.write(json.dumps(request) + "\n")
                child.stdin.flush()
            for line in child.stdout:
                # A library may print too.
                if line.startswith("{"):
                    answer = json.loads(line)
                    if "share" in answer:
                        progress(answer["share"])
            child.wait()
        except BaseException:
            child.kill()
            child.wait()
            raise
        finally:
            child.stdout.close()
            with suppress(BrokenPipeError):
                child.stdin.close()
        if "measured" in answer:
            return answer["measured"]
        complaints.seek(0)
        last = (complaints.read().strip().splitlines() or [f"the process ended with status {child.returncode}"])[-1]
        raise MeasurementFailed(answer.get("error", last))
