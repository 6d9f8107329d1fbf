"""report.html: well formed, all of it in one file, every section there, and its figures are those of
run.json and trees.csv."""

import base64
import csv
import json
import os
import re
import struct
import subprocess
import sys
import tempfile
import zlib
from html.parser import HTMLParser
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "bad_input"))
from program import reported_walk, simulated

PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
VOID = {"meta", "br", "hr", "img", "input", "link"}
RUN_SECTIONS = ["The map from above", "Where it is", "What to distrust", "Stand figures", "Trees", "The files of this folder",
                "Errors against the known truth", "Places seen again", "How well the scans matched", "Time"]


class Page(HTMLParser):
    """Fails on tags that do not nest; keeps headings, tiles, tables, references and scripts."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.headings, self.tiles, self.tables = [], [], {}, []
        self.boxes = []  # classes of the open divs
        self.references, self.ids, self.kept, self.words = [], [], "", ""
        self.feed(text)
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def handle_startendtag(self, tag, attributes):
        self.look_at(tag, attributes)

    def handle_starttag(self, tag, attributes):
        self.look_at(tag, attributes)
        if tag in VOID:
            return
        if tag == "div":
            self.boxes.append(dict(attributes).get("class", ""))
        if tag == "table":
            # On a narrow screen it scrolls in its own box, not the page.
            assert self.boxes and self.boxes[-1] in ("wide", "scroll"), self.boxes
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        self.open.append(tag)
        self.kept = ""

    def look_at(self, tag, attributes):
        names = [name for name, _ in attributes]
        assert len(names) == len(set(names)), f"<{tag}> names an attribute twice"
        assert tag not in ("link", "iframe", "object", "embed", "base"), tag
        for name, value in attributes:
            if name in ("src", "href", "xlink:href", "srcset", "action", "data"):
                self.references.append((tag, value))
            if name == "id":
                self.ids.append(value)

    def handle_endtag(self, tag):
        assert self.open and self.open[-1] == tag, f"</{tag}> within {self.open}"
        self.open.pop()
        if tag == "div":
            self.boxes.pop()
        if tag in ("h1", "h2"):
            self.headings.append(self.kept)
        elif tag == "b" and self.open[-1] == "div":
            self.value = self.kept
        elif tag == "span" and self.open[-1] == "div":
            self.tiles[self.kept] = self.value
        elif tag in ("td", "th"):
            self.tables[-1][-1].append(self.kept)

    def handle_data(self, data):
        self.kept += data
        self.words += data


def read_png(data):
    """Width, height and the colour number of each pixel of an 8-bit picture with a palette."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = {}, 8
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        (checksum,) = struct.unpack(">I", data[at + 8 + size:at + 12 + size])
        assert checksum == zlib.crc32(kind + body), kind
        chunks[kind] = chunks.get(kind, b"") + body
        at += 12 + size
    assert list(chunks)[0] == b"IHDR" and list(chunks)[-1] == b"IEND"
    width, height, depth, colour = struct.unpack(">IIBB", chunks[b"IHDR"][:10])
    assert (depth, colour) == (8, 3)
    raw = zlib.decompress(chunks[b"IDAT"])
    assert len(raw) == height * (width + 1)
    rows = [raw[y * (width + 1):(y + 1) * (width + 1)] for y in range(height)]
    assert all(row[0] == 0 for row in rows)
    pixels = b"".join(row[1:] for row in rows)
    assert max(pixels) < len(chunks[b"PLTE"]) // 3 <= 256
    return width, height, pixels


def check_self_contained(text, page):
    assert not re.search(r"(?i)https?:|//[a-z0-9.-]+\.[a-z]{2,}/|@import|<link", text)
    assert not re.search(r"url\((?!data:|#)", text)
    assert len(page.ids) == len(set(page.ids))
    pictures = 0
    for tag, value in page.references:
        assert value.startswith(("data:image/png;base64,", "#")), (tag, value[:80])
        if not value.startswith("#"):
            width, height, pixels = read_png(base64.b64decode(value.split(",")[1], validate=True))
            assert width > 20 and height > 20 and len(set(pixels)) > 1, "an empty picture"
            pictures += 1
    return pictures


def number(text):
    return float(re.sub(r"[^0-9.]", "", text.split(" ")[-1 if text.startswith("≈") else 0]))


