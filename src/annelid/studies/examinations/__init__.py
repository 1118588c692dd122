"""The examinations, one module each, in the order of the report."""

from annelid.studies.examinations.discretization import DISCRETIZATION
from annelid.studies.examinations.friction import FRICTION
from annelid.studies.examinations.gate import GATE
from annelid.studies.examinations.noise import NOISE
from annelid.studies.examinations.pins import PINS
from annelid.studies.examinations.radius import RADIUS
from annelid.studies.examinations.ranges import RANGES
from annelid.studies.examinations.springs import SPRINGS
from annelid.studies.examinations.timestep import TIMESTEP

EXAMINATIONS = (PINS, RANGES, SPRINGS, RADIUS, NOISE, FRICTION, TIMESTEP, DISCRETIZATION, GATE)

__all__ = ["EXAMINATIONS"]
