"""Files named by a model are read from its package and from folders given by the user, and from nowhere else."""

import shutil
import struct
from pathlib import Path

import pytest
from commands import call
from fuzz_seeds import CUBE, DAE, MATERIAL, SHOWN, STL
from fuzzing import DATA

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.allowed_paths import AllowedPaths

SECRET = b"token 1234567890"
PICTURE = b"\x89PNG\r\n\x1a\n" + b"pixels"
MESHES = {"box.obj": CUBE, "box.dae": DAE, "box.stl": STL, "box.mtl": MATERIAL}

SHOWN_SDF = """<sdf version="1.9"><model name="shown"><link name="arm"><inertial><mass>1</mass>
<inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
<visual name="v"><geometry><mesh><uri>NAME</uri></mesh></geometry></visual></link>
<joint name="j" type="revolute"><parent>world</parent><child>arm</child><axis><xyz>0 0.6 0.8</xyz></axis></joint>
</model></sdf>"""


@pytest.fixture
def model(tmp_path):
    """A folder with meshes, next to a private one."""
    (tmp_path / "model" / "meshes").mkdir(parents=True)
    (tmp_path / "private").mkdir()
    for name, text in MESHES.items():
        (tmp_path / "model" / "meshes" / name).write_text(text)
        (tmp_path / "private" / name).write_text(text)
    for folder in ("model/meshes", "private"):
        (tmp_path / folder / "box.png").write_bytes(PICTURE)
    (tmp_path / "private" / "key.txt").write_bytes(SECRET)
    (tmp_path / "private" / "key.mtl").write_bytes(SECRET + b"\nnewmtl red\nKd 1 0 0\n")
    (tmp_path / "private" / "key.png").write_bytes(SECRET)
    return tmp_path / "model"


def load(folder, name, more=""):
    """The mechanism of a URDF whose visual is a mesh, from a folder ``urdf``."""
    (folder / "urdf").mkdir(exist_ok=True)
    (folder / "urdf" / "shown.urdf").write_text(SHOWN.replace("NAME", name))
    if more:
        (folder / "urdf" / "shown.toml").write_text(f'[[source]]\nfile = "shown.urdf"\n{more}')
    return mbdae.load(folder / "urdf" / ("shown.toml" if more else "shown.urdf"))


def load_sdf(folder, name):
    """The same of an SDF."""
    path = folder / "meshes" / "shown.sdf"
    path.write_text(SHOWN_SDF.replace("NAME", name))
    return mbdae.load(path)


def drawn(mech):
    """The mesh that a page would contain, in bytes with all that it refers to; None without visuals."""
    meshes = [s.mesh for s in mech.scene.shapes if s.role == "visual"]
    return b"".join([meshes[0].data, *meshes[0].companions.values()]) if meshes else None


@pytest.mark.parametrize(
    "name",
    ["../meshes/box.obj", "meshes/box.dae", "package://model/meshes/box.stl", "file://{model}/meshes/a%20box.stl",
     "package://model/meshes/a%20box.stl", "file://{model}/meshes/a box.stl"],
)  # fmt: skip
def test_meshes_of_the_models_own_folder_are_drawn(model, name):
    (model / "meshes" / "box.stl").with_name("a box.stl").write_text(STL)
    assert drawn(load(model, name.format(model=model))) is not None


def test_folders_above_are_not_resolved_for_files_that_they_lack(model, monkeypatch):
    paths, resolved, resolve = AllowedPaths.from_model_file(model / "urdf" / "model.urdf"), [], Path.resolve
    monkeypatch.setattr(Path, "resolve", lambda path: resolved.append(path) or resolve(path))
    found = paths.find("package://model/meshes/box.stl")
    assert resolved == [found] == [model / "meshes" / "box.stl"]


@pytest.mark.parametrize(
    "name",
    ["../../private/box.obj", "{outside}/box.stl", "file://{outside}/box.dae", "package://private/box.stl",
     "package://model/../private/box.stl", "../meshes/link.stl", "../meshes/folder/box.stl"],
)  # fmt: skip
def test_meshes_elsewhere_are_not_read(model, name):
    outside = model.parent / "private"
    (model / "meshes" / "link.stl").symlink_to(outside / "box.stl")
    (model / "meshes" / "folder").symlink_to(outside)
    name = name.format(outside=outside)
    with pytest.warns(UserWarning, match=rf"visuals left out, .*outside of {model}: `packages` "):
        assert drawn(load(model, name)) is None
    assert drawn(load(model, name, 'packages = ["../../private"]')) is not None


def test_packages_with_manifests_find_each_other(model):
    name = "package://private/box.stl"
    for folder in (model, model.parent / "private"):
        (folder / "package.xml").write_text("<package/>")
    assert drawn(load(model, name)) is not None


@pytest.mark.parametrize("library", ["../../private/key.mtl", "{private}/key.mtl", "link.mtl", "../../private/key.txt"])
def test_material_libraries_elsewhere_are_not_read(model, library):
    private = model.parent / "private"
    (model / "meshes" / "link.mtl").symlink_to(private / "key.mtl")
    (model / "meshes" / "box.obj").write_text(CUBE.replace("box.mtl", library.format(private=private)))
    mech = load(model, "../meshes/box.obj")
    with pytest.warns(UserWarning, match=r"drawn without .*: not found with the mesh"):
        found = drawn(mech)
    assert SECRET not in found
    assert b"newmtl" not in found


