"""The test track drives every manoeuvre that turns."""

import numpy as np
import pytest
from test_accuracy_report import line

from benchmarks.accuracy.__main__ import ITSELF
from benchmarks.accuracy.logs import settings
from benchmarks.accuracy.measure import measure
from benchmarks.accuracy.report import COURSE_HEAD, show_courses, summary
from benchmarks.accuracy.track import COURSES, STRAIGHT, track
from jaxveh.manoeuvres import MANOEUVRES


def test_every_manoeuvre_that_turns_is_driven():
    driven = {course.name for course in COURSES.values()}
    assert driven.isdisjoint(STRAIGHT)
    assert driven | set(STRAIGHT) == set(MANOEUVRES)


def test_each_course_has_a_row_of_its_medians(capsys):
    more = {"coverage_50": 0.5, "crps": 0.1, "crps_constant": 0.1}
    about = summary([line(rmse=0.1, **more), line(rmse=0.3, **more), line(failed="too short")])
    assert about.keys() >= set(COURSE_HEAD.values())
    show_courses({"ramp": about, "circle": {"runs": 1, "failed": 1}}, "track")
    rows = [text for text in capsys.readouterr().out.splitlines() if "ramp" in text or "circle" in text]
    cells = [[cell.strip() for cell in row.split("│")[2:-1]] for row in rows]
    # Drives and failures; RMSE, open loop, their ratio and the worst, the ratio to the file's car and the worst, two coverages.
    assert cells[0] == ["3", "1", "0.20", "0.60", "0.33", "0.50", "0.67", "1.00", "0.95", "0.95"]
    assert cells[1] == ["1", "1", *[""] * len(COURSE_HEAD)]


@pytest.mark.seldom
def test_a_circle_that_calibrates_itself_stays_with_the_file_s_car():
    """Eleven times the error of the file's car, when every row counted."""
    logs = track("circle", 8, seed=5)
    found = summary([measure(log, next(one for one in settings(log) if one.name == ITSELF)) for log in logs])
    assert found["failed"] == 0 and found["over_as_told_worst"] < 1.3 and found["coverage_95"] > 0.92


@pytest.mark.seldom
def test_a_drive_ends_before_the_steps_of_its_simulation_are_too_long():
    """The accelerometer then disagrees with the speed by several m/s^2, however both are measured."""
    for log in track("braking in a turn", 6, seed=1):
        r = log.recording
        v_x, v_y, a_x, turn = (np.asarray(r[name]) for name in ("v_x", "v_y", "a_x", "yaw_rate"))
        smooth = lambda values: np.convolve(values, np.full(21, 1.0 / 21), "valid")
        off = smooth(a_x) - np.gradient(smooth(v_x), r.time[10:-10]) + smooth(v_y * turn)
        # The sensor's offset and the body's pitch remain.
        assert np.abs(off[-30:] - np.median(off[-100:-50])).max() < 0.8, log.name
