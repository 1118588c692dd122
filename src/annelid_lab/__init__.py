"""Your own robot: its logs, a worm of its size, its calibration, the loop with hardware, firmware, other formats.

A client of annelid's public names. It joins annelid by the entry points `annelid.kinds`, `annelid.commands` and
`annelid.formats`, as anybody's package can.
"""
