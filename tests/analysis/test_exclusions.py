from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.codebook import read_codebook
from analysis.estimate import estimate
from analysis.exclusions import apply_rules, group_medians, longest_runs, select_mode
from analysis.responses import read_responses
from analysis.rules import RULES, parse_rules, rules_sha256
from renderer.files import InputError


@pytest.fixture
def mixed_study(tmp_path: Path, make_answers: Callable, make_row: Callable) -> Path:
    """Six participants of 10 main trials; each of the first five breaks exactly one rule."""
    rows = []
    for person in range(6):
        who = {"participant": f"P{person}"}
        for trial in range(1, 11):
            if person == 4 and trial > 4:
                break
            won = trial % 3 > 0
            rows.append(make_row(
                **who, trial_index=trial, motion=f"m{trial % 5}", won=won,
                target_first=won if person == 2 else trial % 2 == 0,
                response_time_ms=900 if person == 1 else 8000,
                late="true" if person == 5 and trial == 7 else "false",
            ))  # fmt: skip
        for trial in (21, 22):
            rows.append(make_row(
                **who, trial_index=trial, trial_kind="catch", expected_method="PACE", won=person != 0
            ))  # fmt: skip
        repeat = person == 3
        rows.append(
            make_row(
                **who, trial_index=30, trial_kind="repeat", repeat_of=1, motion="m1", won=not repeat
            )
        )
    return make_answers(tmp_path / "r.csv", rows)


RULES_IN_FORCE = {
    "max_catch_failures": 1.0, "min_median_response_s": 2.0, "max_same_side_share": 0.95,
    "min_repeat_agreement": 0.5, "min_answered_share": 0.5, "drop_late": 1.0,
}  # fmt: skip


def test_each_rule_removes_the_one_who_breaks_it_and_no_answer_is_lost(mixed_study: Path) -> None:
    kept, flow = apply_rules(read_responses(mixed_study), RULES_IN_FORCE)
    assert flow.excluded_participants == {
        "max_catch_failures": 1, "min_median_response_s": 1, "max_same_side_share": 1,
        "min_answered_share": 1, "min_repeat_agreement": 1,
    }  # fmt: skip
    assert flow.excluded_answers == {
        "max_catch_failures": 10, "min_median_response_s": 10, "max_same_side_share": 10,
        "min_answered_share": 4, "min_repeat_agreement": 10, "drop_late": 1,
    }  # fmt: skip
    assert (flow.rows, flow.other_kind, flow.analysed) == (72, {"catch": 12, "repeat": 6}, 9)
    assert (flow.participants, flow.analysed_participants, len(kept)) == (6, 1, 9)


def test_a_long_run_on_one_side_is_found(mixed_study: Path) -> None:
    main = read_responses(mixed_study)
    main = main.take(main.equals("trial_kind", "main"))
    assert longest_runs(main)[2] == 10
    assert longest_runs(main).max() == 10 and longest_runs(main)[5] < 6


