"""A user's own function as a controller."""

import numpy as np
import pytest

from annelid.control import CallableController
from annelid.errors import ConfigError
from annelid.protocols import Controller, Sensation

ZEROS = np.zeros((3, 1))
FELT = Sensation(0.25, ZEROS, ZEROS, np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros(3))


def test_passes_the_sensation_in_and_the_activation_out():
    one: Controller = CallableController(lambda s: [s.time_s, 0.5, 1.0], n_muscles=3)
    activation = one.step(FELT)
    assert activation.tolist() == [0.25, 0.5, 1.0]
    assert activation.dtype == np.float64


def test_one_number_serves_all_muscles():
    assert CallableController(lambda s: 0.3, n_muscles=3).step(FELT).tolist() == [0.3] * 3


def test_the_callers_array_is_not_shared():
    mine = np.zeros(3)
    CallableController(lambda s: mine, n_muscles=3).step(FELT)[:] = 1.0
    assert mine.tolist() == [0.0] * 3


def test_what_is_no_number_is_refused_in_one_sentence(subtests: pytest.Subtests) -> None:
    for result, message in (("half", "returned str"), ([[0.1], [0.2, 0.3]], "returned list")):
        with subtests.test(f"{result!r:.60}"), pytest.raises(ConfigError, match=message):
            CallableController(lambda s, result=result: result, n_muscles=3).step(FELT)  # type: ignore[arg-type]