def test_only_materials_and_pictures_are_carried_away(model):
    meshes, private = model / "meshes", model.parent / "private"
    library = MATERIAL + "map_Ks key.png\nmap_Ka ../../private/key.png\nmap_Ns key.txt\n"
    (meshes / "box.mtl").write_bytes(SECRET + b"\n" + library.encode())
    for name in ("key.txt", "key.png"):
        shutil.copy(private / name, meshes)
    mech = load(model, "../meshes/box.obj")
    with pytest.warns(UserWarning, match="drawn without"):
        found = drawn(mech)
    assert SECRET not in found
    assert b"Kd 1 0 0" in found
    assert PICTURE in found
    (meshes / "box.dae").write_text(DAE.replace("<library_g", "<init_from>key.png</init_from><library_g", 1))
    mech = load(model, "../meshes/box.dae")
    with pytest.warns(UserWarning, match=r"drawn without key\.png"):
        assert SECRET not in drawn(mech)


def test_a_saved_run_reads_what_its_mechanism_read(model, tmp_path):
    mech = load(model, "../meshes/box.stl")
    mbdae.solve(mech, (0, 1e-3), step=1e-3).save(tmp_path / "run.npz")
    assert drawn(mbdae.Solution.load(tmp_path / "run.npz").mechanism) == drawn(mech)


@pytest.mark.parametrize("read", [load, load_sdf])
def test_a_saved_run_reads_no_folder_that_it_names(read, model, tmp_path):
    """The file itself names the folder, and its author may have named any folder of the reader."""
    mech, path = read(model, "../meshes/box.obj"), tmp_path / "mail" / "run.npz"
    path.parent.mkdir()
    mbdae.solve(mech, (0, 1e-3), step=1e-3).save(path)
    with pytest.warns(UserWarning, match=r"s left out, .* from its folder and from installed packages; name further"):
        other = mbdae.Solution.load(path)
    assert drawn(other.mechanism) is None
    page = tmp_path / "page.html"
    _, _, err = call("animate", str(path), "-o", str(page))
    assert "name further folders by meshes=[...] or --meshes" in err
    assert drawn(mbdae.Solution.load(path, meshes=[model]).mechanism) == drawn(mech)
    code, _, err = call("animate", str(path), "-o", str(page), "--meshes", str(model))
    assert (code, err) == (0, "")


@pytest.mark.parametrize("folder", ["assets", "mail"])
@pytest.mark.parametrize("kind", ["obj", "dae"])
@pytest.mark.parametrize("suffix", ["urdf", "sdf"])
def test_meshes_of_a_saved_run_refer_to_no_file_above_its_folder(suffix, kind, folder, tmp_path):
    """Neither that of a package, nor that above a folder with the name of a folder of a package."""
    place = tmp_path / "home" / folder
    place.mkdir(parents=True)
    if folder == "mail":
        (place.parent / "package.xml").write_text("<package/>")
    for name in (place.parent / "private.png", place / "box.png"):
        name.write_bytes(PICTURE + name.stem.encode())
    (place / "box.mtl").write_text(MATERIAL + "map_Kd ../private.png\nmap_Ka box.png\n")
    (place / "box.obj").write_text(CUBE)
    textures = "<init_from>../private.png</init_from><init_from>box.png</init_from><library_g"
    (place / "box.dae").write_text(DAE.replace("<library_g", textures, 1))
    text = {"urdf": SHOWN, "sdf": SHOWN_SDF}[suffix].replace("NAME", f"box.{kind}")
    (place / f"shown.{suffix}").write_text(text)
    mech = mbdae.load(place / f"shown.{suffix}")
    assert PICTURE + b"private" in drawn(mech)
    mbdae.solve(mech, (0, 1e-3), step=1e-3).save(place / "run.npz")
    again = mbdae.Solution.load(place / "run.npz").mechanism
    with pytest.warns(UserWarning, match=r"drawn without \.\./private\.png"):
        found = drawn(again)
    assert PICTURE + b"box" in found
    assert PICTURE + b"private" not in found
    asked = mbdae.Solution.load(place / "run.npz", meshes=[place.parent]).mechanism
    assert drawn(asked) == drawn(mech)


def test_a_saved_run_takes_its_meshes_along(model, tmp_path):
    """Below the folder of the run they are found by their names."""
    (model / "urdf").mkdir()
    shutil.copy(model / "meshes" / "box.stl", model / "urdf")
    mech, path = load(model, "box.stl"), tmp_path / "mail" / "run.npz"
    seen = drawn(mech)
    path.parent.mkdir()
    mbdae.solve(mech, (0, 1e-3), step=1e-3).save(path)
    shutil.move(model / "urdf" / "box.stl", path.parent)
    assert drawn(mbdae.Solution.load(path).mechanism) == seen


