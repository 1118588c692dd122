"""The commands that this package adds to annelid's."""

from annelid_lab.commands import calibrate as calibrate
from annelid_lab.commands import compare as compare
from annelid_lab.commands import loop as loop
from annelid_lab.commands import network as network
from annelid_lab.commands import new as new
