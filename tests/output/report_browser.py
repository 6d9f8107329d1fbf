"""report.html in a browser: map, table and sheets go together, nothing is loaded from elsewhere, a print holds all."""

import re
import sys
import tempfile
from pathlib import Path

import chromium

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import reported_walk

ROWS = "[...document.querySelectorAll('.all-trees tbody tr')]"
CHOSEN = f"{ROWS}.filter((row) => row.classList.contains('chosen')).map((row) => Number(row.cells[0].textContent))"


def mouse(browser, kind, x, y, **more):
    browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)


def click(browser, x, y):
    for kind in ("mousePressed", "mouseReleased"):
        mouse(browser, kind, x, y, button="left", clickCount=1)


def place_on_screen(browser, tree):
    """Where the map shows a tree, in the window."""
    return browser.run(
        "(() => { const box = document.querySelector('canvas').getBoundingClientRect(); const map = selection.map;"
        f"map.painter.view = map.view; const at = map.painter.at(map.map.trees.find((t) => t.id === {tree}));"
        "return [box.x + at[0], box.y + at[1], box.x + box.width / 2, box.y + box.height / 2]; })()")


def check_map(browser):
    """A row centres the map; a click on a tree marks its row; wheel and keys zoom and move."""
    browser.run("document.querySelector('canvas').scrollIntoView()")
    browser.run(f"{ROWS}[3].click()")
    browser.wait()
    assert browser.run(CHOSEN) == [4]
    x, y, middle_x, middle_y = place_on_screen(browser, 4)
    assert abs(x - middle_x) < 2 and abs(y - middle_y) < 2, (x, y, middle_x, middle_y)
    assert "tree 4: " in browser.run("document.querySelector('.told').textContent")
    scale = browser.run("selection.map.view.scale")
    mouse(browser, "mouseWheel", middle_x, middle_y, deltaX=0, deltaY=600)
    browser.wait()
    assert browser.run("selection.map.view.scale") < 0.6 * scale
    browser.run("selection.choose(0, 'test')")
    x, y, *_ = place_on_screen(browser, 4)
    click(browser, x, y)
    browser.wait()
    assert browser.run(CHOSEN) == [4]
    for key in ("ArrowRight", "ArrowDown"):
        browser.run(f"document.querySelector('canvas').dispatchEvent(new KeyboardEvent('keydown', {{key: '{key}'}}))")
    moved_x, moved_y, *_ = place_on_screen(browser, 4)
    assert moved_x < x - 20 and moved_y < y - 20, (x, y, moved_x, moved_y)
    browser.run("document.querySelector('canvas').dispatchEvent(new KeyboardEvent('keydown', {key: '0'}))")
    assert browser.run("selection.map.view.scale === selection.map.least()")
    # Labels and circles are there: the map holds more than one colour.
    browser.wait()
    colours = browser.run(
        "(() => { const c = document.querySelector('canvas'); const all = c.getContext('2d')"
        ".getImageData(0, 0, c.width, c.height).data; const seen = new Set();"
        "for (let i = 0; i < all.length; i += 4) seen.add(all[i] * 65536 + all[i + 1] * 256 + all[i + 2]);"
        "return seen.size; })()")
    assert colours > 20, colours


def check_legend(browser):
    """A tree has the colours of the map in the legend too."""
    colours = "((q, p) => getComputedStyle(document.querySelector(q))[p])"
    # A fix is a dot, too, and has no kind.
    kinds = browser.run("[...new Set([...document.querySelectorAll('.legend .dot')].map((i) => i.classList[1]).filter(Boolean))]")
    assert "sure" in kinds and len(kinds) > 1, kinds
    for kind in kinds:
        ring, fill = (browser.run(f"{colours}('.legend .{kind}', '{p}')") for p in ("borderTopColor", "backgroundColor"))
        map_ring, map_fill = (browser.run(f"{colours}('.trees .{kind}', '{p}')") for p in ("stroke", "fill"))
        assert fill == map_fill, (kind, fill, map_fill)
        assert ring == (map_fill if kind == "weak" else map_ring), (kind, ring, map_ring)


def check_place_of_buttons_and_numbers(browser):
    """No button lies on the map, and no two numbers of the grid lie on each other, however it is moved."""
    assert browser.run(
        "(() => { const map = document.querySelector('canvas').getBoundingClientRect();"
        "return [...document.querySelectorAll('.buttons button')].every("
        "(b) => b.getBoundingClientRect().bottom <= map.top); })()")
    overlaps = browser.run(
        "(() => { const { painter, view } = selection.map; const write = painter.write; const boxes = [];"
        "painter.write = (text, x, y, font, align) => { if (!/^[EN] /.test(text)) return; painter.pen.font = font;"
        "const wide = painter.pen.measureText(text).width; const left = align === 'center' ? x - wide / 2 : x;"
        "boxes.push([left, y - 11, left + wide, y]); };"
        "let over = 0; const meet = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];"
        "painter.map.grid = true;"
        "for (let k = 0; k < 400; k += 1) { boxes.length = 0; painter.map.north = k % 2;"
        "painter.paint({ scale: view.scale * 3, x: view.x + 0.7 * k, y: view.y + 0.9 * k });"
        "boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b) => { over += meet(a, b); })); }"
        "painter.write = write; return over; })()")
    assert overlaps == 0, overlaps


