"""MuJoCo ships compiled bindings without stubs: to the type checker it is untyped."""

from typing import Any

def __getattr__(name: str) -> Any: ...
