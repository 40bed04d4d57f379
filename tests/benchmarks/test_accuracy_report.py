"""What the accuracy benchmark says of its criteria."""

from benchmarks.accuracy.measure import Line
from benchmarks.accuracy.report import criteria, fleet_criteria


def line(setting="forward, blind", **changed):
    usual = {"rmse": 0.2, "open_loop": 0.6, "as_told": 0.3, "coverage_95": 0.95, "rmse_without_constant": 0.1,
             "open_loop_without_constant": 0.2}  # fmt: skip
    return Line(**{"log": "Genesis", "setting": setting, "seconds": 1.0} | usual | changed)


def test_each_criterion_is_said_with_value_bound_and_verdict():
    said = criteria([line()])
    assert said[0] == "Genesis, forward, blind: error over the best of what is simpler 0.667 (at most 1.02): holds"
    assert said[1] == "Genesis, forward, blind: over open loop without constant 0.5 (at most 0.75): holds"
    assert said[2] == "Genesis, forward, blind: 95 % band covers 0.95 (0.88 to 0.99): holds"
    assert [one.endswith("FAILS") for one in criteria([line(rmse=0.31)])] == [True, False, False]
    assert [one.endswith("FAILS") for one in criteria([line(rmse_without_constant=0.16)])] == [False, True, False]
    for covered in (0.87, 0.995):
        assert [one.endswith("FAILS") for one in criteria([line(coverage_95=covered)])] == [False, False, True]


def test_a_bound_may_be_one_settings_own():
    said = criteria(
        [
            line(log="Ferrari", rmse=0.25),
            line("reversed, blind", log="Ferrari", rmse=0.25),
            line("as told", log="Ferrari"),
        ]
    )
    assert [one for one in said if ": rmse " in one] == [
        "Ferrari, forward, blind: rmse 0.25 (at most 0.24): FAILS",
        "Ferrari, reversed, blind: rmse 0.25 (at most 0.33): holds",
    ]
    # A log that is named like the beginning of another's.
    assert not any(
        "over open loop" in one for name in ("AV-21", "F1TENTH II") for one in criteria([line("as told", log=name)])
    )


def test_what_failed_and_what_saw_its_reference_is_not_judged():
    assert criteria([line("forward, with v_y"), line(failed="too short")]) == []


def test_a_fleet_is_judged_by_its_median_its_losses_and_its_bands():
    about = {"over_open_loop_median": 0.4, "worse_than_open_loop": 0.03, "coverage_95": 0.985}
    assert [one.rsplit(" ", 1)[1] for one in fleet_criteria(about)] == ["holds", "FAILS", "FAILS"]
    assert fleet_criteria({"runs": 3, "failed": 3}) == []
