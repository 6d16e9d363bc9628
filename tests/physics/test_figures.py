"""Vehicle files that are wrong: each is one line that names the file's model, the key and what to do."""

from importlib.resources import files

import pytest

from quarterdeck.geo.errors import InputError
from quarterdeck.geo.models import load_model, model_names
from quarterdeck.physics.multirotor import multirotor_parameters
from quarterdeck.physics.rover import rover_parameters
from quarterdeck.physics.vessel import vessel_parameters

READERS = {"surface": vessel_parameters, "ground": rover_parameters, "aerial": multirotor_parameters}


def changed(tmp_path, name, old, new):
    """The packaged model's file with one line changed."""
    text = (files("quarterdeck") / "data" / "vehicles" / f"{name}.toml").read_text(encoding="utf-8")
    assert text.count(old) == 1
    path = tmp_path / f"{name}.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", model_names())
def test_packaged_models_are_whole(name):
    """Each can be simulated, names its source (with its licence, unless it is ours) and goes no faster than it can."""
    model = load_model(name)
    READERS[model.domain](model)
    assert "licence" in model.source or "Quarterdeck's own" in model.source
    assert model.speed <= model.max_speed
    assert model.turn_radius == 0 or model.turn_radius >= model.speed / model.turn_rate


@pytest.mark.parametrize(
    ("name", "old", "new", "text"),
    [
        ("otter", "mass = 80.0", "weight = 80.0", r"\[dynamics\] lacks 'mass'"),
        ("otter", "mass = 80.0", "mass = 'heavy'", r"\[dynamics\] mass must be a number, not 'heavy'"),
        ("otter", "lever = 0.395", "lever = -1.0", r"\[dynamics\] lever = -1.0 is below"),
        ("otter", "linear = [77.55, 162.5, 42.64]", "linear = [77.55]", "must be a list of 3 numbers"),
        ("otter", "thrust = [119.7, -66.7]", "thrust = [-1.0, 2.0]", "ahead > 0"),
        ("otter", "thrust = [119.7, -66.7]", "thrust = [10.0, -6.7]", "needs more thrust"),
        ("otter", "xg = 0.153125", "xg = 9.0", "singular"),
        ("husky", "wheel_speed = 1.0", "wheel_speed = 0.5", "wheel_speed is below"),
        ("survey-quad", "thrust = 7.07", "thrust = 2.0", "times the weight"),
    ],
)
def test_wrong_dynamics_are_named(tmp_path, name, old, new, text):
    """Told when the vehicle is made ready."""
    model = load_model(changed(tmp_path, name, old, new))
    with pytest.raises(InputError, match=text) as error:
        READERS[model.domain](model)
    assert "\n" not in str(error.value)
    assert repr(name) in str(error.value)


def test_misspelt_limit_is_refused(tmp_path):
    """Not silently ignored."""
    with pytest.raises(InputError, match="did you mean 'turn_radius'"):
        load_model(changed(tmp_path, "otter", "turn_radius = 6.0", "turning_radius = 6.0"))
