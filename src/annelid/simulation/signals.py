"""The signals of a 3D worm in the run file: names, dimensions and units."""

from __future__ import annotations

from annelid.protocols import SIDES, Signal
from annelid.simulation.anatomy import Anatomy


def worm_signals(anatomy: Anatomy) -> tuple[Signal, ...]:
    """Names what a worm of this anatomy records."""
    n, m, geometry = anatomy.n_segments, anatomy.n_muscles, anatomy.geometry
    sensors, springs, crossings = anatomy.rest_stretch_m.shape, len(geometry.springs), geometry.n_crossings
    signals = [
        Signal("stretch_length", ("segment", "sensor"), sensors, "m", "length of the springs that span a ring"),
        Signal("spring_length", ("spring",), (springs,), "m", "length of an axial spring"),
        Signal("ring_length", ("muscle",), (m,), "m", "length of a ring muscle"),
        Signal(
            "muscle_force",
            ("muscle",),
            (m,),
            "N",
            "contractile force of a ring muscle over the last physics step; with RK4 that of its last stage",
        ),
        Signal("contact_force", ("segment", "axis"), (n, 3), "N", "force of the arena on a segment"),
        Signal("touch", ("segment", "side"), (n, len(SIDES)), "N", "normal force of the ground on a side"),
        Signal("contact_count", ("segment",), (n,), "1", "number of vertices that touch the ground"),
        Signal("slip_speed", ("segment",), (n,), "m/s", "forward speed along the ground of what touches it"),
        Signal("slip_distance", ("segment",), (n,), "m", "way that what touches the ground has slid so far"),
        Signal("slip_loss", ("segment",), (n,), "J", "work of a segment lost to friction so far"),
        Signal("center_of_mass", ("axis",), (3,), "m", "centre of mass in world axes"),
        *_energies(m),
    ]
    if anatomy.has_edges:
        signals.append(Signal("edge_strain", (), (), "1", "largest strain of a rod's edge"))
    if anatomy.pins_can_part:
        signals.append(Signal("pin_gap", (), (), "m", "largest gap between two pinned strands"))
    position, coordinates = "position of a crossing", (anatomy.model.nq,)
    return (
        *signals,
        Signal("crossing_position", ("crossing", "axis"), (crossings, 3), "m", position, every_frame=True),
        Signal("qpos", ("coordinate",), coordinates, "1", "generalised position", every_frame=True),
    )


def _energies(n_muscles: int) -> tuple[Signal, ...]:
    """Energies that the worm holds, and the totals of what its muscles have done and where it went."""
    return (
        Signal("kinetic_energy", (), (), "J", "kinetic energy"),
        Signal("elastic_energy", (), (), "J", "energy of strands and springs"),
        Signal("potential_energy", (), (), "J", "energy of the weight"),
        Signal("muscle_work", ("muscle",), (n_muscles,), "J", "net work done by a ring muscle so far"),
        Signal("positive_work", ("muscle",), (n_muscles,), "J", "positive work of a ring muscle so far, none regained"),
        Signal("damping_loss", (), (), "J", "energy lost to dampers so far"),
        Signal("constraint_loss", (), (), "J", "energy lost to contacts, friction and inextensible edges so far"),
    )
