"""A package that adds a kind of controller, a body, a command and an export format to annelid.

    pip install examples/extend/standing_wave
    annelid run riddle2023-rods --set controller.kind=standing-wave --set controller.period=1.5
    annelid run mass-chain
    annelid view mass-chain
    annelid rings runs/riddle2023-rods-001
    annelid export runs/riddle2023-rods-001 --to txt

annelid finds them by the entry points in pyproject.toml.
"""
