"""`core.schema.read`: valid nodes, and error messages for invalid ones."""

from dataclasses import dataclass

import pytest
from omegaconf import OmegaConf

from core.errors import ConfigError, did_you_mean
from core.schema import Checked, one_of, read, within


@dataclass(frozen=True)
class Wheel(Checked):
    radius: float = within(0.1, 2)
    place: list[float] = within(-1, 1, count=2)


@dataclass(frozen=True)
class Cart(Checked):
    name: str
    load: float = within(0, 1e6)
    horses: int = within(0, 4)
    paint: str = one_of("red", "green")
    stops: list[str] = one_of("mill", "market")
    prices: dict[str, float] = within(0, 10)
    covered: bool
    wheels: dict[str, Wheel]
    spare: Wheel


WHEEL = {"radius": 0.5, "place": [0, 0.5]}
GOOD = {
    "name": "old",
    "load": 100,
    "horses": 2,
    "paint": "red",
    "stops": ["mill", "market"],
    "prices": {"ride": 1.5},
    "covered": True,
    "wheels": {"front": WHEEL, "back": WHEEL},
    "spare": WHEEL,
}


def changed(path, value):
    """GOOD with the value at a dotted path replaced, as a config node."""
    node = OmegaConf.create(GOOD)
    OmegaConf.update(node, path, value, merge=False, force_add=True)
    return node


@pytest.mark.parametrize("wrap", [dict, OmegaConf.create])
def test_a_valid_node_becomes_its_dataclass(wrap):
    cart = read(Cart, wrap(GOOD), "cart")
    wheel = Wheel(0.5, [0.0, 0.5])
    assert cart == Cart(
        "old", 100.0, 2, "red", ["mill", "market"], {"ride": 1.5}, True, {"front": wheel, "back": wheel}, wheel
    )
    assert isinstance(cart.load, float)
    assert type(cart.stops) is list


@pytest.mark.parametrize(
    ("path", "value", "converted"),
    [("load", "2.5", 2.5), ("name", 5, "5"), ("covered", "yes", True), ("horses", "3", 3)],
)
def test_values_of_another_type_are_converted_as_omegaconf_does(path, value, converted):
    read_value = getattr(read(Cart, {**GOOD, path: value}, "cart"), path)
    assert (read_value, type(read_value)) == (converted, type(converted))


def test_reading_does_not_change_the_node_or_share_its_values():
    node = {**GOOD, "spare": dict(WHEEL)}
    cart = read(Cart, node, "cart")
    cart.stops.append("mill")
    cart.prices["ride"] = 2.5
    assert node == GOOD
    assert GOOD["prices"] == {"ride": 1.5}


def test_interpolations_are_resolved():
    config = OmegaConf.create({"cart": {**GOOD, "load": "${.horses}"}})
    assert read(Cart, config.cart, "cart").load == 2.0


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("load", -1, r"^cart\.load=-1(\.0)? is out of range: it must be in \[0, 1e\+06\]$"),
        ("load", float("nan"), r"^cart\.load=nan is not a finite number$"),
        ("load", float("inf"), r"^cart\.load=inf is not a finite number$"),
        ("load", "heavy", r"^cart\.load=heavy: .*Float"),
        ("load", None, r"^cart\.load=None"),
        ("load", True, r"^cart\.load=True: .*Float"),
        ("load", [1], r"^cart\.load=\[1\]"),
        ("horses", 5, r"^cart\.horses=5 is out of range: it must be in \[0, 4\]$"),
        ("horses", 1.5, r"^cart\.horses=1\.5: .*[Ii]nteger"),
        ("horses", "two", r"^cart\.horses=two: .*[Ii]nteger"),
        ("covered", "perhaps", r"^cart\.covered=perhaps: .*bool"),
        ("paint", "gren", r"^cart\.paint=gren is not known; did you mean 'green'\?$"),
        ("paint", "xyz", r"^cart\.paint=xyz is not known; choose from red, green$"),
        ("stops", ["mill", "marked"], r"^cart\.stops=marked is not known; did you mean 'market'\?$"),
        ("stops", "mill", r"^cart\.stops=mill must be a list: cart\.stops=\[mill\]$"),
        ("prices", {"ride": 11}, r"^cart\.prices\.ride=11(\.0)? is out of range: it must be in \[0, 10\]$"),
        ("prices", {"ride": float("nan")}, r"^cart\.prices\.ride=nan is not a finite number$"),
        ("prices", {"ride": "dear"}, r"^cart\.prices\.ride=.*dear.*Float"),
        ("name", None, r"^cart\.name=None"),
        ("horse", 1, r"^cart\.horse is not a known key; did you mean 'horses'\?$"),
        ("zzz", 1, r"^cart\.zzz is not a known key; choose from name, load, "),
        ("name", "???", r"^cart\.name has no value; give cart\.name=\.\.\.$"),
        ("spare.radius", 3, r"^cart\.spare\.radius=3(\.0)? is out of range: it must be in \[0\.1, 2\]$"),
        ("spare.radios", 3, r"^cart\.spare\.radios is not a known key; did you mean 'radius'\?$"),
        ("spare", 3, r"^cart\.spare=3 must be a group of keys: radius, place$"),
        ("wheels.back.radius", 0, r"^cart\.wheels\.back\.radius=0(\.0)? is out of range"),
        ("wheels.back.place", [0, 2], r"^cart\.wheels\.back\.place=2(\.0)? is out of range"),
        ("wheels.back.place", [0], r"^cart\.wheels\.back\.place=\[0(\.0)?\] must be 2 numbers$"),
        ("wheels.back", 1, r"^cart\.wheels\.back=1 must be a group of keys"),
        ("wheels", 4, r"^cart\.wheels=4 must be a group of named entries$"),
    ],
)
def test_errors_name_the_full_key_the_value_and_what_would_be_right(path, value, message):
    with pytest.raises(ConfigError, match=message) as caught:
        read(Cart, changed(path, value), "cart")
    assert "\n" not in str(caught.value)
    assert caught.value.__cause__ is None


@pytest.mark.parametrize("path", ["name", "load", "wheels", "spare.radius"])
def test_missing_keys_are_reported(path):
    node = OmegaConf.create(GOOD)
    holder, _, key = path.rpartition(".")
    del (OmegaConf.select(node, holder) if holder else node)[key]
    with pytest.raises(ConfigError, match=f"^cart.{path} has no value; give cart.{path}=..."):
        read(Cart, node, "cart")


def test_a_node_that_is_not_a_group_is_refused():
    with pytest.raises(ConfigError, match=r"^cart=7 must be a group of keys: name, load"):
        read(Cart, 7, "cart")


def test_keys_at_the_top_level_have_no_prefix():
    with pytest.raises(ConfigError, match=r"^horses=9 is out of range"):
        read(Cart, changed("horses", 9), "")


def test_a_config_is_immutable():
    with pytest.raises(AttributeError):
        read(Cart, GOOD, "cart").load = 3


def test_did_you_mean_suggests_only_similar_words():
    assert did_you_mean("kuka1", ["kuka", "panda"]) == "; did you mean 'kuka'?"
    assert did_you_mean("ur5", ["kuka", "panda"]) == "; choose from kuka, panda"
