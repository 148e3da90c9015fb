"""The sample that the suite runs by default."""

import pytest

from tests.helpers.thorough import cases, left_out, option

pytest_plugins = ["pytester"]
PRODUCT = """
import pytest

@pytest.mark.sampled
@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("letter", "abc")
@pytest.mark.parametrize(("one", "other"), [(1, 2), (1, 3)])
def test_product(number, letter, one, other): ...

@pytest.fixture(params=[(a, b) for a in range(4) for b in range(3)])
def both(request): ...

@pytest.mark.sampled
def test_one(both): ...

@pytest.mark.sampled
def test_other(both): ...

@pytest.mark.parametrize("number", range(5))
def test_all(number): ...
"""


def test_a_sample_has_each_value_of_each_parameter_and_is_the_same_each_time(pytester):
    items = pytester.getitems(PRODUCT)
    out = left_out(items)
    kept = [item.callspec.params for item in items if item not in out and "product" in item.name]
    assert 5 <= len(kept) <= 7
    for name, values in {"number": set(range(5)), "letter": set("abc"), "one": {1}, "other": {2, 3}}.items():
        assert {params[name] for params in kept} == values
    assert not [item for item in out if "test_all" in item.name]
    assert left_out(items) == out


def test_elements_of_tuples_are_sampled_alike_in_all_tests_of_a_file(pytester):
    items = pytester.getitems(PRODUCT)
    out = left_out(items)
    one, other = (
        [item.callspec.params["both"] for item in items if item not in out and item.originalname == name]
        for name in ("test_one", "test_other")
    )
    assert one == other
    assert [{pair[i] for pair in one} for i in (0, 1)] == [set(range(4)), set(range(3))]
    assert len(one) == 4


def test_one_case_that_is_asked_for_is_not_left_out(pytester):
    assert left_out(pytester.getitems(PRODUCT)[7:8]) == []


@pytest.mark.parametrize(("thorough", "number"), [(False, 3), (True, 500)])
def test_the_number_of_random_cases_follows_from_the_option(monkeypatch, thorough, number):
    monkeypatch.setitem(option, "thorough", thorough)
    assert cases(3, 500) == number