def test_unmeasured_times_and_unknown_viewing_exclude_nobody(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [
        make_row(trial_index=i, response_time_ms="unknown", viewed_first="unknown", late="unknown",
                 motion=f"m{i}", won=i % 2 == 0)
        for i in range(1, 9)
    ]  # fmt: skip
    rules = {"min_median_response_s": 5.0, "drop_unviewed": 1.0, "drop_late": 1.0}
    _, flow = apply_rules(read_responses(make_answers(tmp_path / "r.csv", rows)), rules)
    assert flow.analysed == 8


def test_modes_never_mix(tmp_path: Path, make_answers: Callable, make_row: Callable) -> None:
    rows = [
        make_row(participant=mode, mode=mode, trial_index=i)
        for mode in ("live", "preview") for i in (1, 2, 3)
    ]  # fmt: skip
    path = make_answers(tmp_path / "r.csv", rows)
    kept, mode, rest = select_mode(read_responses(path), None)
    assert (len(kept), mode, rest) == (3, "live", {"preview": 3})
    results = estimate(path, mode="preview", bootstraps=100)
    assert results["flow"]["other_mode"] == {"live": 3} and results["flow"]["rows"] == 6
    assert results["watermark"] == "PREVIEW · NOT FROZEN"
    with pytest.raises(InputError, match="mode: got 'pilot', wanted one of live, preview"):
        select_mode(read_responses(path), "pilot")


@given(st.lists(st.tuples(st.integers(0, 4), st.floats(-1e6, 1e6)), min_size=1, max_size=60))
def test_group_medians_equal_numpy(pairs: list[tuple[int, float]]) -> None:
    groups, values = (np.array(column) for column in zip(*pairs, strict=True))
    found = group_medians(groups, values, 5)
    for group in range(5):
        mine = values[groups == group]
        expected = np.median(mine) if len(mine) else np.nan
        np.testing.assert_allclose(found[group], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("declared", "message"),
    [
        (
            {"max_disagreement_with_majority": 0.3},
            "no exclusion by agreement with other participants",
        ),
        ({"max_catch_failure": 1}, "one of the rules max_catch_failures"),
        ({"max_same_side_share": 0.2}, "a number from 0.5 to 1"),
        ({"drop_late": "yes"}, "a number from 0 to 1"),
    ],
)
def test_a_wrong_rule_is_refused_in_one_line(declared: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_rules("study.toml", declared)


def test_the_codebook_is_read_and_refused_by_field(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rules = {"max_catch_failures": 1}
    path = make_answers(tmp_path / "r.csv", [make_row()], exclusions=rules)
    book = read_codebook(path)
    assert book.frozen and book.rules_origin == "declared"
    assert book.rules_sha256 == rules_sha256({"max_catch_failures": 1.0})
    make_answers(path, [make_row()], exclusions=rules, exclusions_changed_at="2026-03-02",
                 collection_began_at="2026-03-01", study_state="open")  # fmt: skip
    assert (read_codebook(path).rules_origin, read_codebook(path).frozen) == ("post hoc", False)
    for wrong in ({"schema_version": 9}, {"study_state": "on"}, {"exclusions_sha256": "0"},
                  {"exclusions": [1]}, {"main_trials": 0}):  # fmt: skip
        make_answers(path, [make_row()], **({"exclusions": rules} | wrong))
        with pytest.raises(InputError, match=next(iter(wrong))):
            read_codebook(path)


def test_a_flip_of_sign_or_significance_is_said_loudly(
    tmp_path: Path, make_answers: Callable, make_study: Callable
) -> None:
    rows = make_study({"PAAK": 50}, participants=12)
    for row in rows:
        if row["participant"] < "P06":  # half of the people always choose PACE, and answer late
            row |= {"chosen_method": "PACE", "late": "true"}
            row["chosen_position"] = "first" if row["first_method"] == "PACE" else "second"
    path = make_answers(
        tmp_path / "r.csv", rows, exclusions={"drop_late": 1, "max_same_side_share": 0.99}
    )
    results = estimate(path, bootstraps=200)
    variants = {row["variant"]: row for row in results["sensitivity"]["PAAK"]}
    assert {"no exclusions", "only drop_late", "all but drop_late", "all rules"} <= set(variants)
    assert {f"without scene scene{i}" for i in range(4)} <= set(variants)
    reported = results["baselines"]["PAAK"]["rate"]
    assert (
        variants["all rules"]["rate"] == pytest.approx(reported)
        and not variants["all rules"]["flips"]
    )
    assert (variants["no exclusions"]["rate"] - 0.5) * (reported - 0.5) < 0
    assert variants["no exclusions"]["flips"] == "sign"
    assert any(
        line.startswith("FRAGILE: PAAK, no exclusions: the sign") for line in results["warnings"]
    )


def test_every_rule_is_named_once_with_prose_and_sane_bounds() -> None:
    assert len({rule.name for rule in RULES}) == len(RULES)
    for rule in RULES:
        assert rule.prose.endswith(".") and rule.low <= rule.default <= rule.high
        assert parse_rules("x", {rule.name: rule.default}) == {rule.name: float(rule.default)}


@pytest.mark.parametrize(
    ("changed", "began", "origin"),
    [
        ("2026-03-01T10:00:00Z", "2026-03-01T10:00:00.5Z", "declared"),
        ("2026-03-01T01:30:00+01:00", "2026-03-01T00:00:00Z", "post hoc"),
        ("2026-03-01T00:30:00+01:00", "2026-03-01T00:00:00Z", "declared"),
        ("2026-03-01T00:30:00Z", None, "declared"),
    ],
)
def test_rules_are_post_hoc_when_they_changed_after_the_first_moment_of_collection(
    changed: str,
    began: str | None,
    origin: str,
    tmp_path: Path,
    make_answers: Callable,
    make_row: Callable,
) -> None:
    path = make_answers(
        tmp_path / "r.csv", [make_row()], exclusions={"drop_late": True},
        exclusions_changed_at=changed, collection_began_at=began,
    )  # fmt: skip
    assert read_codebook(path).rules_origin == origin


def test_a_misspelt_rule_table_is_said_loudly(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    path = make_answers(tmp_path / "r.csv", [make_row()], exclusion={"drop_late": True})
    assert read_codebook(path).unknown_fields == ("exclusion",)
    warnings = estimate(path, bootstraps=100)["warnings"]
    assert "codebook.json holds fields that are not known and were not used: exclusion." in warnings


def test_two_modes_without_live_answers_want_a_choice(
    tmp_path: Path, make_answers: Callable, make_row: Callable
) -> None:
    rows = [make_row(participant=mode, mode=mode) for mode in ("pilot", "simulated")]
    responses = read_responses(make_answers(tmp_path / "r.csv", rows))
    with pytest.raises(InputError, match=r"got 'pilot, simulated', wanted one of them.*--mode"):
        select_mode(responses, None)
    assert select_mode(responses, "pilot")[1:] == ("pilot", {"simulated": 1})
