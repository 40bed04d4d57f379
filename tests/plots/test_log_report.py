"""The page of a log: whole in one file, with the numbers that it was given, and alive in a browser."""

import base64
import gzip
import json
import re
import shutil
import subprocess
import sys
from collections import namedtuple
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from jaxveh import InputError, Recording, plots
from jaxveh.plots import report_charts, report_page

pytest.importorskip("bokeh")

Report = namedtuple("Report", ("sideslip", "v_y"))


def reported(rows=400, name="drive.csv", **more):
    time = 100.0 + 0.01 * np.arange(rows)
    wave = np.sin(time)
    estimate = SimpleNamespace(
        time=time, mean=Report(0.05 * wave, wave), std=Report(0.01 * np.ones(rows), 0.2 * np.ones(rows))
    )
    channels = {"v_x": 20.0 + wave, "yaw_rate": 0.1 * wave, "a_y": 2.0 * wave, "steer": 0.02 * wave}
    truth = {"sideslip": 0.05 * wave + 0.001, "v_y": wave + 0.02}
    recording = Recording(time, channels, {"yaw_rate": "rad/s", "a_y": "m/s^2", "v_x": "m/s", "steer": "rad"})
    others = {"open-loop linear model": {"sideslip": 0.04 * wave, "v_y": 0.8 * wave}}
    return plots.ReportedLog(name, estimate, recording, truth, others)._replace(**more)


def axle():
    slip = np.linspace(-0.1, 0.1, 41)
    visited = np.linspace(-0.05, 0.05, 9000)
    turning = np.arange(9000) % 3 > 0
    share = np.tanh(20 * slip)
    return plots.AxlePoints(slip, share, share - 0.1, share + 0.1, visited, np.tanh(20 * visited), turning)


def innovation(rows=400):
    time, lag = 100.0 + 0.01 * np.arange(rows), 0.01 * np.arange(1, 21)
    squared = 1.0 + 0.9 * np.sin(7 * time)
    mean = np.where(np.arange(rows) < 20, np.nan, 1.0 + 0.5 * np.sin(time))
    return plots.InnovationPoints(
        "slip_balance", time, squared, 1.0, mean, 0.7, 1.3, 1.01, 0.98, lag, np.exp(-lag), 0.1 + lag**2
    )


TABLE = plots.ReportTable(
    "Findings", ("severity", "what"), [("error", "a <b> & c"), ("note", "12.5")], "Small print.", (1,)
)


@pytest.fixture(scope="module")
def page():
    return plots.log_report([reported(axle=axle(), innovations=[innovation()])], title="A <drive>", tables=[TABLE])


