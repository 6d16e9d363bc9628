"""The PyBullet world of a run: one DIRECT client, solid obstacles, one body a vehicle, stepped by stepSimulation.

The models are integrated beside it; a body is given the velocity that carries it to where its model says, and PyBullet
moves it there, unless something is in the way: then PyBullet has the word, and the model carries on from the body's
state.
"""

import contextlib
import ctypes
import os
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import shapely
from shapely import Polygon

from quarterdeck.geo.errors import InputError, UnavailableError
from quarterdeck.geo.scenario import Obstacle, Vehicle
from quarterdeck.geo.terrain import Terrain

HEIGHT = {"surface": 1.0, "ground": 0.6, "aerial": 0.2}  # m, of a vehicle's body
BIT = {"surface": 2, "ground": 4, "aerial": 8}  # collision groups; obstacles are 1
CHUNK = 40_000  # triangles a mesh: createCollisionShape refuses more than 131 072 vertices
NODES = 2_000_000  # of a heightfield: PyBullet hands over 8 MiB of floats, and spoils what is beyond
GAP = 0.13  # m between the ground and a ground vehicle's body, where there is terrain
INCONSISTENT = 1e-6  # m: a body that is this far from its model has been pushed


class World:
    """A PyBullet client with its bodies. Use `open_world`; every method takes and gives metres, radians and seconds."""

    def __init__(self, bullet: Any, client: int, step: float) -> None:
        self.bullet, self.client, self.step = bullet, client, step
        self.bodies: list[int] = []
        self.obstacles: set[int] = set()
        self.domains: list[str] = []

    def add_terrain(self, terrain: Terrain) -> None:
        """Add the ground as a heightfield; ground vehicles' bodies collide with it.

        Raises InputError if it has more nodes than PyBullet takes.
        """
        if terrain.heights.size > NODES:
            raise InputError(
                f"terrain: {terrain.heights.size} nodes about the ground routes, PyBullet takes {NODES}; give larger cells"
            )
        rows, columns = terrain.heights.shape
        known = np.isfinite(terrain.heights)
        if not known.any():
            return
        low, high = float(terrain.heights[known].min()), float(terrain.heights[known].max())
        shape = self.bullet.createCollisionShape(
            self.bullet.GEOM_HEIGHTFIELD,
            meshScale=[terrain.cell, terrain.cell, 1.0],
            heightfieldData=np.where(known, terrain.heights, low).ravel().tolist(),
            numHeightfieldRows=columns,  # PyBullet's rows run along y: it counts along x first
            numHeightfieldColumns=rows,
            physicsClientId=self.client,
        )
        (x, y), half = terrain.origin, terrain.cell / 2  # a heightfield is centred on its position, in height too
        at = [x + half * (columns - 1), y + half * (rows - 1), (low + high) / 2]
        body = self.bullet.createMultiBody(0, shape, -1, at, physicsClientId=self.client)
        self.bullet.setCollisionFilterGroupMask(body, -1, 1, 1 | BIT["ground"], physicsClientId=self.client)

    def add_obstacles(self, obstacles: Sequence[Obstacle], terrain: Terrain | None = None) -> list[int]:
        """Add solid prisms, on the terrain if there is one; those that block the same domains share meshes, which are
        returned.
        """

        def solid(obstacle: Obstacle) -> np.ndarray:
            low, high = terrain.range(obstacle.polygon.bounds) if terrain is not None else (0.0, 0.0)
            return prism(obstacle.polygon, min(low, 0.0) - 1.0, max(high, 0.0) + obstacle.height)

        made = list[int]()
        for blocks in sorted({o.blocks for o in obstacles if o.blocks}, key=sorted):
            soup = np.concatenate([solid(o) for o in obstacles if o.blocks == blocks])
            mask = sum(BIT[domain] for domain in blocks)
            for first in range(0, len(soup), CHUNK):
                part = soup[first : first + CHUNK].reshape(-1, 3)
                shape = self.bullet.createCollisionShape(
                    self.bullet.GEOM_MESH,
                    vertices=part.tolist(),
                    indices=list(range(len(part))),
                    flags=self.bullet.GEOM_FORCE_CONCAVE_TRIMESH,
                    physicsClientId=self.client,
                )
                body = self.bullet.createMultiBody(0, shape, physicsClientId=self.client)
                self.bullet.setCollisionFilterGroupMask(body, -1, 1, mask, physicsClientId=self.client)
                self.obstacles.add(body)
                made.append(body)
        return made

    def remove_obstacles(self, bodies: Sequence[int]) -> None:
        """Remove what `add_obstacles` has added."""
        for body in bodies:
            self.bullet.removeBody(body, physicsClientId=self.client)
            self.obstacles.discard(body)

    def add_vehicles(self, vehicles: Sequence[Vehicle], position: np.ndarray, heading: np.ndarray) -> None:
        """Add a body for each vehicle at `position` (k, 3) and `heading` (k,); it collides with obstacles alone at
        first.
        """
        for vehicle, at, psi in zip(vehicles, position, heading, strict=True):
            model, height = vehicle.model, HEIGHT[vehicle.domain]
            shape = self.bullet.createCollisionShape(
                self.bullet.GEOM_BOX,
                halfExtents=[model.length / 2, model.width / 2, height / 2],
                physicsClientId=self.client,
            )
            mass = float(model.dynamics.get("mass", 1.0))
            body = self.bullet.createMultiBody(
                mass, shape, -1, at.tolist(), [0, 0, np.sin(psi / 2), np.cos(psi / 2)], physicsClientId=self.client
            )
            self.bullet.changeDynamics(
                body, -1, linearDamping=0, angularDamping=0, lateralFriction=0.3, restitution=0, physicsClientId=self.client
            )
            self.bodies.append(body)
            self.domains.append(vehicle.domain)
            self.set_underway(len(self.bodies) - 1, False)

    def set_underway(self, index: int, underway: bool) -> None:
        """Say whether a vehicle collides with other vehicles, as it does not while it is launched or recovered."""
        bit = BIT[self.domains[index]]
        mask = 1 | (sum(BIT.values()) if underway else 0)
        self.bullet.setCollisionFilterGroupMask(self.bodies[index], -1, bit, mask, physicsClientId=self.client)

    def advance(self, velocity: np.ndarray, rate: np.ndarray) -> dict[int, frozenset[int]]:
        """Step once with `velocity` (k, 3) and yaw `rate` (k,); return what each vehicle in contact touches.

        The keys and the members are vehicle indices; -1 is an obstacle.
        """
        reset, client = self.bullet.resetBaseVelocity, self.client
        for body, v, r in zip(self.bodies, velocity.tolist(), rate.tolist(), strict=True):
            reset(body, v, (0.0, 0.0, r), client)
        self.bullet.stepSimulation(client)
        points = self.bullet.getContactPoints(physicsClientId=client)
        if not points:
            return {}
        index = {body: i for i, body in enumerate(self.bodies)}
        touched: dict[int, set[int]] = {}
        for point in points:
            if point[8] <= 0.0:  # the distance: PyBullet also tells of near misses
                a, b = index.get(point[1], -1), index.get(point[2], -1)
                for one, other in ((a, b), (b, a)):
                    if one >= 0:
                        touched.setdefault(one, set()).add(other)
        return {i: frozenset(others) for i, others in sorted(touched.items())}

    def state(self, index: int) -> tuple[np.ndarray, float, np.ndarray, float]:
        """Return a body's position (3,), heading, velocity (3,) and rate of turn."""
        position, quaternion = self.bullet.getBasePositionAndOrientation(self.bodies[index], self.client)
        velocity, rates = self.bullet.getBaseVelocity(self.bodies[index], self.client)
        x, y, z, w = quaternion
        return (
            np.array(position),
            float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))),
            np.array(velocity),
            rates[2],
        )

    def place(self, index: int, position: np.ndarray, heading: float, pitch: float = 0.0, roll: float = 0.0) -> None:
        """Put a body at a place: upright, or with its nose up by `pitch` and its port side by `roll`, radians."""
        turned = self.bullet.getQuaternionFromEuler([roll, -pitch, heading])
        self.bullet.resetBasePositionAndOrientation(self.bodies[index], position.tolist(), turned, self.client)


