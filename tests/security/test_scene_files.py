"""Scenes from strangers: what an MJCF file could do beyond ground and things is refused in a sentence."""

from __future__ import annotations

import os
import struct
import sys
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image

from annelid.arena.grammar import MOST_BYTES, MOST_FILE_BYTES
from annelid.arena.mjcf import read_mjcf
from annelid.config import RunConfig, load_config
from annelid.errors import AnnelidError, ConfigError

GEOM = '<geom type="sphere" size="0.1"/>'
TEXTURE = '<texture type="cube" builtin="flat" width="1024" height="1024"/>'
BOMB = "".join(f'<!ENTITY l{i + 1} "{f"&l{i};" * 10}">' for i in range(9))


def scene(world: str = GEOM, before: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{world}</worldbody></mujoco>"


HOSTILE = {
    "entity bomb": (f'<!DOCTYPE m [<!ENTITY l0 "ha">{BOMB}]><mujoco>&l9;</mujoco>', "document type"),
    "external entity": (
        '<!DOCTYPE m [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco model="&x;"/>',
        "document type",
    ),
    "external document type": ('<!DOCTYPE m SYSTEM "http://127.0.0.1/m.dtd"><mujoco/>', "document type"),
    "include": (scene(before='<include file="other.xml"/>'), "write its content into the file"),
    "include in the world": (scene('<include file="/etc/passwd"/>'), "write its content into the file"),
    "plug-in": (scene(before='<extension><plugin plugin="mujoco.sdf.torus"/></extension>'), "plug-ins are code"),
    "plug-in of a geom": (scene('<geom type="sdf"><plugin plugin="mujoco.sdf.torus"/></geom>'), "'sdf'"),
    "plug-in of a body": (scene(f'<body><plugin plugin="mujoco.elasticity.cable"/>{GEOM}</body>'), "plug-ins are code"),
    "option": (scene(before='<option timestep="1" gravity="0 0 9"/>'), "fields of the configuration"),
    "flag": (scene(before='<option><flag contact="disable"/></option>'), "fields of the configuration"),
    "size": (scene(before='<size memory="900G"/>'), "finds the sizes itself"),
    "balanced inertia": (scene(before='<compiler boundmass="5"/>'), "cannot have this attribute"),
    "folder of textures": (scene(before='<compiler texturedir="/etc"/>'), "cannot have this attribute"),
    "actuator": (scene(before='<actuator><motor joint="x"/></actuator>'), "nothing drives"),
    "keyframe": (scene(before='<keyframe><key qpos="1"/></keyframe>'), "starts as it is written"),
    "actuator of the worm's": (
        scene(before='<tendon><fixed><joint joint="x" coef="1"/></fixed></tendon>'),
        "stiffness",
    ),
    "default of a motor": (scene(before='<default><motor gear="5"/></default>'), "<default> has <motor>"),
    "model in a model": (scene(before='<asset><model file="m.xml"/></asset>'), "<asset> has <model>"),
    "texture from a file": (scene(before='<asset><texture file="t.png"/></asset>'), "cannot have this attribute"),
    "replicate": (scene(f'<replicate count="1000000">{GEOM}</replicate>'), "write out"),
    "flexcomp": (scene('<flexcomp name="f" type="grid" count="900 900 900"/>'), "<worldbody> has <flexcomp>"),
    "mocap": (scene(f'<body mocap="true">{GEOM}</body>'), "cannot have this attribute"),
    "name of a path": (scene('<geom name="../x" size="0.1"/>'), "without '/'"),
    "name of escapes": (scene('<geom name="&#x202e;x" size="0.1"/>'), "printable"),
    "endless": (scene('<geom type="sphere" size="1e999"/>'), "must be numbers"),
    "huge": (scene('<geom type="sphere" size="1e7"/>'), "must be numbers"),
    "not a number": (scene('<geom type="sphere" size="nan"/>'), "must be numbers"),
    "no number": (scene('<geom type="sphere" size="1_0"/>'), "must be numbers"),
    "huge texture": (
        scene(before='<asset><texture name="t" type="2d" builtin="flat" width="90000" height="90000"/></asset>'),
        "1 .. 1024",
    ),
    "many textures": (
        scene(before=f"<asset>{TEXTURE * 3}</asset>"),
        "pixels",
    ),
    "huge height field": (
        scene(before='<asset><hfield name="h" nrow="90000" ncol="90000" size="1 1 1 1"/></asset>'),
        "as many numbers",
    ),
    "many elements": (scene(GEOM * 3000), "2,000 elements"),
    "deep": (scene("<body>" * 500 + GEOM + "</body>" * 500), "24 levels"),
    "many things": (scene(f"<body><freejoint/>{GEOM}</body>" * 20), "20 bodies that move"),
    "no XML": ("<mujoco", "not valid XML"),
    "null": ("<mujoco>\x00</mujoco>", "not valid XML"),
    "another language": ("<robot/>", "begins with <mujoco>"),
    "namespace": ('<m:mujoco xmlns:m="http://example.org/"/>', "begins with <mujoco>"),
    "too long": (scene(before=f"<!--{'x' * MOST_BYTES}-->"), "MB"),
}


def refusal(path: Path) -> str:
    with pytest.raises(ConfigError) as error:
        load_config("crawler", arena=path)
    sentence = str(error.value)
    assert "\n" not in sentence
    assert 10 < len(sentence) < 800
    assert path.name in sentence, "long paths are shortened"
    return sentence


def test_a_file_a_configuration_and_a_run_file_are_refused_for_what_a_scene_cannot_have(
    tmp_path: Path, subtests: pytest.Subtests
) -> None:
    path = tmp_path / "scene.xml"
    whole = load_config("crawler").model_dump()
    for name, (text, reason) in HOSTILE.items():
        with subtests.test(name):
            path.write_text(text, encoding="utf-8")
            assert reason in refusal(path)
            with pytest.raises(ConfigError, match=r"arena\.xml"):
                load_config("crawler", {"arena": {"kind": "scene", "xml": text}})
            with pytest.raises(ValueError, match=r"arena\.xml"):
                RunConfig.model_validate(whole | {"arena": {"kind": "scene", "xml": text}})


def test_the_text_of_a_configuration_opens_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only a scene that the user names is read with its meshes; the same text in a run file or a TOML file is not."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.obj").write_text(OBJ)
    (tmp_path / "scene.xml").write_text(meshed("m.obj"))
    assert "file=" not in read_mjcf(tmp_path / "scene.xml")
    with pytest.raises(ConfigError, match="cannot have this attribute"):
        load_config("crawler", {"arena": {"kind": "scene", "xml": meshed("m.obj")}})
    for field in ("file", "path", "source"):
        with pytest.raises(ConfigError, match=field):
            load_config("crawler", {"arena": {"kind": "scene", field: "scene.xml"}})
    (tmp_path / "mine.toml").write_text('[arena]\nkind = "scene"\nxml = "scene.xml"\n')
    with pytest.raises(ConfigError, match="not valid XML"):
        load_config("crawler", arena="mine.toml")


OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def meshed(name: str, folder: str = "") -> str:
    compiler = f'<compiler meshdir="{folder}"/>' if folder else ""
    asset = f'{compiler}<asset><mesh name="m" file="{name}"/></asset>'
    return scene('<geom type="mesh" mesh="m"/>', asset)


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_mesh_lies_beside_its_scene_or_below(tmp_path: Path, subtests: pytest.Subtests) -> None:
    home = tmp_path / "home"
    (home / "below").mkdir(parents=True)
    (tmp_path / "outside.obj").write_text(OBJ)
    (home / "below" / "mesh.txt").write_text(OBJ)
    (home / "link.obj").symlink_to(tmp_path / "outside.obj")
    (home / "linked").symlink_to(tmp_path)
    (home / "loop.obj").symlink_to(home / "loop.obj")
    path = home / "scene.xml"
    for name, folder in (
        (f"{tmp_path}/outside.obj", ""),
        ("../outside.obj", ""),
        ("below/../../outside.obj", ""),
        ("outside.obj", ".."),
        ("outside.obj", str(tmp_path)),
        ("outside.obj", "below/../.."),
        ("..\\outside.obj", ""),
        ("C:/outside.obj", ""),
        ("file:///outside.obj", ""),
        ("link.obj", ""),
        ("linked/outside.obj", ""),
        ("loop.obj", ""),
        ("below/mesh.txt", ""),
        ("", ""),
        ("a&#10;b.obj", ""),
    ):
        with subtests.test(name=name, folder=folder):
            path.write_text(meshed(name, folder))
            assert "file=" in refusal(path)


