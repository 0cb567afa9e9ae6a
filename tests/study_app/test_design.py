"""The pure design: sessions hold every cell evenly, choices fill pairs and sides evenly."""

from __future__ import annotations

from collections import Counter
from random import Random

from hypothesis import given
from hypothesis import strategies as st

from study_app import design
from study_app.balance import PAPER, certificate
from study_app.design import Extras, PairLoad, Person

session_shapes = st.tuples(
    st.integers(1, 14),
    st.integers(1, 6),
    st.integers(0, 4),
    st.integers(0, 3),
    st.integers(0, 3),
    st.integers(0, 2**32),
)


def plan(shape: tuple[int, ...]) -> list[design.PlannedTrial]:
    cells, per_cell, catch, identical, practice, seed = shape
    return design.plan_session(cells, per_cell, Extras(catch, identical, 0, practice), Random(seed))


@given(session_shapes)
def test_every_block_holds_every_cell_once(shape: tuple[int, ...]) -> None:
    cells, per_cell = shape[:2]
    seats = Counter((t.block, t.cell) for t in plan(shape) if t.kind == "main")
    assert seats == {(b, c): 1 for b in range(1, per_cell + 1) for c in range(cells)}


@given(session_shapes)
def test_ordinals_run_from_one_and_practice_comes_first(shape: tuple[int, ...]) -> None:
    trials = plan(shape)
    assert [t.ordinal for t in trials] == list(range(1, len(trials) + 1))
    kinds = [t.kind for t in trials]
    assert kinds[: shape[4]] == ["practice"] * shape[4]
    assert Counter(kinds)["catch"] == shape[2] and Counter(kinds)["identical"] == shape[3]


@given(st.integers(0, 2**32), st.integers(1, 5))
def test_a_repeat_comes_at_least_fifteen_trials_after_its_source(seed: int, repeats: int) -> None:
    trials = design.plan_session(12, 5, Extras(3, 2, repeats, 2), Random(seed))
    found = [t for t in trials if t.kind == "repeat"]
    assert len(found) == repeats == len({t.repeat_of for t in found})
    for trial in found:
        source = trials[(trial.repeat_of or 0) - 1]
        assert source.kind == "main" and trial.ordinal - source.ordinal >= 15


def test_catch_trials_are_spread_over_the_session() -> None:
    trials = design.plan_session(12, 5, Extras(catch=4), Random(1))
    places = [t.ordinal for t in trials if t.kind == "catch"]
    assert all(15 * i < place <= 15 * i + 20 for i, place in enumerate(places))


loads = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=12)


@given(loads, st.integers(-3, 3), st.integers(0, 2**32))
def test_the_least_filled_pair_is_chosen_on_the_side_that_it_lacks(
    counts: list[tuple[int, int]], lean: int, seed: int
) -> None:
    pairs = [PairLoad(i, f"s|{i}", a, b) for i, (a, b) in enumerate(counts)]
    choice = design.choose_balanced(pairs, Person(lean=lean), Random(seed))
    chosen = pairs[choice.pair]
    assert chosen.views == min(pair.views for pair in pairs)
    if chosen.target_first != chosen.target_second:
        assert choice.target_first == (chosen.target_first < chosen.target_second)
    elif lean:
        assert choice.target_first == (lean < 0)


@given(st.integers(0, 2**32))
def test_among_equally_filled_pairs_the_person_gets_the_side_that_the_person_lacks(
    seed: int,
) -> None:
    pairs = [PairLoad(0, "s|0", 1, 0), PairLoad(1, "s|1", 0, 1)]
    choice = design.choose_balanced(pairs, Person(lean=2), Random(seed))
    assert choice == design.Binding(0, False)


def test_pairs_of_a_known_stimulus_are_left_out_unless_the_study_allows_them() -> None:
    pairs = [PairLoad(0, "s|0", 0, 0), PairLoad(1, "s|1", 5, 5)]
    person = Person(stimuli={"s|0": 1})
    assert [p.pair for p in design.allowed(pairs, person, False)] == [1]
    assert [p.pair for p in design.allowed(pairs, person, True)] == [0, 1]


def test_all_method_pairs_of_four_methods_are_six() -> None:
    assert len(design.method_pairs("a", ["b", "c", "d"], "all")) == 6
    assert design.method_pairs("a", ["b", "c"], "target") == [("a", "b"), ("a", "c")]


def test_the_paper_design_with_42_people_meets_its_balance_requirements() -> None:
    for seed in range(3):
        result = certificate(PAPER, 42, 0.0, seed)
        assert result["views_per_pair"] == {"min": 2, "max": 3}
        assert result["side_difference_max"] <= 1
        assert result["first_per_person"]["min"] >= 28 and result["first_per_person"]["max"] <= 32
        by_pair = result["first_per_person_pair"]
        assert by_pair["min"] >= 8 and by_pair["max"] <= 12
        assert result["random"]["unseen_pairs"] > 100


def test_a_fifth_of_the_people_leaving_hardly_unbalances_the_paper_design() -> None:
    for seed in range(3):
        result = certificate(PAPER, 42, 0.2, seed)
        spread = result["views_per_pair"]["max"] - result["views_per_pair"]["min"]
        assert spread <= 2 and result["unseen_pairs"] <= 1
