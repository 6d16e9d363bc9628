"""Ground that is not flat: the grid, how rovers stand on it, and what it costs them."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import box

from quarterdeck.cli import main
from quarterdeck.geo.errors import InputError
from quarterdeck.geo.scenario import Obstacle
from quarterdeck.geo.terrain import Terrain
from quarterdeck.mission.planfile import plan_text
from quarterdeck.physics.rover import GRAVITY, climb_parameters
from quarterdeck.physics.simulate import simulate
from quarterdeck.physics.world import open_world

pytest.importorskip("pybullet", reason="PyBullet has wheels for Linux and CPython 3.11 only")


def ramp(degrees, cell=2.0):
    """Ground that rises to the east from x = 20 to x = 60, flat before and after."""
    x = np.arange(-40.0, 160.0, cell)
    rise = np.tan(np.radians(degrees)) * np.clip(x - 20.0, 0.0, 40.0)
    return Terrain((-40.0, -40.0), cell, np.tile(rise, (60, 1)))


def test_heights_are_those_that_pybullet_sees():
    """At random places of a random grid PyBullet's rays meet its heightfield where `height` says, within a micrometre."""
    terrain = Terrain((-3.0, 5.0), 2.0, np.random.default_rng(0).uniform(-4.0, 9.0, (5, 8)))
    places = np.random.default_rng(1).uniform([-2.9, 5.1], [10.9, 12.9], (200, 2))
    with open_world(0.1) as world:
        world.add_terrain(terrain)
        rays = [[[x, y, z] for x, y in places.tolist()] for z in (50.0, -50.0)]
        hits = world.bullet.rayTestBatch(*rays, physicsClientId=world.client)
    assert np.abs(np.array([hit[3][2] for hit in hits]) - terrain.height(places)).max() < 1e-6
    assert np.isnan(terrain.height(np.array([[-3.1, 6.0], [0.0, 13.1]]))).all()


@pytest.mark.parametrize("model", ["husky", "jackal"])
def test_flat_terrain_changes_nothing(sail, model):
    """On a plateau at 100 m a rover does to the bit what it does without terrain, 100 m higher."""
    mission = sail(model, [(0.0, 0.0), (30.0, 0.0), (30.0, 10.0)])
    plateau = Terrain((-40.0, -40.0), 5.0, np.full((40, 40), 100.0))
    flat, high = simulate(mission).trace, simulate(mission, terrain=plateau).trace
    for name in ("x", "y", "heading", "energy", "contact"):
        assert np.array_equal(getattr(flat, name), getattr(high, name)), name
    assert (flat.ground == 0).all()
    assert (high.ground == 100.0).all()


def test_rover_follows_the_ramp_slower_and_at_its_price(sail):
    """Up 12 degrees: height and pitch of the ground, untouched, power and energy by m g h / efficiency within 2 %."""
    mission = sail("husky", [(0.0, 0.0), (80.0, 0.0)])
    flat, up = simulate(mission), simulate(mission, terrain=ramp(12.0))
    assert up.report.passed, up.report.reasons
    trace, model = up.trace, mission.vehicles[0].model
    middle = (trace.x[:, 0] > 22.0) & (trace.x[:, 0] < 58.0)
    wanted = np.tan(np.radians(12.0)) * (trace.x[middle, 0] - 20.0)
    assert np.abs(trace.ground[middle, 0] - wanted).max() < 1e-9
    assert np.degrees(trace.pitch[middle, 0]) == pytest.approx(12.0, abs=1e-3)
    assert not trace.contact.any()
    climb, slope = climb_parameters(model), np.radians(12.0)
    weight = climb["mass"] * GRAVITY / climb["efficiency"]
    drive = model.power_cruise - model.power_idle
    full = drive * model.dynamics["wheel_speed"] / model.speed
    speed = full / (drive / model.speed + weight * np.sin(slope))
    assert speed < model.speed
    assert trace.speed[middle, 0].mean() == pytest.approx(speed * np.cos(slope), rel=0.02)
    longer = up.report.vehicles[0].time - flat.report.vehicles[0].time
    farther = 40.0 / np.cos(slope) - 40.0
    height = 40.0 * np.tan(slope)
    more = (weight * height + model.power_idle * longer + drive / model.speed * farther) / 3600
    assert up.report.vehicles[0].energy - flat.report.vehicles[0].energy == pytest.approx(more, rel=0.02)


