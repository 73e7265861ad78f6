"""Reports in a real browser: nothing is loaded or executed that should not be, it fits, zooms, prints."""

import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rig.cli import app
from tests.browser.chromium import Page
from tests.rig.report.folders import HOSTILE, write_folder

SIZES = {"phone": (360, 740), "small phone": (320, 568), "tablet": (768, 1024), "desk": (1280, 900)}

VIEW = "document.querySelector('figure.plot')"

CONTRAST = """
(() => {
  const lit = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
  const luminance = (text) => {
    const [r, g, b] = text.match(/[\\d.]+/g).map((part) => lit(part / 255));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (node) => {
    for (let at = node; at; at = at.parentElement) {
      const colour = getComputedStyle(at).backgroundColor;
      if (!colour.startsWith('rgba') || !colour.endsWith(' 0)')) return colour;
    }
    return 'rgb(255, 255, 255)';
  };
  let worst = [99, ''];
  const texts = 'h1,h2,h3,p,a,b,td,th,dt,dd,li,small,span,pre,button:enabled,caption,text';
  for (const node of document.querySelectorAll(texts)) {
    const style = getComputedStyle(node), ink = node.tagName === 'text' ? style.fill : style.color;
    const two = [luminance(ink), luminance(behind(node))].sort((a, b) => b - a);
    const ratio = (two[0] + 0.05) / (two[1] + 0.05);
    if (ratio < worst[0]) worst = [ratio, node.outerHTML.slice(0, 80)];
  }
  return worst;
})()
"""
"""The lowest ratio of contrast between a text and what is behind it, and where."""


def report(folder: Path, name: str = "SHD-17") -> Path:
    write_folder(folder, name)
    answer = CliRunner().invoke(app, ["report", str(folder)])
    assert answer.exit_code == 0, answer.stderr
    return folder / "report.html"


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return report(tmp_path_factory.mktemp("loop"))


def quiet(page: Page, file: Path) -> None:
    """Nothing but the file itself was asked for, nothing was complained of, nobody was asked anything."""
    assert page.requests() == [file.resolve().as_uri()]
    assert page.complaints() == []
    assert page.dialogs() == []


def zoomed(page: Page) -> bool:
    return bool(page.evaluate(f"{VIEW}.dataset.zoomed") == "true")


def ticks(page: Page) -> list[str]:
    return list(page.evaluate(f"[...{VIEW}.querySelectorAll('.x-ticks text')].map((node) => node.textContent)"))


