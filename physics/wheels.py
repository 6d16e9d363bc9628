"""A rover on four wheels in contact with the ground: the audit of the sliding body that missions are simulated with.

Slower by far (a hundred steps a second, every wheel a joint and a contact), so it drives one rover along one path.
Across their rims wheels grip half as well as along them, which turns a Husky about as its maker's multiplier says.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from quarterdeck.geo.scenario import Vehicle
from quarterdeck.mission.mission import Waypoint
from quarterdeck.physics.figures import number, numbers
from quarterdeck.physics.guidance import guide_rovers
from quarterdeck.physics.paths import IDLE, WAYPOINT, command_track, empty_tracks, vehicle_limits
from quarterdeck.physics.world import open_world

STEP = 0.01  # s
GUIDE = 10  # steps between calls of guidance
GRAVITY = 9.80665
GRIP = (1.0, 0.5, 1.0)  # friction along, across and about the wheel, of the coefficient


@dataclass(frozen=True, slots=True)
class Wheeled:
    """A drive on wheels: `time` (t,), `track` (t, 3) x, y, heading, `cross` (t,) metres to port, `turning` (t,) near a
    corner, `rates` (t, 2) rad/s of turn asked for and had; `finished` within the time allowed.
    """

    time: np.ndarray
    track: np.ndarray
    cross: np.ndarray
    turning: np.ndarray
    rates: np.ndarray
    finished: bool


def drive_on_wheels(vehicle: Vehicle, waypoints: Sequence[Waypoint], *, duration: float, friction: float = 1.0) -> Wheeled:
    """Drive a ground `vehicle` along `waypoints` (its start first) on wheels, for `duration` seconds at most.

    Raises InputError if the model's [dynamics] lack the wheels, UnavailableError where PyBullet is absent.
    """
    model, half = vehicle.model, number(vehicle.model, "separation", least=1e-3) / 2
    multiplier, fastest = number(model, "multiplier", least=1.0), number(model, "wheel_speed", least=1e-3)
    limits, tracks = vehicle_limits([vehicle]), empty_tracks(1)
    start, onward = waypoints[0], [replace(w, time=0.0) for w in waypoints[1:]]  # a route's times are arrivals
    heading = next(np.arctan2(w.y - start.y, w.x - start.x) for w in onward if (w.x, w.y) != (start.x, start.y))
    table = command_track(tracks, np.zeros(0, WAYPOINT), 0, np.array([start.x, start.y, 0.0]), onward, vehicle.speed)
    speed, turn, integral = np.zeros(1), np.zeros(1), 0.0
    rows = []
    with open_world(STEP) as world:
        body, radius = _build(world.bullet, world.client, vehicle, (start.x, start.y, heading), friction)
        b, client = world.bullet, world.client
        for count in range(round(duration / STEP)):
            (x, y, _), quaternion = b.getBasePositionAndOrientation(body, client)
            (vx, vy, _), (_, _, rate) = b.getBaseVelocity(body, client)
            psi = b.getEulerFromQuaternion(quaternion)[2]
            if count % GUIDE == 0:
                ahead = np.array([vx * np.cos(psi) + vy * np.sin(psi)])
                pose = np.array([[x, y, psi]])
                guide_rovers(count * STEP, GUIDE * STEP, pose, ahead, limits, tracks, table, speed, turn)
                rows.append((count * STEP, x, y, psi, tracks[0]["cross"], tracks[0]["turning"], turn[0], rate))
                if tracks[0]["mode"] == IDLE and abs(ahead[0]) < 0.01:
                    break
            integral = np.clip(integral + 4.0 * (turn[0] - rate) * STEP, -1.0, 1.0) if speed[0] or turn[0] else 0.0
            side = np.clip((turn[0] + integral) * half * multiplier, -fastest, fastest)
            mean = np.clip(speed[0], abs(side) - fastest, fastest - abs(side))
            rims = [(mean - side) / radius, (mean + side) / radius] * 2
            b.setJointMotorControlArray(body, [0, 1, 2, 3], b.VELOCITY_CONTROL, targetVelocities=rims, forces=[50.0] * 4,
                                        physicsClientId=client)  # fmt: skip
            b.stepSimulation(client)
    data = np.array(rows)
    return Wheeled(data[:, 0], data[:, 1:4], data[:, 4], data[:, 5] > 0, data[:, 6:8], bool(tracks[0]["mode"] == IDLE))


def _build(b: Any, client: int, vehicle: Vehicle, pose: tuple[float, float, float], friction: float) -> tuple[int, float]:
    """Put the rover on a plane; return its body and the wheels' radius. Joints 0 to 3 are front left, front right, rear
    left, rear right.
    """
    model = vehicle.model
    half = number(model, "separation", least=1e-3) / 2
    base, radius, width, mass = numbers(model, "wheels", 4, least=1e-3)
    b.setGravity(0, 0, -GRAVITY, physicsClientId=client)
    b.setPhysicsEngineParameter(fixedTimeStep=STEP, numSubSteps=0, numSolverIterations=50, physicsClientId=client)
    ground = b.createMultiBody(0, b.createCollisionShape(b.GEOM_PLANE, physicsClientId=client), physicsClientId=client)
    b.changeDynamics(ground, -1, lateralFriction=1.0, physicsClientId=client)
    chassis = b.createCollisionShape(
        b.GEOM_BOX, halfExtents=[model.length / 2, half - width, radius / 2], physicsClientId=client
    )
    across = b.getQuaternionFromEuler([np.pi / 2, 0, 0])
    wheel = b.createCollisionShape(
        b.GEOM_CYLINDER, radius=radius, height=width, collisionFrameOrientation=across, physicsClientId=client
    )
    x, y, heading = pose
    body = b.createMultiBody(
        number(model, "mass", least=1e-3) - 4 * mass,
        chassis,
        -1,
        [x, y, radius],
        b.getQuaternionFromEuler([0, 0, heading]),
        linkMasses=[mass] * 4,
        linkCollisionShapeIndices=[wheel] * 4,
        linkVisualShapeIndices=[-1] * 4,
        linkPositions=[[fore * base / 2, left * half, 0] for fore in (1, -1) for left in (1, -1)],
        linkOrientations=[[0, 0, 0, 1]] * 4,
        linkInertialFramePositions=[[0, 0, 0]] * 4,
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * 4,
        linkParentIndices=[0] * 4,
        linkJointTypes=[b.JOINT_REVOLUTE] * 4,
        linkJointAxis=[[0, 1, 0]] * 4,
        physicsClientId=client,
    )
    for link in range(-1, 4):
        b.changeDynamics(body, link, linearDamping=0, angularDamping=0, physicsClientId=client)
    for link in range(4):
        b.changeDynamics(
            body, link, lateralFriction=friction, anisotropicFriction=list(GRIP), jointDamping=0, physicsClientId=client
        )
        b.setCollisionFilterPair(body, body, -1, link, 0, physicsClientId=client)
    return body, radius
