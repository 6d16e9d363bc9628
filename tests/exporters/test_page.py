"""The page, by its text and in a real browser."""

import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from quarterdeck.exporters.page import page
from quarterdeck.geo.scenario import Casualty

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def test_it_needs_no_network_and_no_name_is_markup(make_fleet):
    """No address is fetched, and a vehicle's name cannot end the script or open a tag."""
    text = page(make_fleet(2, names=["</script><script>alert(1)</script>", "<b>&"]))
    assert text.count("<script>") == text.count("</script>") == 1
    assert "<b>" not in text
    addresses = re.findall(r"(?:src|href|url\(|@import|fetch|https?:)[^\s>]*", text)
    assert set(addresses) <= {'http://www.w3.org/2000/svg"', "https:", "http:", "http://www.w3.org/2000/svg"}


def test_the_legend_has_what_is_on_the_map(make_fleet):
    """Casualties and who is lost are drawn and told where there are any, and an obstacle that may be crossed as such."""
    plain = make_fleet(2)
    signs = ("obstacle<br>", "not covered, may be crossed", "casualty: red", "lost<br>", "task<br>")
    assert [sign in page(plain) for sign in signs] == [True, False, False, False, False]
    low = tuple(replace(o, blocks=frozenset({"ground"})) for o in plain.site.obstacles)
    changed = replace(plain, site=replace(plain.site, obstacles=low), lost=(replace(plain.vehicles[0], id="usv9"),))
    text = page(replace(changed, casualties=(Casualty("c1", (5.0, 5.0), "red"),)))
    assert [sign in text for sign in signs] == [False, True, True, True, False]
    assert "usv9 lost" in text
    assert "c1, red" in text


@pytest.mark.skipif(BROWSER is None, reason="no Chromium here: the page's script was not run")
def test_a_browser_runs_it(make_fleet, tmp_path):
    """Headless Chromium runs the script: the map is fitted, vehicles placed, zooming and hiding work."""
    probe = """<script>
      const before = map.getAttribute("viewBox");
      map.dispatchEvent(new WheelEvent("wheel", {deltaY: -500, clientX: 200, clientY: 200, cancelable: true}));
      get("play").value = 500; get("play").dispatchEvent(new Event("input"));
      const hide = document.querySelector("[data-route='1']"); hide.click();
      document.title = JSON.stringify({before, after: map.getAttribute("viewBox"), now: get("n0").getAttribute("d"),
        hidden: get("r1").style.display, clock: get("clock").textContent});
    </script></body>"""
    path = tmp_path / "page.html"
    path.write_text(page(make_fleet(3)).replace("</body>", probe))
    command = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"]
    done = subprocess.run([*command, "--dump-dom", path.as_uri()], capture_output=True, text=True, check=False, timeout=120)
    title = re.search(r"<title>(\{.*?\})</title>", done.stdout)
    assert title, done.stderr[-2000:]
    import json

    seen = json.loads(title[1].replace("&quot;", '"').replace("&amp;", "&"))
    width = [float(seen[k].split()[2]) for k in ("before", "after")]
    assert width[1] < 0.6 * width[0]
    assert seen["now"] != "M0 0h0"
    assert seen["hidden"] == "none"
    assert seen["clock"] == "11:37"
