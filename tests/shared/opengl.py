from __future__ import annotations

import pytest

from annelid.draw.gl import find_backend
from annelid.errors import RenderingUnavailable


def rendering_works() -> bool:
    try:
        find_backend()
    except RenderingUnavailable:
        return False
    return True


needs_gl = pytest.mark.skipif(not rendering_works(), reason="no OpenGL back-end works on this machine")