class Tags(HTMLParser):
    """The tags of a page with their attributes, and its text outside of scripts."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.words, self.inside = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag in ("script", "style"):
            self.inside.append(tag)

    def handle_endtag(self, tag):
        if self.inside and self.inside[-1] == tag:
            self.inside.pop()

    def handle_data(self, data):
        if not self.inside:
            self.words.append(data)


def test_the_page_needs_nothing_beside_it(page):
    seen = Tags(page)
    asked = [value for _, attributes in seen.tags for name, value in attributes.items() if name in ("src", "href")]
    assert not [value for value in asked if not value.startswith("#")]
    assert (
        "link" not in {tag for tag, _ in seen.tags}
        and "@import" not in page
        and "cdn.bokeh.org/bokeh/release" not in page
    )
    assert page.startswith("<!DOCTYPE html>") and page.rstrip().endswith("</html>")


def test_words_of_others_are_no_tags(page):
    words = " ".join(Tags(page).words)
    assert "A <drive>" in words and "a <b> & c" in words and "Small print." in words
    assert ("b", {}) not in Tags(page).tags
    assert '<td class="number error">' not in page and '<td class="error">error</td>' in page
    assert '<td class="number">12.5</td>' in page


def test_tables_without_rows_say_so_and_folded_ones_open_at_a_click():
    assert "Nothing was fitted." in report_page.table(plots.ReportTable("Fitted", (), (), "Nothing was fitted."))
    folded = report_page.table(TABLE._replace(folded=True))
    assert folded.startswith("<details><summary>Findings</summary><table>") and "<h3>" not in folded


def arrays(page, kind):
    """The arrays that a page holds, read as numbers of a kind; what is no whole number of them is left out."""
    found = [base64.b64decode(text) for text in re.findall(r'"data":"([A-Za-z0-9+/=]{40,})"', page)]
    found = [gzip.decompress(content) if content[:2] == b"\x1f\x8b" else content for content in found]
    return [np.frombuffer(content, kind) for content in found if len(content) % np.dtype(kind).itemsize == 0]


def holds(page, values, kind="<f4", rtol=2e-7):
    return any(one.shape == np.shape(values) and np.allclose(one, values, rtol, 1e-9) for one in arrays(page, kind))


def test_the_page_holds_the_numbers_in_the_units_shown(page):
    log = reported()
    for values in (
        np.degrees(log.estimate.mean.sideslip), np.degrees(log.estimate.std.sideslip), np.degrees(log.truth["sideslip"]),
        np.degrees(log.estimate.mean.sideslip) - np.degrees(log.truth["sideslip"]), log.estimate.mean.v_y,
        np.degrees(0.04 * np.sin(log.estimate.time)), *(np.degrees(log.recording[name]) for name in ("yaw_rate", "steer")),
        log.recording["a_y"], log.recording["v_x"],
    ):  # fmt: skip
        assert holds(page, values)
    assert holds(page, log.estimate.time, "<f8", 0.0)
    shown = innovation()
    assert holds(page, shown.correlation) and holds(page, -shown.band)
    assert any(np.array_equal(one, shown.mean.astype(np.float32), equal_nan=True) for one in arrays(page, "<f4"))
    assert not holds(page, np.degrees(log.estimate.mean.sideslip) + 1e-4)


def test_charts_share_their_time_and_leave_out_what_is_not_there():
    grid = report_charts.time_charts(*reported()[1:5])
    charts = [chart for chart, *_ in grid.children]
    titles = [chart.title.text for chart in charts[1:]]
    assert titles == [
        "sideslip [°]", "error: sideslip [°]", "lateral speed [m/s]", "error: lateral speed [m/s]", "longitudinal speed [m/s]",
        "yaw rate [°/s]", "lateral acceleration [m/s²]", "steer [°]",
    ]  # fmt: skip
    assert len({chart.x_range.id for chart in charts[1:]}) == 1
    assert charts[-1].xaxis[0].axis_label == "time [s]"
    blind = reported(truth=None, others={})
    blind = blind._replace(recording=blind.recording.without("steer", "a_y"))
    titles = [chart.title.text for chart, *_ in report_charts.time_charts(*blind[1:5]).children][1:]
    assert titles == ["sideslip [°]", "lateral speed [m/s]", "longitudinal speed [m/s]", "yaw rate [°/s]"]


def test_long_logs_are_thinned_and_the_page_says_so():
    log = reported(70_000)
    source = report_charts.time_source(log.estimate, log.recording, log.truth, log.others)
    np.testing.assert_array_equal(source.data["time"], log.estimate.time[::3])
    np.testing.assert_allclose(source.data["sideslip"], np.degrees(log.estimate.mean.sideslip[::3]), rtol=1e-6)
    page = plots.log_report([log])
    assert "one row in 3 of 70000" in page and len(page) < 5e6
    assert "one row in" not in plots.log_report([reported()])


def test_a_log_of_27500_rows_is_less_than_5_mb():
    assert len(plots.log_report([reported(27_500, axle=axle())]).encode()) < 5e6


def test_several_logs_have_a_section_each_and_links_to_it():
    logs = [reported(name="monday.csv"), reported(name="tuesday.csv", axle=axle(), tables=[TABLE])]
    seen = Tags(plots.log_report(logs))
    assert [attributes["href"] for tag, attributes in seen.tags if tag == "a"] == ["#log-0", "#log-1"]
    assert [attributes["id"] for tag, attributes in seen.tags if tag == "h2"] == ["log-0", "log-1"]
    words = " ".join(seen.words)
    assert words.index("Findings") > words.rindex("tuesday.csv")


def test_what_cannot_be_reported_on(monkeypatch):
    with pytest.raises(InputError, match="no log to report on"):
        plots.log_report([])
    log = reported()
    with pytest.raises(InputError, match="drive.csv: 400 rows estimated, 5 recorded"):
        plots.log_report([log._replace(recording=log.recording.rows(slice(0, 5)))])
    monkeypatch.setitem(sys.modules, "bokeh", None)
    with pytest.raises(InputError, match=r'bokeh is not installed, .* `pip install "jaxveh\[report\]"`'):
        plots.log_report([log])


BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "chrome-headless-shell")
PROBE = """<script>
window.errors = []; window.addEventListener("error", event => errors.push(event.message));
const probe = setInterval(() => {
  const document_ = window.Bokeh && Bokeh.documents[0];
  if (!errors.length && !(document_ && document_.is_idle)) return;
  clearInterval(probe);
  const models = [...document_._all_models.values()], of = type => models.filter(one => one.type === type);
  const source = of("ColumnDataSource").find(one => one.data.time);
  const range = of("Range1d").find(one => of("RangeTool")[0].x_range === one), expression = of("CustomJSExpr")[0];
  const canvases = root => [...root.querySelectorAll("*")].reduce(
    (count, one) => count + (one.tagName === "CANVAS") + (one.shadowRoot ? canvases(one.shadowRoot) : 0), 0);
  document.body.dataset.found = JSON.stringify({
    errors, canvases: canvases(document), rows: source.data.time.length, start: range.start, end: range.end,
    edge: Array.from(expression.v_compute(source)).slice(0, 5), asked: performance.getEntriesByType("resource").length,
    plots: of("Figure").length, zooms: of("BoxZoomTool").filter(one => one.active).map(one => one.dimensions),
  });
}, 50);
</script>"""


def test_a_browser_without_a_network_draws_it(page, tmp_path):
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        pytest.skip(f"no headless browser on this machine: none of {', '.join(BROWSERS)}")
    (tmp_path / "report.html").write_text(page.replace("</head>", f"{PROBE}</head>", 1), "utf-8")
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND"]
    options += ["--virtual-time-budget=20000", f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1280,1000"]
    address = (tmp_path / "report.html").as_uri()
    done = subprocess.run(
        [browser, *options, "--dump-dom", address], capture_output=True, text=True, timeout=120, check=True
    )
    written = re.search(r'data-found="([^"]*)"', done.stdout)
    assert written, done.stderr
    found = json.loads(written.group(1).replace("&quot;", '"'))
    assert found["errors"] == [] and found["asked"] == 0
    assert found["rows"] == 400 and (found["start"], found["end"]) == (100.0, pytest.approx(103.99))
    assert found["plots"] == 12 and found["canvases"] >= 12 and found["zooms"] == ["width"] * 8
    # The lower edge of the band of 95 %, which the browser reckons itself.
    log = reported()
    low = np.degrees(log.estimate.mean.sideslip - 1.959964 * log.estimate.std.sideslip)
    np.testing.assert_allclose(found["edge"], low[:5], rtol=1e-5)
