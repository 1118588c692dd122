"""The kinds and presets that this package adds to annelid."""

from annelid.config import add_presets
from annelid_studies import baselines as baselines
from annelid_studies import faults as faults
from annelid_studies import oscillators as oscillators
from annelid_studies import planar as planar
from annelid_studies import policy as policy
from annelid_studies import pressure as pressure
from annelid_studies import waiting as waiting

add_presets("annelid_studies")
