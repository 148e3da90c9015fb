"""The same scene in PyBullet and MuJoCo: `python -m benchmarks.engines [--steps 20000] [--runs 5]`.

A kuka on a plane follows joint targets beside four cubes, which first fall and then rest. Both engines read the same
URDF, take the same time step and get a new target at the same steps. Prints physics steps a second on one core, the
median of runs that alternate, with sleeping of objects at rest in PyBullet on and off (MuJoCo 4 has its own `sleep`).
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import mujoco
import numpy as np
import pybullet as bullet
import pybullet_data
from numpy.typing import NDArray

TIME_STEP, SUBSTEPS, ITERATIONS = 1 / 240, 12, 10
JOINTS, TORQUE = 7, 300.0
HALF, MASS, FRICTION = 0.02, 0.1, 0.5  # of a cube: metres, kg
PLACES = ((0.5, 0.1), (0.5, -0.1), (0.6, 0.1), (0.6, -0.1))
REST = np.array([0.0, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0])
URDF = Path(pybullet_data.getDataPath()) / "kuka_iiwa" / "model.urdf"
Step = Callable[[NDArray[np.float64]], object]  # `SUBSTEPS` physics steps towards joint targets (J,)


def targets(count: int) -> NDArray[np.float64]:
    """(count, J) radians: each joint sways about the rest pose."""
    phase = np.linspace(0, 20 * np.pi, count)[:, None] * np.linspace(0.5, 1.5, JOINTS)
    return REST + 0.15 * np.sin(phase)


def make_bullet(sleeping: bool) -> Step:
    """Return the step of the scene in PyBullet."""
    client = bullet.connect(bullet.DIRECT)
    bullet.setAdditionalSearchPath(pybullet_data.getDataPath(), client)
    bullet.setGravity(0, 0, -9.81, client)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=TIME_STEP, numSolverIterations=ITERATIONS, deterministicOverlappingPairs=1, physicsClientId=client
    )
    bullet.loadURDF("plane.urdf", physicsClientId=client)
    arm = bullet.loadURDF(str(URDF), useFixedBase=True, physicsClientId=client)
    shape = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[HALF] * 3, physicsClientId=client)
    for x, y in PLACES:
        cube = bullet.createMultiBody(MASS, shape, -1, (x, y, 1.5 * HALF), physicsClientId=client)
        if sleeping:
            flag = bullet.ACTIVATION_STATE_ENABLE_SLEEPING
            bullet.changeDynamics(cube, -1, activationState=flag, sleepThreshold=0.05, physicsClientId=client)
    for joint, angle in enumerate(REST):
        bullet.resetJointState(arm, joint, angle, physicsClientId=client)

    def step(target: NDArray[np.float64]) -> None:
        bullet.setJointMotorControlArray(
            arm,
            range(JOINTS),
            bullet.POSITION_CONTROL,
            targetPositions=target.tolist(),
            forces=[TORQUE] * JOINTS,
            positionGains=[0.3] * JOINTS,
            physicsClientId=client,
        )
        for _ in range(SUBSTEPS):
            bullet.stepSimulation(client)
        bullet.getJointStates(arm, range(JOINTS), physicsClientId=client)

    return step


def make_mujoco(sleeping: bool) -> Step:
    """Return the step of the scene in MuJoCo."""
    spec = mujoco.MjSpec.from_file(str(URDF))
    spec.compiler.balanceinertia = True
    for geom in spec.geoms:  # as in PyBullet, the links of the arm do not collide with each other
        geom.contype, geom.conaffinity = 2, 1
    spec.option.timestep, spec.option.iterations = TIME_STEP, ITERATIONS
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if sleeping:
        spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    other = {"friction": [FRICTION, 0.005, 0.0001], "contype": 1, "conaffinity": 3}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2, 2, 0.1], **other)
    for x, y in PLACES:
        cube = spec.worldbody.add_body(pos=[x, y, 1.5 * HALF])
        cube.add_freejoint()
        cube.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[HALF] * 3, mass=MASS, condim=4, **other)
    hinges = [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_HINGE]
    for joint in hinges:
        drive = spec.add_actuator(target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        drive.set_to_position(kp=2000.0, kv=200.0)
        drive.forcelimited, drive.forcerange = True, [-TORQUE, TORQUE]
    model = spec.compile()
    data = mujoco.MjData(model)
    places = [model.joint(joint.name).qposadr[0] for joint in hinges]
    data.qpos[places] = REST

    def step(target: NDArray[np.float64]) -> NDArray[np.float64]:
        data.ctrl[:] = target
        mujoco.mj_step(model, data, SUBSTEPS)
        return data.qpos[places].copy()

    return step


ENGINES: dict[str, Callable[[], Step]] = {
    "PyBullet": lambda: make_bullet(False),
    "PyBullet, sleeping": lambda: make_bullet(True),
    "MuJoCo": lambda: make_mujoco(False),
    "MuJoCo, sleeping": lambda: make_mujoco(True),
}


def cli(words: Sequence[str] | None = None) -> int:
    """Print a row for each engine. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=20_000, help="physics steps of a run")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args(words)
    moves = targets(options.steps // SUBSTEPS)
    engines = {name: make() for name, make in ENGINES.items()}
    rates: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(options.runs):
        for name, step in engines.items():
            begin = time.perf_counter()
            for target in moves:
                step(target)
            rates[name].append(len(moves) * SUBSTEPS / (time.perf_counter() - begin))
    print("| engine | physics steps a second | least and most |\n|---|---|---|")
    for name, found in rates.items():
        print(f"| {name} | {statistics.median(found):,.0f} | {min(found):,.0f} to {max(found):,.0f} |")
    return 0


if __name__ == "__main__":
    sys.exit(cli())
