"""The kinds that this package adds to annelid."""

from annelid_lab.robots import body as body
