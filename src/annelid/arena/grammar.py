"""What MJCF may have that annelid reads: elements, attributes, values and amounts, of a scene and of a robot."""

from __future__ import annotations

from dataclasses import dataclass

MOST_BYTES = 1_000_000
"""Of a scene as one text."""
MOST_FILE_BYTES = 4_000_000
"""Of a mesh or a picture that it takes from a file."""
MOST_VERTICES, MOST_SAMPLES, MOST_PIXELS = 20_000, 250_000, 1024
"""Of all meshes together, of all height fields together, and along the side of a texture, or of all as one square."""
MOST_OBJECTS = 16
"""Things that move: the force of the worm on each is measured at every part of its skin."""
LARGEST = 1e6
"""Of any number: beyond it nothing is a length, a mass or a stiffness in SI units."""
LARGEST_OF: dict[str, float] = dict.fromkeys(["value", "young", "shear"], 1e12)
LARGEST_OF |= dict.fromkeys(["iterations", "ls_iterations", "noslip_iterations"], 1e4)
"""Of numbers that may be larger, as a cable's moduli, or that would keep the engine busy for long."""

_TURN = "quat axisangle euler xyaxes zaxis"
_GEOM = (
    f"name class type size pos fromto {_TURN} mass density friction solref solimp solmix priority condim contype "
    "conaffinity group rgba material mesh hfield shellinertia fitscale"
)
_JOINT = (
    "name class type pos axis range limited stiffness springref damping frictionloss armature ref solreflimit "
    "solimplimit solreffriction solimpfriction"
)
_MESH = "name class vertex face scale refpos refquat inertia smoothnormal maxhullvert"
_MATERIAL = "name class texture texrepeat texuniform rgba emission specular shininess reflectance"
_THINGS = "body geom frame"
_ALLOWED = {
    "mujoco": ("compiler default asset worldbody", "model"),
    "compiler": ("", "angle eulerseq autolimits"),
    "default": ("default geom joint mesh material", "class"),
    "asset": ("mesh hfield texture material", ""),
    "mesh": ("", _MESH),
    "hfield": ("", "name nrow ncol size elevation"),
    "texture": ("", "name type builtin rgb1 rgb2 mark markrgb random width height"),
    "material": ("", _MATERIAL),
    "worldbody": (_THINGS, ""),
    "frame": (_THINGS, f"name childclass pos {_TURN}"),
    "body": (f"{_THINGS} inertial joint freejoint", f"name childclass pos {_TURN}"),
    "inertial": ("", f"pos {_TURN} mass diaginertia fullinertia"),
    "joint": ("", _JOINT),
    "freejoint": ("", "name"),
    "geom": ("", _GEOM),
}
"""Elements, each with those that may be in it and its attributes."""
_SOFTNESS = "solref solimp"
_TENDON = (
    "class limited range stiffness damping frictionloss springlength margin solreflimit solimplimit solreffriction "
    "solimpfriction"
)
_ONE_TENDON = "name group armature actuatorfrcrange actuatorfrclimited"
_TRANSMISSION = "name class group joint tendon site refsite gear ctrllimited ctrlrange forcelimited forcerange"
_ACTIVE = f"{_TRANSMISSION} lengthrange actlimited actrange dyntype dynprm actdim actearly"
_MUSCLE = "timeconst tausmooth range force scale lmin lmax vmax fpmax fvmax"
_READING = "name noise cutoff"
_ROBOT = _ALLOWED | {
    "mujoco": (
        "compiler default asset worldbody option contact deformable equality tendon actuator sensor",
        "model",
    ),
    "compiler": ("lengthrange", "angle eulerseq autolimits balanceinertia boundmass boundinertia settotalmass"),
    "lengthrange": ("", "mode useexisting uselimit tolrange"),
    "default": ("default geom joint mesh material site tendon equality motor position muscle general", "class"),
    "option": (
        "flag",
        "timestep gravity integrator solver cone jacobian iterations tolerance ls_iterations ls_tolerance "
        "noslip_iterations noslip_tolerance impratio density viscosity wind o_margin o_solref o_solimp",
    ),
    "flag": ("", "contact gravity clampctrl warmstart eulerdamp multiccd nativeccd island refsafe filterparent"),
    "worldbody": (f"{_THINGS} site", ""),
    "frame": (f"{_THINGS} site", f"name childclass pos {_TURN}"),
    "body": (f"{_THINGS} inertial joint freejoint site", f"name childclass pos gravcomp {_TURN}"),
    "texture": ("", f"{_ALLOWED['texture'][1]} colorspace"),
    "joint": ("", f"{_JOINT} actuatorfrcrange actuatorfrclimited"),
    "site": ("", f"name class type group material pos size fromto rgba {_TURN}"),
    "geom": ("", f"{_GEOM} margin gap"),
    "deformable": ("flex", ""),
    "flex": ("contact elasticity edge", "name dim radius rgba material group body vertex element"),
    "elasticity": ("", "young shear poisson damping thickness elastic2d"),
    "edge": ("", "stiffness damping"),
    "contact": ("exclude pair", ""),
    "exclude": ("", "name body1 body2"),
    "pair": ("", f"name class geom1 geom2 condim friction {_SOFTNESS} solreffriction margin gap"),
    "equality": ("connect weld joint tendon flex", _SOFTNESS),
    "connect": ("", f"name class active body1 body2 anchor site1 site2 {_SOFTNESS}"),
    "weld": ("", f"name class active body1 body2 anchor relpose torquescale site1 site2 {_SOFTNESS}"),
    "tendon": ("spatial fixed", f"{_TENDON} width rgba"),
    "spatial": ("site geom pulley", f"{_TENDON} {_ONE_TENDON} width rgba material"),
    "fixed": ("joint", f"{_TENDON} {_ONE_TENDON}"),
    "pulley": ("", "divisor"),
    "actuator": ("general motor position muscle", ""),
    "general": ("", f"{_ACTIVE} gaintype gainprm biastype biasprm"),
    "motor": ("", _TRANSMISSION),
    "position": ("", f"{_TRANSMISSION} kp kv dampratio timeconst inheritrange"),
    "muscle": ("", f"{_TRANSMISSION} lengthrange {_MUSCLE}"),
    "sensor": ("tendonpos jointpos", ""),
    "tendonpos": ("", f"{_READING} tendon"),
    "jointpos": ("", f"{_READING} joint"),
}
"""As `_ALLOWED`, of a robot."""
WITHIN = {
    ("flex", "contact"): f"contype conaffinity condim friction {_SOFTNESS} margin gap selfcollide internal",
    ("equality", "flex"): f"name class active flex {_SOFTNESS}",
    ("tendon", "spatial", "site"): "site",
    ("tendon", "spatial", "geom"): "geom sidesite",
    ("tendon", "fixed", "joint"): "joint coef",
    ("equality", "joint"): f"name class active joint1 joint2 polycoef {_SOFTNESS}",
    ("equality", "tendon"): f"name class active tendon1 tendon2 polycoef {_SOFTNESS}",
}
"""Attributes of elements that have others elsewhere."""
_LOOKS = frozenset(["visual", "statistic", "size", "light", "camera", "keyframe", "custom"])
"""What a robot's file may have and nothing takes: pictures have light and views of their own."""


