"""A browser filters and sorts the page of an atlas, offline, and shows the command that repeats a run."""

import pytest
from browser import Chromium

import mbdae

METHODS = ("pherk6", "herk3", "radau3", "rattle2")
READY = "document.querySelector('#runs td')"
WIDE, NARROW = (1280, 900), (390, 844)


@pytest.fixture(scope="module")
def atlas():
    models = ("spring_four_bar", "cam_follower")
    return mbdae.atlas(models, methods=METHODS, rtol=[1e-3, 1e-5], refinements=[1, 4], executor="threads")


@pytest.fixture(scope="module")
def page(atlas, tmp_path_factory):
    path = tmp_path_factory.mktemp("atlas") / "atlas.html"
    atlas.save(path)
    return path


def test_filters_sorting_and_commands(atlas, page):
    script = """
      const cells = row => [...row.cells].map(c => c.textContent);
      const rows = id => [...document.querySelectorAll(`#${id} tr`)].slice(1).map(cells);
      log.all = rows("runs").length;
      log.wins = rows("wins");
      choose("model", "spring_four_bar");
      log.one = rows("runs");
      document.querySelectorAll("#runs th button")[3].click();
      log.sorted = rows("runs").map(row => Number(row[3]));
      choose("low", -4);
      log.range = rows("runs").map(row => Number(row[3]));
      document.querySelector("[value=RATTLE]").click();
      log.families = [...new Set(rows("runs").map(row => row[1]))];
      log.long = rows("long").map(row => row[1]);
      document.querySelector("#runs td:last-child button").click();
      log.command = document.querySelector("#command code").textContent;
      document.querySelector("#plot circle").dispatchEvent(new MouseEvent("click"));
      log.point = document.querySelector("#command code").textContent;
      log.curves = document.querySelectorAll("#plot polyline").length;
      choose("method", "herk3");
      log.method = [...new Set(rows("runs").map(row => row[1]))];
    """
    with Chromium().open(page.as_uri(), WIDE, READY) as tab:
        log = tab.ask(script)
    runs = [p for r in atlas.runs for p in r.points if p.success]
    assert log["all"] == len(runs)
    assert {row[0] for row in log["one"]} == {"spring_four_bar"}
    assert log["sorted"] == sorted(log["sorted"])
    assert log["range"] == [x for x in log["sorted"] if x >= 1e-4]
    assert "rattle2" not in (*log["families"], *log["long"])
    assert {*log["families"]} == {"pherk6", "herk3", "radau3"}
    assert log["curves"] == 3
    assert log["command"].startswith("mbdae compare spring_four_bar -m ")
    assert log["point"].split()[:3] == ["mbdae", "compare", "spring_four_bar"]
    assert log["method"] == ["herk3"]
    headers = [w.target for w in atlas.wins if w.model == "spring_four_bar"]
    shown = next(row for row in log["wins"] if row[0] == "spring_four_bar")[1:]
    assert [cell.split()[0] for cell in shown if cell != "-"] == [
        atlas.comparisons["spring_four_bar"].ranking(target)[0].method for target in headers
    ]


@pytest.mark.parametrize("size", [WIDE, NARROW])
def test_the_page_is_as_wide_as_the_screen(page, size):
    with Chromium().open(page.as_uri(), size, READY) as tab:
        assert tab.evaluate("document.documentElement.scrollWidth") == size[0]
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        light = tab.picture().mean()
        tab.call("Emulation.setEmulatedMedia", features=dark)
        assert tab.picture().mean() < 80 < light
        tab.call("Emulation.setEmulatedMedia", features=[])
