"""Pictures of the environments' worms."""

from __future__ import annotations

import numpy as np
import pytest
from worms import CHEAP

from annelid.environments import WormEnv
from annelid_studies.riddle2023.figures.renderings import rendering_works

needs_gl = pytest.mark.skipif(not rendering_works(), reason="no OpenGL back-end works on this machine")
SMALL = {"render_mode": "rgb_array", "width": 96, "height": 64}


@needs_gl
def test_a_picture_shows_the_worm_as_it_is_now() -> None:
    env = WormEnv(**CHEAP, **SMALL)
    env.reset(seed=0)
    first = env.render()
    for _ in range(3):
        env.step(np.array([0.0, 1.0, 0.0]))
    then = env.render()
    env.close()
    assert first is not None
    assert then is not None
    assert first.shape == then.shape == (64, 96, 3)
    assert first.dtype == np.uint8
    assert first.std() > 5.0
    assert np.abs(first.astype(int) - then).max() > 20


def test_without_a_render_mode_there_are_none() -> None:
    env = WormEnv(**CHEAP)
    env.reset(seed=0)
    assert env.render() is None