def test_a_link_within_the_folder_and_a_folder_of_meshes_are_fine(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "real.obj").write_text(OBJ)
    (tmp_path / "scene.xml").write_text(meshed("real.obj", "meshes"))
    there = read_mjcf(tmp_path / "scene.xml")
    assert there.count("face=") == 1
    assert "meshdir" not in there
    if sys.platform != "win32":
        (tmp_path / "m.obj").symlink_to(tmp_path / "meshes" / "real.obj")
        (tmp_path / "scene.xml").write_text(meshed("m.obj"))
        assert "face=" in read_mjcf(tmp_path / "scene.xml")


def stl(n: int, said: int | None = None) -> bytes:
    return b"\0" * 80 + struct.pack("<I", n if said is None else said) + b"\0" * (50 * n)


def picture(width: int, height: int, form: str = "PNG") -> bytes:
    content = BytesIO()
    Image.new("L", (width, height)).save(content, form)
    return content.getvalue()


BAD_FILES = {
    "mesh.obj": {
        "too long": b"#" * (MOST_FILE_BYTES + 1),
        "many vertices": b"v 0 0 0\n" * 30_000 + b"f 1 2 3\n",
        "no numbers": b"v a b c\nf 1 2 3\n",
        "corner without vertex": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 9\n",
        "corner before the first": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 -9\n",
        "huge corner": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 99999999999999999999999\n",
        "no number at all": b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n",
        "empty": b"",
        "binary": bytes(range(256)) * 10,
        "two coordinates": b"v 0 0\nv 1 0\nv 0 1\nv 1 1\nf 1 2 3\n",
    },
    "mesh.stl": {
        "short": b"solid",
        "says more than it has": stl(4, 4_000_000_000),
        "one point": stl(4),
        "text": b"solid x\nfacet normal 0 0 1\n" * 20,
    },
    "field.png": {
        "no picture": b"\x89PNG\r\n\x1a\n" + b"x" * 100,
        "another format": picture(8, 8, "BMP"),
        "large": picture(3000, 3000),
        "one row": picture(8, 1),
    },
}


def test_a_damaged_or_huge_file_is_refused(tmp_path: Path, subtests: pytest.Subtests) -> None:
    path = tmp_path / "scene.xml"
    field = '<asset><hfield name="m" file="field.png" size="1 1 1 1"/></asset>'
    for name, cases in BAD_FILES.items():
        path.write_text(scene('<geom type="hfield" hfield="m"/>', field) if name == "field.png" else meshed(name))
        for case, content in cases.items():
            (tmp_path / name).write_bytes(content)
            with subtests.test(name, case=case):
                refusal(path)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has neither such devices nor such pipes")
@pytest.mark.parametrize("kind", ["folder", "pipe", "device", "missing"])
def test_a_mesh_that_is_no_file_is_refused(tmp_path: Path, kind: str) -> None:
    mesh = tmp_path / "mesh.obj"
    {"folder": mesh.mkdir, "pipe": lambda: os.mkfifo(mesh)}.get(kind, lambda: None)()
    if kind == "device":
        mesh.symlink_to("/dev/zero")
    (tmp_path / "scene.xml").write_text(meshed("mesh.obj"))
    refusal(tmp_path / "scene.xml")


REFUSED_BY_THE_ENGINE = {
    "no mass": "<body><freejoint/></body>",
    "two of one name": '<geom name="a" size="0.1"/><geom name="a" size="0.1"/>',
    "no such mesh": '<geom type="mesh" mesh="nothing"/>',
    "no such class": '<geom class="nothing" size="0.1"/>',
    "size of zero": '<geom type="box" size="0 0 0"/>',
    "wrong count": '<geom type="box" size="0.1" pos="1 2"/>',
    "no whole number": '<geom size="0.1" contype="1e3"/>',
    "spring of a free joint": f'<body><joint type="free" stiffness="5"/>{GEOM}</body>',
    "free within a thing": f"<body><freejoint/>{GEOM}<body><freejoint/>{GEOM}</body></body>",
}


def test_what_the_engine_refuses_is_said_of_the_scene(subtests: pytest.Subtests) -> None:
    from annelid.body import build_spec

    for name, world in REFUSED_BY_THE_ENGINE.items():
        with subtests.test(name):
            with pytest.raises(AnnelidError, match="scene") as error:
                build_spec(load_config("crawler", {"arena": {"kind": "scene", "xml": scene(world)}}))
            assert "\n" not in str(error.value)