def check_stand(page, folder):
    """Tiles and table of the trees against trees.csv."""
    with open(folder / "trees.csv", newline="") as rows:
        trees = list(csv.DictReader(rows))
    assert page.tiles["trees with a measured stem"] == f"{len(trees):,}"
    table = next(t for t in page.tables if t[0][0] == "no.")
    assert len(table) == 1 + min(len(trees), 3000)
    for row, tree in zip(table[1:], trees):
        assert row[0] == tree["id"]
        assert abs(float(row[1]) - float(tree["x"])) < 0.0051, (row, tree)
        assert abs(float(row[4]) - 100 * float(tree["dbh_m"])) < 0.051, (row, tree)
        assert (row[7] == "") == (tree["height_m"] == ""), (row, tree)
        assert not tree["height_sd_m"] or abs(float(row[8]) - float(tree["height_sd_m"])) < 0.056, (row, tree)
    facts = json.loads((folder / "run.json").read_text())["quality"]
    assert abs(number(page.tiles["area seen (not a plot's border)"]) - facts["seen_area_m2"] / 1e4) < 0.0051
    assert abs(number(page.tiles["stems per hectare"]) - facts["stems_per_ha"]) < 0.51
    # One mean diameter in the whole page: that of the stand's table.
    assert abs(number(page.tiles["mean diameter at 1.3 m, cm"]) - 100 * facts["mean_dbh_m"]) < 0.051
    # Trees beside the area that was seen are listed, and stand for no hectare.
    assert 0 < facts["stems_per_ha"] * facts["seen_area_m2"] / 1e4 < len(trees) + 0.5
    return trees


def check_made(page, facts):
    """The part on how it was made repeats run.json."""
    shown = {row[0]: row[1] for table in page.tables for row in table if len(row) == 2}
    for name, value in {**facts["counts"], **facts["quality"]}.items():
        if isinstance(value, str):
            assert shown[name] == value, (name, shown[name], value)
            continue
        assert abs(float(shown[name]) - value) <= 1e-9 * abs(value), (name, shown[name], value)
    cells = {cell for table in page.tables for row in table for cell in row}
    for given in facts["inputs"]:
        assert {given["file"], f"{given['bytes']:,}", given["sha256"]} <= cells, given


def read_page(folder):
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>") and '<meta charset="utf-8">' in text
    page = Page(text)
    assert check_self_contained(text, page) > 2
    return page, json.loads((folder / "run.json").read_text())


def run(code, *words):
    done = subprocess.run([PROGRAM, "--quiet", *map(str, words)], capture_output=True, text=True)
    assert done.returncode == code, (words, done.returncode, done.stderr)


def check_run(folder):
    page, facts = read_page(folder)
    assert page.headings[1:] == ["Complete", *RUN_SECTIONS], page.headings
    check_files(page, folder)
    assert page.tiles["scans"] == f"{facts['scans']:,}"
    assert page.tiles["length of the path"] == f"{facts['quality']['length_m']:.0f} m"
    assert page.tiles["of recording"] == f"{facts['recording_s']:.1f} s"
    per_scan = next(v for k, v in page.tiles.items() if k.startswith("per scan"))
    assert per_scan == f"{facts['stages']['scan']['wall_ms']['mean']:.0f} ms"
    check_stand(page, folder)
    check_made(page, facts)
    assert f"{facts['quality']['ape_rmse_m']:.3f} m" in page.words, facts["quality"]
    return facts


def check_inventory(folder):
    page, facts = read_page(folder)
    assert page.headings[:2] == ["run", "Complete"], page.headings
    # The run is too short to tell its place, so its inventory has none either.
    assert page.headings[2:] == RUN_SECTIONS[:1] + RUN_SECTIONS[2:6] + ["Time"] * ("Time" in page.headings)
    check_files(page, folder)
    check_stand(page, folder)
    check_made(page, facts)


def check_files(page, folder):
    """The list of files is what lies in the folder."""
    table = next(t for t in page.tables if t[0][0] == "file" and t[0][1] == "what it holds")
    assert sorted(row[0] for row in table[1:]) == sorted(p.name for p in folder.iterdir()), table


def check_untrusted(recording, folder):
    """A damaged recording: the verdict, its reasons and every warning are on the page, escaped."""
    spoilt = folder / "<b>&walk.mcap"
    data = bytearray(recording.read_bytes())
    for at in range(len(data) // 2, len(data) // 2 + 400):
        data[at] ^= 0x55
    spoilt.write_bytes(data)
    run(4, "map", spoilt, "-o", folder / "run", "--overwrite")
    page, facts = read_page(folder / "run")
    assert page.headings[0] == spoilt.name
    assert page.headings[1] == facts["status"].capitalize() and facts["status"] != "complete"
    for reason in facts["reasons"]:
        assert reason in page.words, reason
    assert facts["warnings"]
    for warning in facts["warnings"]:
        assert warning["message"] in page.words, warning


with tempfile.TemporaryDirectory() as scratch:
    scratch = Path(scratch)
    mapped, inventory = reported_walk()
    print("run:", check_run(mapped)["scans"], "scans")
    check_inventory(inventory)
    check_untrusted(simulated("demo", 1, 5, "lidar.model=VLP-16"), scratch)
