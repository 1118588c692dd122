"""Planar worms of the literature, with the same face as the 3D one."""

from annelid_studies.planar.boxerbaum2012 import Boxerbaum2012Plant
from annelid_studies.planar.daltorio2013 import Daltorio2013Plant
from annelid_studies.planar.riddle2022 import Riddle2022Plant
from annelid_studies.planar.sections import bent_rhombi, rhombi

__all__ = ["Boxerbaum2012Plant", "Daltorio2013Plant", "Riddle2022Plant", "bent_rhombi", "rhombi"]
