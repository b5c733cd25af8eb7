"""A cart with a pendulum by hand: as FMUs of both kinds, a MuJoCo model and a function of Python."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from fmpy import platform, sharedLibraryExtension

from rigsight.libraries.library_cache import c_compilers, library

GRAVITY = 9.81
MASSES = {"m_c": 0.8, "m_p": 0.2}
LENGTH, TURNING = 0.3, 0.002
"""From the pivot to the center of the pendulum [m], and its inertia about the center [kg m^2]."""

RIG = """
name = "cart_and_pendulum"
summary = "A cart with a pendulum, moved by another program."
[inputs.u]
unit = "V"
[parameters.m_p]
unit = "kg"
default = 0.2
lower = 1e-3
[parameters.k_u]
unit = "N/V"
default = 2.0
[parameters.d_c]
unit = "N s/m"
default = 1.5
lower = 0.0
[parameters.k_c]
unit = "N/m"
default = 25.0
lower = 0.0
[parameters.d_p]
unit = "N m s/rad"
default = 0.004
lower = 0.0
[coordinates.x]
unit = "m"
[coordinates.phi]
unit = "rad"
[joints.track]
motion = "x"
stiffness = "k_c"
damping = "d_c"
[joints.pivot]
motion = "phi"
damping = "d_p"
[drives.motor]
signal = "u"
force = "k_u*motor"
along = "x"
[sensors.cart]
reads = "x"
unit = "m"
[sensors.angle]
reads = "phi"
unit = "rad"
"""
NATIVE = f"""
[energy]
kinetic = "({MASSES["m_c"]} + m_p)*d(x)^2/2 + ({TURNING} + m_p*{LENGTH}^2)*d(phi)^2/2 + {LENGTH}*m_p*d(x)*d(phi)*cos(phi)"
potential = "-{LENGTH}*m_p*{GRAVITY}*cos(phi)"
"""
FMU = """
[simulator]
kind = "fmu"
file = "FILE"
[simulator.coordinates]
x = "position"
phi = "angle"
[simulator.rates]
x = "speed"
phi = "turning"
[simulator.forces]
x = "force"
phi = "torque"
[simulator.parameters]
m_p = "pendulum.mass"
"""
PYTHON = """
[simulator]
kind = "python"
file = "cart"
[simulator.parameters]
m_p = "mass"
"""
MUJOCO = """
[simulator]
kind = "mujoco"
file = "FILE"
[simulator.coordinates]
x = "slide"
phi = "hinge"
[simulator.parameters]
m_p = "body_mass pendulum"
"""
MJCF = f"""
<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <worldbody>
    <body name="cart">
      <joint name="slide" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="{MASSES["m_c"]}" diaginertia="1 1 1"/>
      <body name="pendulum">
        <joint name="hinge" axis="0 -1 0"/>
        <inertial pos="0 0 {-LENGTH}" mass="{MASSES["m_p"]}" diaginertia="{TURNING} {TURNING} {TURNING}"/>
      </body>
    </body>
  </worldbody>