def test_going_down_takes_less_but_never_gives_back(sail):
    """Down 12 degrees costs less than flat ground, and the energy used never falls."""
    mission = sail("husky", [(80.0, 0.0), (0.0, 0.0)])
    flat, down = (simulate(mission, terrain=ramp(degrees)).trace.energy[:, 0] for degrees in (0.0, 12.0))
    assert down[-1] < flat[-1]
    assert np.diff(down).min() >= 0.0


def test_too_steep_is_a_failure_that_is_told(sail):
    """At 35 degrees the Husky is given up at the foot of the ramp, and the verdict says why."""
    run = simulate(sail("husky", [(0.0, 0.0), (80.0, 0.0)]), terrain=ramp(35.0))
    assert not run.report.passed
    assert run.report.vehicles[0].aground
    assert "v1: given up at" in run.report.reasons[0]
    assert "it climbs 30" in run.report.reasons[0]
    assert 18.0 < run.trace.x[-1, 0] < 22.0


def test_hull_meets_a_ridge_between_the_wheels(sail):
    """A ridge 0.3 m high is met by the Husky's hull, 0.13 m above the ground; one of 0.05 m is not."""
    touched = []
    for height in (0.05, 0.3):
        heights = np.zeros((200, 400))
        heights[:, 160] = height  # at x = 20
        run = simulate(sail("husky", [(0.0, 0.0), (40.0, 0.0)]), terrain=Terrain((-20.0, -25.0), 0.25, heights))
        touched.append(run.report.figures["collisions"])
    assert touched == [0, 1]


def test_obstacle_on_a_hill_stops_a_rover(sail):
    """A rock on a plateau at 100 m stands on the ground there and not beneath it: PyBullet stops the rover at its face."""
    mission = sail("husky", [(0.0, 0.0), (30.0, 0.0)])
    rock = Obstacle("rock", box(10.0, -3.0, 12.0, 3.0), height=1.0)
    mission = replace(mission, site=replace(mission.site, obstacles=(rock,)))
    run = simulate(mission, terrain=Terrain((-40.0, -40.0), 5.0, np.full((40, 40), 100.0)))
    assert run.report.vehicles[0].touched
    assert run.trace.x.max() < 10.0
    assert np.abs(run.trace.z).max() == 0.0


def test_command_line_drives_on_a_terrain(mow, tmp_path, capfd):
    """A terrain that is too steep fails with 1; a bad file, or one that does not cover the route, is one line and 2."""
    plan = tmp_path / "plan.geojson"
    plan.write_text(plan_text(mow("husky", spacing=5.0, length=30.0)), encoding="utf-8")
    (tmp_path / "bad.asc").write_text("ncols 3\nnrows 2\ncellsize 2\nxllcorner 0\nyllcorner 0\n1 2 3\n", encoding="ascii")
    steep = ramp(35.0)
    np.savez(tmp_path / "steep.npz", origin=steep.origin, cell=steep.cell, heights=steep.heights)
    np.savez(tmp_path / "small.npz", origin=(0.0, -5.0), cell=1.0, heights=np.zeros((20, 20)))
    for name, status, text in (
        ("steep.npz", 1, "degrees steep, it climbs 30"),
        ("bad.asc", 2, "neither NPZ"),
        ("small.npz", 2, "on the route of 'husky-1'"),
        ("none.asc", 2, "cannot be read"),
    ):
        with pytest.raises(SystemExit) as stop:
            main(["simulate", str(plan), "--terrain", str(tmp_path / name)])
        assert stop.value.code == status
        assert text in capfd.readouterr().err


def test_terrain_that_pybullet_would_spoil_is_cropped_or_refused(sail):
    """Four million nodes: nothing is felt of them on a short route, and one across all of them is refused in a line."""
    wide = Terrain((-500.0, -500.0), 0.5, np.zeros((2000, 2000)))
    assert simulate(sail("husky", [(0.0, 0.0), (10.0, 0.0)]), terrain=wide).report.passed
    with pytest.raises(InputError, match="give larger cells"):
        simulate(sail("husky", [(-499.0, -499.0), (499.0, 499.0)]), terrain=wide)
    part = wide.crop((-1.2, 3.1, 2.0, 4.0))
    assert part is not None
    assert (part.origin, part.heights.shape) == ((-1.5, 3.0), (3, 8))
    assert wide.crop((600.0, 0.0, 700.0, 1.0)) is None


def test_no_grid_is_refused():
    """A single row, or a cell of no size."""
    with pytest.raises(InputError, match="2 x 2"):
        Terrain((0.0, 0.0), 1.0, np.zeros((1, 5)))
    with pytest.raises(InputError, match=r"cell at least 0\.01 m"):
        Terrain((0.0, 0.0), 0.0, np.zeros((5, 5)))
