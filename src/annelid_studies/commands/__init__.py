"""The commands that this package adds to annelid's."""

from annelid_studies.commands import experiment as experiment
from annelid_studies.commands import limit_cycle as limit_cycle
from annelid_studies.commands import reports as reports
