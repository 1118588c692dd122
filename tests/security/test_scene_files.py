"""Scenes from strangers: what an MJCF file could open, load or take too much of is refused in a sentence."""

from __future__ import annotations

import os
import re
import struct
import sys
from io import BytesIO
from pathlib import Path

import mujoco
import pytest
from PIL import Image

from annelid.arena.mjcf import MOST_BYTES, ROBOT, SCENE, checked
from annelid.arena.mjcf_files import MOST_FILE_BYTES, read_mjcf
from annelid.config import RunConfig, load_config
from annelid.errors import AnnelidError, ConfigError

GEOM = '<geom type="sphere" size="0.1"/>'
TEXTURE = '<texture type="2d" builtin="flat" width="1500" height="1500"/>'
BOMB = "".join(f'<!ENTITY l{i + 1} "{f"&l{i};" * 10}">' for i in range(9))


def scene(world: str = GEOM, before: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{world}</worldbody></mujoco>"


ANYWHERE = {
    "entity bomb": (f'<!DOCTYPE m [<!ENTITY l0 "ha">{BOMB}]><mujoco>&l9;</mujoco>', "document type"),
    "external entity": ('<!DOCTYPE m [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco/>', "document type"),
    "include": (scene(before='<include file="other.xml"/>'), "write its content into the file"),
    "include in the world": (scene('<include file="/etc/passwd"/>'), "write its content into the file"),
    "model in a model": (scene(before='<asset><model name="m"/></asset>'), "write its content into the file"),
    "plug-in": (scene(before='<extension><plugin plugin="mujoco.sdf.torus"/></extension>'), "plug-ins are code"),
    "plug-in of a body": (scene(f'<body><plugin plugin="mujoco.elasticity.cable"/>{GEOM}</body>'), "plug-ins are code"),
    "replicate": (scene(f'<replicate count="1000000">{GEOM}</replicate>'), "write out"),
    "flexcomp": (scene('<flexcomp name="f" type="grid" count="900 900 900"/>'), "write its bodies out"),
    "made mesh": (scene(before='<asset><mesh name="m" builtin="sphere" params="20"/></asset>'), "cannot have this"),
    "endless search": (scene(before='<compiler><lengthrange inttotal="1e6"/></compiler>'), "cannot have this"),
    "endless": (scene('<geom type="sphere" size="1e999"/>'), "numbers must be finite"),
    "huge": (scene('<geom type="sphere" size="1e7"/>'), "at most 1e+06"),
    "not a number": (scene('<geom type="sphere" size="nan"/>'), "numbers must be finite"),
    **{
        f"number of C {number}": (scene(f'<geom type="sphere" size="{number}"/>'), f"<geom size='{number}'>: {reason}")
        for number, reason in {
            "0x1p30": "write '0x1p30' in decimals",
            "-0X.8": "write '-0X.8' in decimals",
            "nan(1)": "write 'nan(1)' in decimals",
            "infinity": "numbers must be finite",
            "-INF": "numbers must be finite",
        }.items()
    },
    "number of C among others": (scene('<geom size="0.1" pos="0 0x1p30 0"/>'), "write '0x1p30' in decimals"),
    "amount of C": (scene(before='<asset><texture name="t" builtin="flat" width="0x4000"/></asset>'), "in decimals"),
    "many pixels": (scene(before=f"<asset>{TEXTURE * 2}</asset>"), "at most 4,000,000"),
    "many samples": (
        scene(before='<asset><hfield name="h" nrow="90000" ncol="90000" size="1 1 1 1"/></asset>'),
        "at most 4,000,000",
    ),
    "many by default": (scene(before='<default><texture width="999" height="999"/></default>'), "<default>"),
    "many elements": (scene(GEOM * 20_001), ",000 elements"),
    "deep": (scene("<body>" * 500 + GEOM + "</body>" * 500), "levels"),
    "no XML": ("<mujoco", "not valid XML"),
    "null": ("<mujoco>\x00</mujoco>", "not valid XML"),
    "another language": ("<robot/>", "begins with <mujoco>"),
    "namespace": ('<m:mujoco xmlns:m="http://example.org/"/>', "begins with <mujoco>"),
    "too long": (scene(before=f"<!--{'x' * MOST_BYTES}-->"), "MB"),
}
"""What neither a scene nor a robot can have."""
FROM_A_FILE = {
    "include": "cannot read an included file",
    "include in the world": "must be a relative path below the folder",
}
"""What is said instead of a file, which may include others of its folder."""
IN_A_SCENE = {
    "option": (scene(before='<option timestep="1" gravity="0 0 9"/>'), "fields of the configuration"),
    "masses of the whole": (scene(before='<compiler settotalmass="5"/>'), "cannot have this attribute"),
    "actuator": (scene(before='<actuator><motor joint="x"/></actuator>'), "nothing drives"),
    "keyframe": (scene(before='<keyframe><key qpos="1"/></keyframe>'), "starts as it is written"),
    "tendon": (scene(before='<tendon><fixed><joint joint="x" coef="1"/></fixed></tendon>'), "stiffness"),
    "many things": (scene(f"<body><freejoint/>{GEOM}</body>" * 20), "20 bodies that move"),
    "joint in a frame": (scene(f'<body><frame><joint type="slide"/></frame>{GEOM}</body>'), "into the body around"),
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
    for name, (text, reason) in (ANYWHERE | IN_A_SCENE).items():
        with subtests.test(name):
            path.write_text(text, encoding="utf-8")
            assert FROM_A_FILE.get(name, reason) in refusal(path)
            with pytest.raises(ConfigError, match=r"arena\.xml"):
                load_config("crawler", {"arena": {"kind": "scene", "xml": text}})
            with pytest.raises(ValueError, match=r"arena\.xml"):
                RunConfig.model_validate(whole | {"arena": {"kind": "scene", "xml": text}})
            if name in ANYWHERE:
                with pytest.raises(ConfigError, match=re.escape(reason)):
                    checked(text, ROBOT)


def test_every_attribute_in_which_the_engine_takes_a_file_is_refused() -> None:
    """As the engine itself lists them; of folders it takes nothing without a file."""
    schema = set(re.findall(r"[\w]+", mujoco.mj_printSchema(0, 1)))
    files = {word for word in schema if "file" in word}
    assert {"file", "fileup", "fileright"} <= files
    for name in files:
        for rules in (SCENE, ROBOT):
            with pytest.raises(ConfigError, match=f"<texture {name}=.*cannot have this attribute"):
                checked(scene(before=f'<asset><texture name="t" {name}="t.png"/></asset>'), rules)


def test_what_a_file_has_to_look_at_is_left_out(tmp_path: Path) -> None:
    looks = '<visual><map znear="0.1"/></visual><size memory="900G"/><statistic extent="1"/>'
    text = checked(scene(f'<light pos="0 0 9"/><camera name="c"/>{GEOM}', looks))
    assert text == checked(scene())


def test_the_text_of_a_configuration_opens_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only a scene that the user names is read with its meshes; the same text in a run file or a TOML file is not."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.obj").write_text(OBJ)
    (tmp_path / "scene.xml").write_text(meshed("m.obj"))
    assert "file=" not in read_mjcf(tmp_path / "scene.xml")
    with pytest.raises(ConfigError, match="cannot have this attribute"):
        load_config("crawler", {"arena": {"kind": "scene", "xml": meshed("m.obj")}})
    (tmp_path / "mine.toml").write_text('[arena]\nkind = "scene"\nxml = "scene.xml"\n')
    with pytest.raises(ConfigError, match="not valid XML"):
        load_config("crawler", arena="mine.toml")


OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def meshed(name: str, folder: str = "") -> str:
    compiler = f'<compiler meshdir="{folder}"/>' if folder else ""
    return scene('<geom type="mesh" mesh="m"/>', f'{compiler}<asset><mesh name="m" file="{name}"/></asset>')


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_mesh_lies_beside_its_scene_or_below(tmp_path: Path, subtests: pytest.Subtests) -> None:
    home = tmp_path / "home"
    (home / "below").mkdir(parents=True)
    (tmp_path / "outside.obj").write_text(OBJ)
    (home / "below" / "mesh.txt").write_text(OBJ)
    (home / "below" / "real.obj").write_text(OBJ)
    (home / "inner.obj").symlink_to(home / "below" / "real.obj")
    (home / "link.obj").symlink_to(tmp_path / "outside.obj")
    (home / "linked").symlink_to(tmp_path)
    (home / "loop.obj").symlink_to(home / "loop.obj")
    path = home / "scene.xml"
    for name, folder in (("real.obj", "below"), ("inner.obj", "")):
        path.write_text(meshed(name, folder))
        assert "face=" in read_mjcf(path)
    for name, folder in (
        (f"{tmp_path}/outside.obj", ""),
        ("../outside.obj", ""),
        ("outside.obj", ".."),
        ("outside.obj", str(tmp_path)),
        ("outside.obj", "below/../.."),
        ("..\\outside.obj", ""),
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


def picture(width: int, height: int, form: str = "PNG") -> bytes:
    content = BytesIO()
    Image.new("L", (width, height)).save(content, form)
    return content.getvalue()


BAD_FILES = {
    "mesh.obj": {
        "too long": b"#" * (MOST_FILE_BYTES + 1),
        "long as text": b"v .1 .1 .1\n" * 360_000 + b"f 1 2 3\n",
        "no numbers": b"v a b c\nf 1 2 3\n",
        "corner without vertex": OBJ.replace("3 1 4", "3 1 9").encode(),
        "corner before the first": OBJ.replace("3 1 4", "3 1 -9").encode(),
        "not finite": OBJ.replace("1 0 0", "nan 0 0").encode(),
        "empty": b"",
        "two coordinates": b"v 0 0\nv 1 0\nv 0 1\nv 1 1\nf 1 2 3\n",
    },
    "mesh.stl": {
        "text": b"solid x\nfacet normal 0 0 1\n" * 20,
        "says more than it has": b"\0" * 80 + struct.pack("<I", 4_000_000_000) + b"\0" * 200,
        "one point": b"\0" * 80 + struct.pack("<I", 4) + b"\0" * 200,
    },
    "field.png": {
        "no picture": b"\x89PNG\r\n\x1a\nx",
        "another format": picture(8, 8, "BMP"),
        "large": picture(3000, 3000),
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
def test_a_mesh_that_is_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.xml").write_text(meshed("mesh.obj"))
    refusal(tmp_path / "scene.xml")
    (mesh := tmp_path / "mesh.obj").symlink_to("/dev/zero")
    refusal(tmp_path / "scene.xml")
    mesh.unlink()
    os.mkfifo(mesh)
    refusal(tmp_path / "scene.xml")


def test_what_the_engine_refuses_is_said_of_the_scene() -> None:
    from annelid.body import build_spec

    for world in (
        "<body><freejoint/></body>",
        '<geom type="mesh" mesh="nothing"/>',
        '<geom size="0.1" colour="red"/>',
        "<cube/>",
        f'<body><joint type="free" stiffness="5"/>{GEOM}</body>',
    ):
        with pytest.raises(AnnelidError, match="scene") as error:
            build_spec(load_config("crawler", {"arena": {"kind": "scene", "xml": scene(world)}}))
        assert "\n" not in str(error.value)