def check_crowns(browser):
    """A box draws the outlines of all crowns; that of the chosen tree is always there."""
    count = "(c => { const all = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0;" \
            "for (let i = 0; i < all.length; i += 4) n += all[i] === %d && all[i + 1] === %d && all[i + 2] === %d;" \
            "return n; })(document.querySelector('canvas'))"
    green, blue = (count % colour for colour in ((0x14, 0x53, 0x2d), (0x0b, 0x5f, 0xb0)))
    browser.run("selection.choose(0, 'test')")
    browser.wait()
    assert browser.run(green) == 0 and browser.run(blue) == 0
    browser.run("selection.choose(4, 'test')")
    browser.wait()
    with_crown = browser.run(blue)
    browser.run("(m => { m.map.kept = m.map.crowns; m.map.crowns = []; m.repaint(); })(selection.map)")
    browser.wait()
    assert browser.run(green) == 0 and with_crown > browser.run(blue) + 50, (with_crown, browser.run(blue))
    browser.run("selection.map.map.crowns = selection.map.map.kept")
    browser.run("[...document.querySelectorAll('.layers label')].find((l) => l.textContent.includes('crowns'))"
                ".querySelector('input').click()")
    browser.wait()
    assert browser.run(green) > 200, browser.run(green)


def check_table(browser):
    """Sorting by a column, empty cells last; a filter hides rows and pales the trees of the map."""
    heads = browser.run("[...document.querySelector('.all-trees table').tHead.rows[0].cells].map((c) => c.textContent)")
    column = heads.index("± cm")
    values = f"{ROWS}.filter((row) => !row.hidden).map((row) => row.cells[{column}].textContent)"
    head = f"document.querySelector('.all-trees table').tHead.rows[0].cells[{column}]"
    for ascending in (True, False):
        browser.run(f"{head}.click()")
        cells = [float(v) for v in browser.run(values) if v]
        assert cells == sorted(cells, reverse=not ascending) and len(cells) > 10
    middle = sorted(cells)[len(cells) // 2]
    box = f"document.querySelectorAll('tr.filters input')[{column}]"
    browser.run(f"{box}.value = '>= {middle}'; {box}.dispatchEvent(new Event('input'))")
    kept = [float(v) for v in browser.run(values)]
    assert kept and min(kept) >= middle and len(kept) == sum(c >= middle for c in cells)
    assert browser.run("selection.shown.size") == len(kept)
    browser.run(f"{box}.value = 'x'; {box}.dispatchEvent(new Event('input'))")
    assert len(browser.run(values)) >= len(cells), "what is not understood filters nothing"
    assert browser.run(f"{box}.classList.contains('wrong')")
    browser.run(f"{box}.value = ''; {box}.dispatchEvent(new Event('input'))")


def check_sheets(browser):
    """The most doubtful tree first; the next one is chosen in the table too."""
    count = browser.run("document.querySelector('.sheet-data').textContent.trim().split('\\n').length")
    assert f" of {count} " in browser.run("document.querySelector('.sheet-bar span').textContent")
    browser.run("document.querySelectorAll('.sheet-bar button')[1].click()")
    shown = int(re.search(r"Tree (\d+)", browser.run("document.querySelector('.facts').textContent"))[1])
    assert browser.run(CHOSEN) == [shown]
    for path in ("figure:first-child svg path", "figure:last-child svg circle"):
        assert browser.run(f"document.querySelectorAll('.sheet {path}').length") > 0, path


def check_print(browser, path):
    """In print: the still map, all rows, the most doubtful sheets."""
    browser.print_to(path)
    assert path.read_bytes().startswith(b"%PDF")
    assert browser.run("document.querySelectorAll('.printed').length") in (6, 7)
    browser.call("Emulation.setEmulatedMedia", media="print")
    shown = "(query) => getComputedStyle(document.querySelector(query)).display !== 'none'"
    assert browser.run(f"({shown})('svg.map')") and not browser.run(f"({shown})('.moving')")
    browser.call("Emulation.setEmulatedMedia", media="")
    assert browser.run(f"({shown})('.moving')") and not browser.run(f"({shown})('svg.map')")


def check_without_scripts(page):
    with chromium.Browser() as browser:
        browser.call("Emulation.setScriptExecutionDisabled", value=True)
        browser.open(page)
        text = browser.call("Runtime.evaluate", expression="1")  # the page itself runs none
        assert "result" in text
        tree = browser.call("DOM.getDocument", depth=1)["root"]["nodeId"]
        for query, there in (("svg.map circle", True), (".all-trees tbody tr", True), ("canvas", False)):
            found = browser.call("DOM.querySelectorAll", nodeId=tree, selector=query)["nodeIds"]
            assert bool(found) == there, query


def check_narrow(page):
    with chromium.Browser(390, 800, mobile=True) as browser:
        browser.open(page)
        browser.wait()
        assert browser.run("document.documentElement.scrollWidth") <= 390, "the page scrolls sideways"


if chromium.program() is None:
    print("no Chromium here")
    sys.exit(77)
with tempfile.TemporaryDirectory() as scratch:
    scratch = Path(scratch)
    run, inventory = reported_walk()
    page = run / "report.html"
    with chromium.Browser() as browser:
        browser.open(page)
        browser.wait()
        assert browser.errors() == [], browser.errors()
        assert len(browser.requests()) == 1, browser.requests()
        check_legend(browser)
        check_map(browser)
        check_place_of_buttons_and_numbers(browser)
        check_table(browser)
        check_sheets(browser)
        check_print(browser, scratch / "report.pdf")
        assert browser.errors() == [], browser.errors()
    with chromium.Browser() as browser:
        browser.open(inventory / "report.html")
        browser.wait()
        check_crowns(browser)
        assert browser.errors() == [], browser.errors()
    check_without_scripts(page)
    check_narrow(page)