</mujoco>"""


def accelerations(q, v, forces, parameters):
    """Return the accelerations of cart and pendulum."""
    mass = parameters["mass"]
    coupling = mass * LENGTH * np.cos(q[1])
    matrix = [[MASSES["m_c"] + mass, coupling], [coupling, TURNING + mass * LENGTH**2]]
    pushed = [
        forces[0] + mass * LENGTH * np.sin(q[1]) * v[1] ** 2,
        forces[1] - mass * GRAVITY * LENGTH * np.sin(q[1]),
    ]
    return np.linalg.solve(matrix, pushed)


_EQUATIONS = f"""
#include <math.h>
#include <stdlib.h>
#include <string.h>
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
/* 0 position, 1 angle, 2 speed, 3 turning, 4 to 7 their derivatives, 8 force, 9 torque, 10 mass */
typedef struct {{ double value[11], time, lag; int fixed; }} own;
static int start(own *c) {{ memset(c, 0, sizeof *c); c->value[10] = {MASSES["m_p"]}; return 0; }}
static void *made(void) {{ own *c = calloc(1, sizeof *c); start(c); return c; }}
static int rates(const own *c, double *dx) {{
    const double *y = c->value, m = y[10], l = {LENGTH}, k = m * l * cos(y[1]);
    const double a = {MASSES["m_c"]} + m, b = {TURNING} + m * l * l, e = y[8] + m * l * sin(y[1]) * y[3] * y[3];
    const double f = y[9] - m * {GRAVITY} * l * sin(y[1]), det = a * b - k * k;
    if (m < 0.0) return 3;
    dx[0] = y[2]; dx[1] = y[3]; dx[2] = (b * e - k * f) / det; dx[3] = (a * f - k * e) / det;
    FAULT
    return 0;
}}
/* Heun's rule at a step of its own of a millisecond or less. */
static int stepped(own *c, double length) {{
    const int steps = 1 + (int)(length / 1.0001e-3);
    const double h = length / steps;
    double dx[4], dy[4];
    int i, k, status = 0;
    for (k = 0; k < steps && !status; k++) {{
        own there = *c;
        status = rates(c, dx);
        for (i = 0; i < 4; i++) there.value[i] += h * dx[i];
        status = status ? status : rates(&there, dy);
        for (i = 0; i < 4; i++) c->value[i] += 0.5 * h * (dx[i] + dy[i]);
        c->time += h;
        c->lag += 5.0 * h * (c->value[0] - c->lag);
    }}
    return status;
}}
"""
_WRAPPERS = {
    "2.0": """
typedef struct { int again, ends, nominals, values, defined; double next; } event;
EXPORT void *fmi2Instantiate(const char *n, int type, const char *guid, const char *r, const void *calls, int v, int l) {
    return !strcmp(guid, "by-hand") ? made() : NULL; }
EXPORT void fmi2FreeInstance(void *c) { free(c); }
EXPORT int fmi2SetupExperiment(void *c, int a, double b, double d, int e, double f) { return 0; }
EXPORT int fmi2EnterInitializationMode(void *c) { return 0; }
EXPORT int fmi2ExitInitializationMode(void *c) { INITIALIZED return 0; }
EXPORT int fmi2NewDiscreteStates(void *c, event *e) { memset(e, 0, sizeof *e); return 0; }
EXPORT int fmi2EnterContinuousTimeMode(void *c) { return 0; }
EXPORT int fmi2SetReal(void *c, const unsigned *r, size_t n, const double *y) {
    size_t i; for (i = 0; i < n; i++) if (r[i] > 3 || !((own *)c)->fixed) ((own *)c)->value[r[i]] = y[i]; return 0; }
EXPORT int fmi2SetContinuousStates(void *c, const double *x, size_t n) { memcpy(((own *)c)->value, x, 8 * n); return 0; }
EXPORT int fmi2GetDerivatives(void *c, double *dx, size_t n) { return rates(c, dx); }
EXPORT int fmi2Reset(void *c) { return start(c); }
EXPORT int fmi2GetReal(void *c, const unsigned *r, size_t n, double *y) {
    size_t i; for (i = 0; i < n; i++) y[i] = ((own *)c)->value[r[i]]; return 0; }
EXPORT int fmi2DoStep(void *c, double t, double h, int v) { return stepped(c, h); }
""",
    "3.0": """
EXPORT void *fmi3InstantiateModelExchange(const char *n, const char *token, const char *r, _Bool v, _Bool l, void *e, void *m) {
    return !strcmp(token, "by-hand") ? made() : NULL; }
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void *c, _Bool a, double b, double d, _Bool e, double f) { return 0; }
EXPORT int fmi3ExitInitializationMode(void *c) { return 0; }
EXPORT int fmi3UpdateDiscreteStates(void *c, _Bool *a, _Bool *b, _Bool *d, _Bool *e, _Bool *f, double *g) {
    *a = *b = *d = *e = *f = 0; return 0; }
EXPORT int fmi3EnterContinuousTimeMode(void *c) { return 0; }
EXPORT int fmi3SetFloat64(void *c, const unsigned *r, size_t n, const double *y, size_t m) {
    size_t i; for (i = 0; i < n; i++) ((own *)c)->value[r[i]] = y[i]; return 0; }
