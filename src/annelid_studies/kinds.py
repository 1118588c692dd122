"""The kinds and presets that this package adds to annelid."""

from annelid.config import add_presets
from annelid_studies import faults as faults
from annelid_studies import oscillators as oscillators
from annelid_studies import planar as planar
from annelid_studies import pressure as pressure
from annelid_studies import waiting as waiting
from annelid_studies.challenge import controllers as controllers
from annelid_studies.challenge import policy as policy

add_presets("annelid_studies")
