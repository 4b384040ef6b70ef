"""FMUs of a motor, compiled from C with the headers of the standard, as another program would export them."""

import shutil
import subprocess
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import pytest

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install 'mbdae[fmi]'")

HERE, HEADERS = Path(__file__).parent, Path(fmpy.__file__).parent / "c-code"
NAMES = ("angle", "speed", "torque", "kp", "kd", "T", "gain", "feed", "reference", "steps", "fail")
DEGREE = 0.017453292519943295
UNITS = {"angle": "deg", "speed": "deg/s", "torque": "N.cm"}
DIFFERENCE = {
    2: '<SimpleType name="difference"><Real relativeQuantity="true"/></SimpleType>',
    3: '<Float64Type name="difference" relativeQuantity="true"/>',
}
FACTORS = {"deg": DEGREE, "deg/s": DEGREE, "N.cm": 0.01}


@cache
def library(version):
    """The library of the motor; functions of the standard that it lacks, which FMPy loads too, fail."""
    compiler = shutil.which("cc") or pytest.skip("no C compiler")
    interface = {2: fmpy.fmi2.FMU2Slave, 3: fmpy.fmi3.FMU3Slave}[version]
    names = [name for name in dir(interface) if name.startswith(f"fmi{version}")]
    flags = ["-shared", "-fPIC", "-O1", "-Wall", "-Werror", f"-DFMI={version}", f"-I{HEADERS}"]
    with tempfile.TemporaryDirectory() as folder:
        stubs, out = Path(folder, "stubs.c"), Path(folder, "motor.so")
        stubs.write_text("\n".join(f"__attribute__((weak)) int {name}(void) {{ return 3; }}" for name in names))
        subprocess.run([compiler, *flags, "-o", str(out), str(HERE / "motor.c"), str(stubs), "-lm"], check=True)
        return out.read_bytes()


def motor(folder, version=3, units=False, saves=True, **changes):
    """Write the FMU of a motor; return its path.

    Args:
        folder: where.
        version: of FMI, 2 or 3.
        units: angle in degrees, torque in N cm.
        saves: whether it says that it can save its state.
        changes: parts of the file that are wrong: kind, platform, fmi; or the type of gain, and the offset of units of
            differences.
    """
    path = Path(folder) / changes.get("name", f"motor{version}{'_units' * units}{'' if saves else '_forgets'}.fmu")
    platform = {2: fmpy.platform, 3: fmpy.platform_tuple}[version]
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", description(version, units, saves, **changes))
        file.writestr(f"binaries/{changes.get('platform', platform)}/motor.so", library(version))
    return path


def description(version, units, saves, kind="CoSimulation", fmi=None, once=False, offset=0.0, gain="", **_):
    """modelDescription.xml."""
    u, state = {2: ("UnitDefinitions", "FMUstate"), 3: ("UnitDefinitions", "FMUState")}[version]
    able = f'canGetAndSet{state}="{str(saves).lower()}" canSerialize{state}="{str(saves).lower()}"'
    able += ' canBeInstantiatedOnlyOncePerProcess="true"' if once else ""
    token = "guid" if version == 2 else "instantiationToken"
    base = {x: f'<BaseUnit rad="1" factor="{FACTORS[x]!r}" offset="{offset}"/>' for x in FACTORS}
    used = "".join(f'<Unit name="{x}">{base[x]}</Unit>' for x in FACTORS)
    variables = "".join(variable(i, version, units, offset, gain) for i in range(len(NAMES)))
    return (
        f'<fmiModelDescription fmiVersion="{fmi or f"{version}.0"}" modelName="motor" {token}="motor{version}">'
        f'<{kind} modelIdentifier="motor" {able}/>'
        f"{f'<{u}>{used}</{u}>' if units else ''}<TypeDefinitions>{DIFFERENCE[version]}</TypeDefinitions>"
        f"<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure/></fmiModelDescription>"
    )


def variable(i, version, units, offset, gain):
    """One variable."""
    name, number = NAMES[i], NAMES[i] == "steps"
    causality = "input" if i < 2 else "output" if i == 2 else "parameter"
    unit = f'unit="{UNITS[name]}" ' if units and name in UNITS else ""
    unit += 'declaredType="difference" ' if unit and offset else ""
    kind = (gain if name == "gain" else "") or {2: ("Real", "Integer"), 3: ("Float64", "Int32")}[version][number]
    start = "" if causality == "output" else f'start="{0 if number else 1 if name in ("kp", "gain") else 0.0}" '
    vary = 'variability="fixed" initial="exact" ' if causality == "parameter" else ""
    head = f'name="{name}" valueReference="{i}" causality="{causality}" {vary}'
    if version == 3:
        return f"<{kind} {head}{unit}{start}/>"
    return f"<ScalarVariable {head}><{kind} {unit}{start}/></ScalarVariable>"
