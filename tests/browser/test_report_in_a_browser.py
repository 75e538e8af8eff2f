"""The report as a reader meets it: in a browser, wide and narrow, by mouse and by keyboard."""

import shutil

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from tests import made_up_run

from dapple.report import run_report

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next((path for name in BROWSERS if (path := shutil.which(name))), None)
DRIVER = shutil.which("chromedriver")
pytestmark = pytest.mark.skipif(
    not (BROWSER and DRIVER), reason="no Chromium with chromedriver: `tools/browser` installs them"
)
WIDE, NARROW = 1280, 400
LABELS = ("1_1", made_up_run.EVIL)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = made_up_run.write(tmp_path_factory.mktemp("run"), LABELS)
    (folder / "report.html").write_text(run_report.build("a <b>run</b>", folder, {}), "utf-8")
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser():
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for switch in ("headless=new", "no-sandbox", "enable-unsafe-swiftshader",
                   "disable-dev-shm-usage"):  # fmt: skip
        options.add_argument(f"--{switch}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


def opened(browser, path, width):
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < WIDE}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(path.as_uri())
    drawn = "return document.querySelectorAll('.canvas.js-plotly-plot, .canvas .js-plotly-plot')"
    WebDriverWait(browser, 60).until(lambda driver: len(driver.execute_script(drawn)) >= 6)
    return browser


@pytest.fixture
def page(browser, path):
    return opened(browser, path, WIDE)


def of(page, chart, what):
    """What is drawn in a chart."""
    return page.execute_script(f"return document.querySelector('#{chart}{what}")


def until(page, changed):
    WebDriverWait(page, 20).until(lambda _: changed())


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_the_page_opens_without_an_error_and_never_scrolls_sideways(browser, path, width):
    page = opened(browser, path, width)
    errors = [entry for entry in page.get_log("browser") if entry["level"] == "SEVERE"]
    assert errors == []
    across = "return document.documentElement.scrollWidth"
    assert page.execute_script(across) <= width


def test_labels_of_the_input_stay_text(page):
    assert page.execute_script("return window.alerted === undefined")
    options = page.find_elements(By.CSS_SELECTOR, "#sensors select option")
    assert LABELS[1] in [option.text for option in options]
    assert page.find_element(By.TAG_NAME, "h1").text == "a <b>run</b>"


def test_the_slider_moves_sun_and_map_here_and_below_the_tree(page):
    slider = page.find_element(By.CSS_SELECTOR, "#ground input[type=range]")
    seen = []
    for key in (Keys.HOME, Keys.END):
        slider.send_keys(key)
        until(page, lambda: len(of(page, "tree", " .canvas').data.map((one) => one.type)")) >= 5)
        seen.append(
            (
                of(page, "ground", " .canvas').data[0].z"),
                of(page, "ground", " .canvas').data[2].x"),
                of(page, "tree", " .canvas').data.find((one) => one.type === 'surface')")[
                    "surfacecolor"
                ],
                slider.get_attribute("aria-valuetext"),
            )
        )
    first, last = seen
    assert first[0] == made_up_run.PAR_ON_GROUND[0].tolist()
    assert last[0] == made_up_run.PAR_ON_GROUND[1].tolist()
    assert first[1] != last[1]
    assert first[2] == first[0][:1]  # the part that is near the tree
    assert last[2] == last[0][:1]
    assert first[3].startswith("2023-08-10 12:00, sun 40° high in the south-east")


def test_a_sensor_is_chosen_by_keyboard_and_on_the_plan(page):
    line = " .canvas > div:nth-child(2)').data.find((one) => one.name === 'polygons').y"
    told = page.find_element(By.CSS_SELECTOR, "#sensors .told")
    assert "Sensor 1_1" in told.text  # its light changes most
    assert max(of(page, "sensors", line)) == 1100
    page.find_element(By.CSS_SELECTOR, "#sensors select").send_keys(Keys.ARROW_DOWN)
    until(page, lambda: "alerted" in told.text)
    assert max(of(page, "sensors", line)) == 100
    page.execute_script(
        "document.querySelector('#sensors .canvas > div').emit('plotly_click', "
        "{points: [{curveNumber: 0, pointIndex: 0}]})"
    )
    until(page, lambda: "Sensor 1_1" in told.text)
    assert max(of(page, "sensors", line)) == 1100


def test_the_plan_is_coloured_by_what_is_asked(page):
    colours = " .canvas > div').data[0].marker.color"
    chooser = page.find_elements(By.CSS_SELECTOR, "#sensors select")[2]
    by_r = of(page, "sensors", colours)
    chooser.send_keys("mean light")
    until(page, lambda: of(page, "sensors", colours) != by_r)
    assert of(page, "sensors", colours) == [350, 100]


def test_a_column_sorts_its_table_up_and_down_by_keyboard_too(page):
    table = next(
        one
        for one in page.find_elements(By.CSS_SELECTOR, "table.sortable")
        if "Simulated against measured" in one.text
    )

    def names():
        return [row.text.split()[0] for row in table.find_elements(By.CSS_SELECTOR, "tbody tr")]

    button = table.find_elements(By.CSS_SELECTOR, "th button")[3]  # RMSE
    button.send_keys(Keys.ENTER)
    assert names() == ["truth", "polygons"]
    button.click()
    assert names() == ["polygons", "truth"]
    assert table.find_elements(By.TAG_NAME, "th")[3].get_attribute("aria-sort") == "descending"


def test_the_tree_turns_at_a_button_and_shows_what_is_chosen(page):
    camera = " .canvas')._fullLayout.scene._scene.getCamera().eye"
    until(page, lambda: of(page, "tree", camera))
    before = of(page, "tree", camera)
    page.find_element(By.XPATH, "//button[contains(., 'turn left')]").click()
    until(page, lambda: of(page, "tree", camera) != before)
    page.find_element(By.CSS_SELECTOR, "#tree select").send_keys("truth")
    until(page, lambda: page.find_element(By.CSS_SELECTOR, "#tree .told").text == "Shown: truth.")
    boxes = page.find_elements(By.CSS_SELECTOR, "#tree input[type=checkbox]")
    drawn = len(of(page, "tree", " .canvas').data"))
    boxes[0].click()
    until(page, lambda: len(of(page, "tree", " .canvas').data")) == drawn - 1)


def test_everything_that_is_shown_or_asked_has_a_name_for_those_who_do_not_see(page):
    nameless = """
      const named = (one) =>
        (one.labels && one.labels.length) || one.ariaLabel || one.textContent.trim();
      return [...document.querySelectorAll('input, select, button, [role=img], [role=region], img')]
        .filter((one) => !one.closest('.js-plotly-plot') || one.getAttribute('role') === 'img')
        .filter((one) => one.tagName === 'IMG' ? !one.alt : !named(one))
        .map((one) => one.outerHTML.slice(0, 100));
    """
    assert page.execute_script(nameless) == []