@dataclass(frozen=True)
class Grammar:
    """What may be in a file, and how much of it.

    Attributes:
        what: What it is, in messages.
        allowed: Elements, each with those that may be in it and its attributes.
        most_elements: Of the file.
        most_levels: Of elements within one another.
        ignored: Elements that are left out when it is read.
    """

    what: str
    allowed: dict[str, tuple[str, str]]
    most_elements: int
    most_levels: int
    ignored: frozenset[str] = frozenset()


SCENE = Grammar("a scene", _ALLOWED, 2_000, 24)
ROBOT = Grammar("a robot", _ROBOT, 20_000, 200, _LOOKS)
_PLACES = "joint tendon site geom body1 body2 geom1 geom2 site1 site2 joint1 joint2 tendon1 tendon2"
NAMES = frozenset(f"{_PLACES} name class childclass mesh hfield material texture model refsite sidesite flex".split())
_WORDS = "type builtin mark inertia angle eulerseq colorspace integrator solver cone jacobian mode dyntype gaintype"
_SWITCHES = (
    "autolimits limited selfcollide internal elastic2d smoothnormal texuniform shellinertia biastype active "
    "ctrllimited forcelimited actlimited actearly actuatorfrclimited balanceinertia useexisting uselimit"
)
CHOICES = frozenset(f"{_WORDS} {_SWITCHES} {_ROBOT['flag'][1]}".split()) - {"gravity"}
SINGLE = frozenset(["stiffness", "mass", "density", "nrow", "ncol", "width", "height", "maxhullvert"])
INSTEAD = {
    "include": "write its content into the file",
    "option": "gravity and step are fields of the configuration (arena.gravity_m_per_s2, clock.physics_timestep_s)",
    "size": "the engine finds the sizes itself",
    "extension": "plug-ins are code",
    "plugin": "plug-ins are code",
    "light": "pictures have a light of their own",
    "camera": "pictures have views of their own (--camera)",
    "visual": "pictures have a look of their own",
    "statistic": "pictures have a scale of their own",
    "actuator": "nothing drives the things of a scene but the worm, gravity and springs",
    "keyframe": "a scene starts as it is written",
    "sensor": "annelid records the things that move itself",
    "replicate": "write out what it repeats",
    "tendon": "use the stiffness of joints",
    "equality": "use joints",
    "contact": "use contype and conaffinity",
}
"""What to do without an element that MJCF has and annelid does not take."""