EXPORT int fmi3SetContinuousStates(void *c, const double *x, size_t n) { memcpy(((own *)c)->value, x, 8 * n); return 0; }
EXPORT int fmi3GetContinuousStateDerivatives(void *c, double *dx, size_t n) { return rates(c, dx); }
EXPORT void *fmi3InstantiateCoSimulation(const char *n, const char *token, const char *r, _Bool v, _Bool l, _Bool e, _Bool a,
    const unsigned *i, size_t m, void *o, void *g, void *u) { return !strcmp(token, "by-hand") ? made() : NULL; }
EXPORT int fmi3Reset(void *c) { return start(c); }
EXPORT int fmi3GetFloat64(void *c, const unsigned *r, size_t n, double *y, size_t m) {
    size_t i; for (i = 0; i < n; i++) y[i] = ((own *)c)->value[r[i]]; return 0; }
EXPORT int fmi3DoStep(void *c, double t, double h, _Bool v, _Bool *event, _Bool *ends, _Bool *early, double *reached) {
    *event = *ends = *early = 0; *reached = t + h; return stepped(c, h); }
""",
}
_STATES = ("position", "angle", "speed", "turning")


def _description(version: str, kind: str) -> str:
    steps = ' canHandleVariableCommunicationStepSize="true"' if kind == "CoSimulation" else ""
    if version == "2.0":
        scalar = '<ScalarVariable name="{}" valueReference="{}" causality="{}" variability="{}"><Real {}/></ScalarVariable>'
    else:
        scalar = '<Float64 name="{}" valueReference="{}" causality="{}" variability="{}" {}/>'
    rows = [
        scalar.format(name, i, "output", 'continuous" initial="exact', 'start="0"')
        for i, name in enumerate(_STATES)
    ]
    shift = 1 if version == "2.0" else 0
    rows += [
        scalar.format(f"der({name})", 4 + i, "local", "continuous", f'derivative="{i + shift}"')
        for i, name in enumerate(_STATES)
    ]
    rows += [
        scalar.format(name, 8 + i, "input", "continuous", 'start="0"')
        for i, name in enumerate(("force", "torque"))
    ]
    if version == "3.0":
        rows.append(scalar.format("time", 11, "independent", "continuous", ""))
    rows.append(scalar.format("pendulum.mass", 10, "parameter", "fixed", f'start="{MASSES["m_p"]}"'))
    if version == "2.0":
        unknowns = "".join(f'<Unknown index="{5 + i}"/>' for i in range(4))
        structure, key = f"<Derivatives>{unknowns}</Derivatives>", "guid"
    else:
        structure = "".join(f'<ContinuousStateDerivative valueReference="{4 + i}"/>' for i in range(4))
        key = "instantiationToken"
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="{version}" modelName="cart" {key}="by-hand"'
        f"{' numberOfEventIndicators=' + chr(34) + '0' + chr(34) if version == '2.0' else ''}>"
        f'<{kind} modelIdentifier="cart"{steps}/><ModelVariables>{"".join(rows)}</ModelVariables>'
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def written_fmu(
    path: Path, version: str = "2.0", kind: str = "ModelExchange", fault: str = "", initialized: str = ""
) -> Path:
    """Write the FMU and return its path.

    C text of a fault is executed with each evaluation of its equations, that of initial equations after they are set.
    """
    text = _EQUATIONS.replace("FAULT", fault) + _WRAPPERS[version].replace("INITIALIZED", initialized)
    binary = library(c_compilers()[0], {"cart.c": text}, ("-O2", "-w"))
    folder = (
        platform
        if version == "2.0"
        else {"linux64": "x86_64-linux", "win64": "x86_64-windows"}.get(platform, platform)
    )
    with zipfile.ZipFile(path, "w") as fmu:
        fmu.writestr("modelDescription.xml", _description(version, kind))
        fmu.writestr(f"binaries/{folder}/cart{sharedLibraryExtension}", binary)
    return path
