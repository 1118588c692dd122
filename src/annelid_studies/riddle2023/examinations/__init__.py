"""The examinations, one module each, in the order of the report."""

from annelid_studies.riddle2023.examinations.discretization import DISCRETIZATION
from annelid_studies.riddle2023.examinations.friction import FRICTION
from annelid_studies.riddle2023.examinations.noise import NOISE
from annelid_studies.riddle2023.examinations.pins import PINS
from annelid_studies.riddle2023.examinations.ranges import RANGES
from annelid_studies.riddle2023.examinations.timestep import TIMESTEP

EXAMINATIONS = (PINS, RANGES, NOISE, FRICTION, TIMESTEP, DISCRETIZATION)

__all__ = ["EXAMINATIONS"]