@contextlib.contextmanager
def open_world(step: float) -> Iterator[World]:
    """Open an empty world that moves in steps of `step` seconds. Raises UnavailableError where PyBullet is absent."""
    with _quiet():
        try:
            import pybullet
        except ImportError:
            raise UnavailableError(
                "simulating needs PyBullet, which has wheels for Linux and Python 3.11 only; "
                "elsewhere: pip install 'quarterdeck[physics]' with a C++ compiler"
            ) from None
        client = pybullet.connect(pybullet.DIRECT)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=step,
            numSubSteps=0,
            numSolverIterations=20,
            collisionFilterMode=0,
            physicsClientId=client,
        )  # collisionFilterMode 0: both masks must agree; by default one is enough
        pybullet.setGravity(0, 0, 0, physicsClientId=client)  # weight and lift are the models' business
    try:
        yield World(pybullet, client, step)
    finally:
        pybullet.disconnect(client)


def prism(polygon: Polygon, bottom: float, top: float) -> np.ndarray:
    """Return the (n, 3, 3) triangles of the closed surface of an upright prism: n triangles, 3 corners, x y z."""
    caps = np.array([t.exterior.coords[:3] for t in shapely.constrained_delaunay_triangles(polygon).geoms]).reshape(
        -1, 3, 2
    )
    parts = [np.dstack([caps, np.full(caps.shape[:2], z)]) for z in (bottom, top)]
    for ring in (polygon.exterior, *polygon.interiors):
        a = np.asarray(ring.coords)[:-1, :2]
        b = np.roll(a, -1, axis=0)
        low, high = np.full((len(a), 1), bottom), np.full((len(a), 1), top)
        al, ah, bl, bh = (np.hstack(pair) for pair in ((a, low), (a, high), (b, low), (b, high)))
        parts += [np.stack([al, bl, bh], axis=1), np.stack([al, bh, ah], axis=1)]
    return np.concatenate(parts)


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keep what PyBullet prints from C while it loads out of our standard output and error."""
    libc = ctypes.CDLL(None)
    saved, nowhere = (os.dup(1), os.dup(2)), os.open(os.devnull, os.O_WRONLY)
    libc.fflush(None)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        libc.fflush(None)  # before the descriptors are put back, or it is printed after all
        for descriptor, copy in zip((1, 2), saved, strict=True):
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(nowhere)