def plot_point(page: Page, x: float, y: float) -> tuple[float, float]:
    """Give where the share x, y of the first plot's box lies in the window."""
    page.evaluate(f"{VIEW}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
    place = page.evaluate(
        f"(({{left, top, width, height}}) => [left, top, width, height])"
        f"({VIEW}.querySelector('.frame').getBoundingClientRect())"
    )
    return place[0] + x * place[2], place[1] + (1.0 - y) * place[3]


@pytest.mark.parametrize("size", SIZES)
def test_the_page_fits_the_window_and_loads_nothing(page: Page, file: Path, size: str) -> None:
    page.open(file, *SIZES[size])
    width = page.evaluate("document.documentElement.scrollWidth")
    assert width <= SIZES[size][0]
    assert page.evaluate("document.querySelectorAll('figure svg').length") == 4
    quiet(page, file)


def test_a_wide_table_scrolls_within_itself_on_a_phone(page: Page, file: Path) -> None:
    page.open(file, *SIZES["phone"])
    inside, shown = page.evaluate(
        "(({scrollWidth, clientWidth}) => [scrollWidth, clientWidth])(document.querySelector('.scroll'))"
    )
    assert inside > shown
    assert shown <= 360


def test_a_shade_shows_at_which_edge_a_table_goes_on_and_no_number_is_broken(page: Page, file: Path) -> None:
    page.open(file, *SIZES["phone"])
    style = "getComputedStyle(document.querySelector('.scroll'))"
    assert page.evaluate(f"{style}.backgroundAttachment") == "local, local, scroll, scroll"
    assert page.evaluate(f"{style}.backgroundImage").count("linear-gradient") == 4
    wraps = "[...document.querySelectorAll('td.number')].map((cell) => getComputedStyle(cell).whiteSpace)"
    assert set(page.evaluate(wraps)) == {"nowrap"}
    captions = "[...document.querySelectorAll('caption')].map((one) => one.getBoundingClientRect().right)"
    assert max(page.evaluate(captions)) <= SIZES["phone"][0]


@pytest.mark.parametrize("name", HOSTILE)
def test_names_from_files_do_nothing(page: Page, tmp_path: Path, name: str) -> None:
    file = report(tmp_path, name)
    page.open(file, *SIZES["phone"])
    assert page.evaluate("window.pwned") is None
    assert page.evaluate("[document.scripts.length, document.images.length]") == [1, 0]
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    quiet(page, file)


def test_the_policy_stops_a_script_that_got_in_all_the_same(page: Page, file: Path, tmp_path: Path) -> None:
    text = file.read_text(encoding="utf-8")
    torn = tmp_path / "torn.html"
    slipped = "<script>window.pwned = 1</script><img src=x onerror='window.pwned = 2'></main>"
    torn.write_text(text.replace("</main>", slipped), encoding="utf-8")
    page.open(torn)
    assert page.evaluate("window.pwned") is None


def test_dragging_over_a_plot_zooms_and_a_double_click_or_button_shows_all(page: Page, file: Path) -> None:
    page.open(file)
    whole = ticks(page)
    assert whole == ["0", "100", "200", "300"]
    begin, end = plot_point(page, 0.25, 0.2), plot_point(page, 0.51, 0.9)
    page.mouse("mousePressed", *begin)
    page.mouse("mouseMoved", *end)
    page.mouse("mouseReleased", *end)
    assert zoomed(page)
    # a quarter to a little over a half of 360 degrees
    assert ticks(page) == ["100", "120", "140", "160", "180"]
    page.evaluate(f"{VIEW}.querySelectorAll('button')[2].click()")
    assert (zoomed(page), ticks(page)) == (False, whole)


def test_a_zoomed_plot_shows_the_points_where_its_axes_say(page: Page, file: Path) -> None:
    page.open(file)
    page.evaluate(f"{VIEW}.querySelectorAll('button')[0].click()")
    # the first plot has a sine of order 1 in degrees: 30 urad high where twice the angle is 90 degrees
    left, right = 90.0, 270.0
    highest = page.evaluate(
        f"""(() => {{
          const svg = {VIEW}.querySelector('svg'), path = svg.querySelector('.before-mean');
          const box = svg.querySelector('.frame').getBoundingClientRect(), place = path.getScreenCTM();
          const places = Array.from({{length: 400}}, (_, k) => path.getPointAtLength(k / 400 * path.getTotalLength()));
          const turned = places.map((point) => point.matrixTransform(place));
          const shown = turned.filter((point) => point.x > box.left && point.x < box.right);
          const top = shown.reduce((a, b) => (a.y < b.y ? a : b));
          return (top.x - box.left) / box.width;
        }})()"""
    )
    assert left + highest * (right - left) == pytest.approx(225.0, abs=8.0)


def test_a_plot_is_zoomed_moved_and_shown_whole_from_the_keyboard(page: Page, file: Path) -> None:
    page.open(file)
    whole = ticks(page)
    page.evaluate(f"{VIEW}.querySelector('svg').focus()")
    page.key("+")
    assert zoomed(page)
    before = ticks(page)
    page.key("ArrowRight")
    assert ticks(page) != before
    page.key("0")
    assert (zoomed(page), ticks(page)) == (False, whole)


def test_every_control_has_a_name_and_every_picture_its_words(page: Page, file: Path) -> None:
    page.open(file)
    names = page.evaluate("[...document.querySelectorAll('button')].map((node) => node.getAttribute('aria-label'))")
    words = page.evaluate("[...document.querySelectorAll('figure svg')].map((node) => node.getAttribute('aria-label'))")
    assert len(names) >= 13
    assert all(name and len(name) > 8 for name in names)
    assert all(text and len(text) > 40 for text in words)
    assert page.evaluate("document.documentElement.lang") == "en"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_all_text_stands_out_from_what_is_behind_it(page: Page, file: Path, scheme: str) -> None:
    page.open(file, prefers_color_scheme=scheme)
    ratio, where = page.evaluate(CONTRAST)
    assert ratio >= 4.5, where


def test_the_dark_page_is_dark(page: Page, file: Path) -> None:
    shades = []
    for scheme in ("light", "dark"):
        page.open(file, prefers_color_scheme=scheme)
        shades.append(page.evaluate("getComputedStyle(document.body).backgroundColor"))
    assert shades == ["rgb(255, 255, 255)", "rgb(20, 24, 28)"]


def test_a_finger_moves_a_zoomed_plot_and_else_the_page(page: Page, file: Path) -> None:
    page.open(file, *SIZES["phone"])
    touch = f"getComputedStyle({VIEW}.querySelector('svg')).touchAction"
    assert page.evaluate(touch) == "pan-y"
    page.evaluate(f"{VIEW}.querySelectorAll('button')[0].click()")
    assert page.evaluate(touch) == "none"
    before = ticks(page)
    begin, end = plot_point(page, 0.7, 0.5), plot_point(page, 0.3, 0.5)
    page.call("Emulation.setTouchEmulationEnabled", enabled=True)
    for kind, at in (("touchStart", [begin]), ("touchMove", [end]), ("touchEnd", [])):
        points = [{"x": x, "y": y} for x, y in at]
        page.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    page.call("Emulation.setTouchEmulationEnabled", enabled=False)
    after = ticks(page)
    assert before[0] == "100"
    assert float(after[-1]) > float(before[-1])


def test_a_report_of_a_run_fits_loads_nothing_and_prints(page: Page, tmp_path: Path) -> None:
    name = "log <script>window.pwned=1</script>"
    rows = "".join(f"{k / 100},{math.sin(k / 30)},{math.sin(k / 30 + 0.1)}\n" for k in range(600))
    (tmp_path / "log.csv").write_text(f"time[s],motor_torque[N*m],output_torque[N*m]\n{rows}")
    (tmp_path / "log.toml").write_text(f"procedure = 'locked-output'\noperator = '{name}'\n")
    answer = CliRunner().invoke(app, ["report", str(tmp_path / "log.csv")])
    assert answer.exit_code == 0, answer.stderr
    page.open(tmp_path / "log.html", *SIZES["phone"])
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    assert page.evaluate("document.querySelectorAll('figure').length") == 3
    assert page.evaluate("document.body.textContent.includes('<script>window.pwned=1</script>')")
    assert page.evaluate("window.pwned") is None
    assert page.pdf().startswith(b"%PDF-")
    quiet(page, tmp_path / "log.html")


def test_a_command_is_copied_whole(page: Page, file: Path) -> None:
    page.open(file)
    keep = "{writeText: async (text) => { window.kept = text; }}"
    page.evaluate(f"Object.defineProperty(navigator, 'clipboard', {{value: {keep}}})")
    page.evaluate("document.querySelector('pre.command + button').click()")
    assert page.evaluate("window.kept") == "rig run free-run --set free-run.turns=2 # SHD-17"


def test_without_scripts_all_plots_and_texts_are_there(page: Page, file: Path) -> None:
    page.call("Emulation.setScriptExecutionDisabled", value=True)
    try:
        page.open(file)
        found = page.call("DOM.getDocument", depth=-1)["root"]["nodeId"]
        counts = [
            len(page.call("DOM.querySelectorAll", nodeId=found, selector=selector)["nodeIds"])
            for selector in ("figure svg path", "figure svg .x-ticks text", "figure button")
        ]
    finally:
        page.call("Emulation.setScriptExecutionDisabled", value=False)
    assert counts[0] >= 11
    assert counts[1] >= 12
    assert counts[2] == 0


def test_it_prints_in_light_colours_without_controls(page: Page, file: Path) -> None:
    page.open(file, prefers_color_scheme="dark")
    printed = page.pdf()
    assert printed.startswith(b"%PDF-")
    assert printed.count(b"/Type /Page\n") >= 2
    page.call("Emulation.setEmulatedMedia", media="print")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    controls = "[...document.querySelectorAll('nav, .tools, button')]"
    hidden = page.evaluate(f"{controls}.map((node) => getComputedStyle(node).display)")
    page.call("Emulation.setEmulatedMedia", media="")
    assert set(hidden) == {"none"}
