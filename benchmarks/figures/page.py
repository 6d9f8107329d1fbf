"""The pages that show the figures: one HTML file that needs nothing else, and the same as Markdown."""

import base64
import html
import json
from dataclasses import asdict, dataclass

from program import version

STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}
img{max-width:100%;border:1px solid #ddd}h2{margin-top:2.5rem}table{border-collapse:collapse}
td,th{border-bottom:1px solid #ddd;padding:.2rem .8rem .2rem 0;text-align:left;vertical-align:top}
.number{font-weight:600}"""
PAPERS = {"P1": "Nevalainen et al., Navigation and Mapping in Forest Environment Using Sparse Point Clouds",
          "P2": "Ouattara and Visala, LiDAR-odometry based UAV pose estimation in young forest environment",
          "P3": "Babin et al., Large-scale 3D Mapping of Subarctic Forests",
          "P4": "Faitli, Robotics Approach in Mobile Laser Scanning"}
INTRODUCTION = ("These pages show the figures of the papers, drawn from runs of this program on simulated recordings. "
                "Sites, lidars and receivers follow the papers; the trees and the errors are simulated. "
                "So curves compare in kind, not point by point. A figure of a short stretch hardly shows drift or "
                "closed loops; only whole recordings compare with the numbers of the papers.")


@dataclass
class Entry:
    """What the pages say of one figure."""

    key: str
    title: str
    recordings: str
    paper: str
    ours: str
    numbers: list
    picture: str
    table: str


def save_entry(folder, entry):
    (folder / f"{entry.key}.json").write_text(json.dumps(asdict(entry), indent=1))


def entries_in(folder, keys):
    """The figures of a folder that are drawn, in the order of `keys`."""
    files = [folder / f"{key}.json" for key in keys]
    return [Entry(**json.loads(file.read_text())) for file in files if file.exists()]


def write_html(folder, entries):
    parts = [f"<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>The papers' figures</title>"
             f"<style>{STYLE}</style></head><body><h1>The papers' figures, from runs of ours</h1>"
             f"<p>{INTRODUCTION}</p><p>{html.escape(version())}</p><ul>"]
    parts += [f"<li><b>{key}</b>: {html.escape(text)}</li>" for key, text in PAPERS.items()]
    parts.append("</ul><p>" + " ".join(f"<a href=\"#{e.key}\">{e.key}</a>" for e in entries) + "</p>")
    for e in entries:
        picture = base64.b64encode((folder / e.picture).read_bytes()).decode()
        words = {"The paper": e.paper, "Ours": e.ours, "Recordings": e.recordings, "Values": e.table}
        rows = "".join(f"<tr><th>{name}</th><td>{html.escape(text)}</td></tr>" for name, text in words.items())
        numbers = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
                          for row in e.numbers)
        parts.append(f"<h2 id=\"{e.key}\">{e.key}: {html.escape(e.title)}</h2>"
                     f"<img alt=\"{html.escape(e.title)}\" src=\"data:image/png;base64,{picture}\">"
                     f"<table>{rows}</table><table><tr><th>Number</th><th>ours</th><th>the paper's</th></tr>"
                     f"{numbers}</table>")
    (folder / "index.html").write_text("\n".join(parts) + "</body></html>\n")


def section(entry, pictures):
    """What the Markdown page says of one figure."""
    lines = [f"## {entry.key}: {entry.title}", f"![{entry.key}: {entry.title}]({pictures}/{entry.picture})", "",
             f"- **The paper**: {entry.paper}", f"- **Ours**: {entry.ours}", f"- **Recordings**: {entry.recordings}", "",
             "| number | ours | the paper's |", "|---|---|---|"]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in entry.numbers)])


def sections_of(page):
    """The sections of a Markdown page that `markdown` made, by the figures' keys."""
    parts = [part.strip() for part in ("\n" + page).split("\n## ")[1:]]
    return {part.split(":")[0]: "## " + part for part in parts}


def markdown(entries, pictures, keys, old=""):
    """The text of the Markdown page; `pictures` is the folder of the pictures as seen from the page. Figures that the
    page has already (`old`) and that are not among the entries stay as they are. The order is that of `keys`."""
    head = ["# The papers' figures, from runs of ours", INTRODUCTION, "",
            "    ./run accuracy --figures -o FIGURES            # all, from whole recordings",
            "    ./run accuracy --figures -o FIGURES --short    # minutes instead of hours",
            "    ./run accuracy --figures -o FIGURES --only P2-F4,P2-F6", "",
            "The folder then holds this page as `index.html`, the pictures, and the values of each as a CSV file. Runs that",
            "are there are not made again. With `--write` the figures of the folder replace those of this page.", "",
            f"{version()}. P1 to P4 are the papers of [this list](papers.md)."]
    sections = sections_of(old) | {entry.key: section(entry, pictures) for entry in entries}
    return "\n\n".join(["\n".join(head), *(sections[key] for key in keys if key in sections)]) + "\n"