def test_a_saved_run_reads_meshes_of_installed_packages(tmp_path):
    with pytest.warns(UserWarning, match="not carried over"):
        mech = mbdae.load("example-robot-data:double_pendulum_description/urdf/double_pendulum.urdf")
    mbdae.solve(mech, (0, 1e-3), step=1e-3).save(tmp_path / "run.npz")
    assert drawn(mech) is not None
    assert drawn(mbdae.Solution.load(tmp_path / "run.npz").mechanism) == drawn(mech)


# -- MJCF --------------------------------------------------------------------------------------------------------

BODY = '<worldbody><body><joint name="j"/><geom size="0.1"/></body></worldbody>'


@pytest.mark.parametrize(
    "text",
    [
        '<mujoco><include file="../private/more.xml"/>{body}</mujoco>',
        '<mujoco><include file="inner.xml"/>{body}</mujoco>',
        '<mujoco><include file="{private}/more.xml"/>{body}</mujoco>',
        '<mujoco><compiler meshdir="../private"/><asset><mesh name="m" file="box.stl"/></asset>{body}</mujoco>',
        "<mujoco><asset><mesh name='m' file = '&#46;./private/box.stl'/></asset>{body}</mujoco>",
        '<mujoco><asset><texture name="t" type="2d" file="link.png"/></asset>{body}</mujoco>',
    ],
)
def test_mjcf_reads_no_files_elsewhere(model, text):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    private = model.parent / "private"
    (private / "more.xml").write_text("<mujoco/>")
    (model / "inner.xml").write_text('<mujoco><include file="../private/more.xml"/></mujoco>')
    (model / "link.png").symlink_to(private / "key.png")
    (model / "x.xml").write_text(text.format(body=BODY, private=private))
    with pytest.raises(InputError, match=rf"outside of {model}: `packages` "):
        mbdae.load(model / "x.xml")


def test_mjcf_reads_its_own_files_and_those_of_packages(model):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    text = '<mujoco><include file="../common.xml"/><asset><mesh name="m" file="NAME/box.stl"/></asset></mujoco>'
    (model / "common.xml").write_text(f"<mujoco>{BODY}</mujoco>")
    (model / "mjcf").mkdir()
    # MuJoCo reads binary STL only
    binary = b"\0" * 80 + (4).to_bytes(4, "little")
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)):
        binary += struct.pack("<12fH", 0, 0, 0, *(x for i in face for x in corners[i]), 0)
    for folder in (model / "meshes", model.parent / "private"):
        (folder / "box.stl").write_bytes(binary)
    (model / "mjcf" / "x.xml").write_text(text.replace("NAME", "../meshes"))
    assert mbdae.load(model / "mjcf" / "x.xml").nv == 1
    (model / "mjcf" / "x.xml").write_text(text.replace("NAME", "../../private"))
    (model / "x.toml").write_text('[[source]]\nfile = "mjcf/x.xml"\npackages = ["../private"]')
    assert mbdae.load(model / "x.toml").nv == 1


@pytest.mark.parametrize(
    "text",
    ['<replicate count="1000"><replicate count="1000">{body}</replicate></replicate>',
     '<replicate count="+101"><replicate count="+101">{body}</replicate></replicate>',
     '<replicate count="2"><replicate count="3000">{body}</replicate></replicate>' * 2,
     '<replicate count="1000000000">{body}</replicate>',
     pytest.param('<replicate count="' + "9" * 5000 + '">{body}</replicate>', id="digits"),
     '<body><composite type="cable" count="1000000000 1 1"/></body>',
     '<body><flexcomp name="f" type="grid" count="1000 1000 1000" spacing="1 1 1"/></body>'],
)  # fmt: skip
def test_endless_mjcf_is_rejected(model, text):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    inner = BODY.removeprefix("<worldbody>").removesuffix("</worldbody>")
    (model / "x.xml").write_text(f"<mujoco><worldbody>{text.format(body=inner)}</worldbody></mujoco>")
    with pytest.raises(InputError, match="beyond 10000"):
        mbdae.load(model / "x.xml")


# -- robot.yaml --------------------------------------------------------------------------------------------------


def test_aliases_that_explode_are_rejected(tmp_path):
    """600 bytes that expand to ten to the ninth entries."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 9)]
    for text, size in (("\n".join([*lines, "name_mot: *a8"]), r"2\.35e\+09"), ("name_mot: &x [*x]", "inf")):
        (tmp_path / "robot.yaml").write_text(text)
        message = rf"robot.yaml: it has {size} entries with its aliases expanded, more than 100000$"
        with pytest.raises(InputError, match=message):
            mbdae.load(tmp_path / "robot.yaml")
    robot = DATA / "robot"
    shutil.copy(robot / "robot.urdf", tmp_path)
    text = (robot / "robot.yaml").read_text() + "\nmore: &x [1]\nagain: *x\n"
    (tmp_path / "robot.yaml").write_text(text)
    with pytest.warns(UserWarning, match=r"keys of robot\.yaml again, more"):
        assert mbdae.load(tmp_path / "robot.yaml").nv > 0
