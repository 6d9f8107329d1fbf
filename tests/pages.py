"""Pages: links lead somewhere, every page is reached, and commands, options and settings exist. No
sentence has more than 25 words, and pages for users name papers by their titles. The commands of a
guide work one after the other, and a long page begins with a list of its sections."""

import os
import re
import subprocess
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent
PROGRAM = os.environ["UNDERSTORY_PROGRAM"]
LONGEST_SENTENCE = 25
LONGEST_WITHOUT_LIST = 1500  # words of a page
wrong = []


def anchors(page):
    """Of its headings, as code hosts make them."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(), re.M)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def linked(page):
    """Pages that a page links to."""
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        found = (page.parent / name).resolve() if name else page
        if not found.exists():
            wrong.append(f"{page.relative_to(TOP)}: {target} is not there")
        elif anchor and found.suffix == ".md" and anchor not in anchors(found):
            wrong.append(f"{page.relative_to(TOP)}: {target} has no such heading")
        elif found.is_dir():
            yield from sorted(found.glob("*.md"))
        elif found.suffix == ".md":
            yield found


def reached_from(first):
    seen, todo = set(), [first]
    while todo:
        page = todo.pop()
        if page not in seen:
            seen.add(page)
            todo += linked(page)
    return seen


def printed(*words):
    done = subprocess.run([PROGRAM, *words], capture_output=True, text=True, check=True)
    return done.stdout


def keys_of(*words, option="--print-config"):
    path, keys = [], set()
    for line in printed(*words, option).splitlines():
        found = re.match(r"( *)(\w+):", line)
        path = path[:len(found[1]) // 2] + [found[2]]
        keys.add(".".join(path))
    return keys


def commands(page):
    """Command lines of the program in a page, one word list each."""
    for line in page.read_text().splitlines():
        found = re.match(r"    (?:build/)?understory (.*?)(?:  +#.*)?$", line)
        if found:
            yield found[1].replace("'", "").split()


def commands_in_sentences(page):
    """Those between back quotes, which a line may break."""
    text = re.sub(r"^    .*$", "", page.read_text(), flags=re.M)
    for found in re.findall(r"`(?:build/)?understory\s+([a-z][^`]*)`", text):
        yield re.sub(r"[\[\]]|\|\S+", "", found).split()


def check_command(page, words, helps, keys):
    command = words[0]
    if command not in helps:
        wrong.append(f"{page.name}: no command {command}")
        return
    # What names the folder to write is a whole command, and no mere mention of an option.
    lacks = needed[command] - set(words) if "-o" in words else set()
    wrong.extend(f"{page.name}: {' '.join(words)}: lacks {option}" for option in sorted(lacks))
    for at, word in enumerate(words):
        if word.startswith("--") and word not in helps[command]:
            wrong.append(f"{page.name}: {command} has no option {word}")
        if word == "--set":
            name = command + (" by stems" if "sparse" in words else "")
            key = words[at + 1].split("=")[0]
            if key not in keys[name]:
                wrong.append(f"{page.name}: {name} has no key {key}")


def text_of(page):
    """Without code; of the changes, those of the newest version."""
    text = page.read_text()
    if page.name == "CHANGELOG.md":
        text = text.split("\n## ")[1]
    return re.sub(r"^    .*$|<!--.*?-->", "", text, flags=re.M)


def sentences(text):
    """A heading, an item of a list and a cell of a table end a sentence; colon and semicolon do not."""
    text = re.sub(r"^(#+ .*)$", r"\n\1\n", text, flags=re.M)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[-*] |\d+\. |\|))|\|", text):
        yield from re.split(r"(?<=[.!?])[*)\"]*\s+", " ".join(block.split()))


def words_of(sentence):
    plain = re.sub(r"\]\([^)]*\)", "", sentence)
    return [word for word in plain.split() if re.search(r"[A-Za-z]", word)]


first = TOP / "README.md"
reached = reached_from(first)
pages = {first, *(TOP / "docs").rglob("*.md"), TOP / "ARCHITECTURE.md", TOP / "CONTRIBUTING.md"}
wrong += [f"{page.relative_to(TOP)}: no page leads to it" for page in sorted(pages - reached)]

names = re.findall(r"^  ([a-z]+) ", printed("--help").split("Subcommands:")[1], re.M)
helps = {name: printed(name, "--help") for name in names}
needed = {name: set(re.findall(r"^  (--\S+) .*\bREQUIRED", text, re.M)) for name, text in helps.items()}
assert "--method" in needed["georeference"], needed
helps["help"], needed["help"] = "", set()
helps["evaluate"] += printed("evaluate", "trees", "--help") + printed("evaluate", "map", "--help")
helps["calibrate"] += printed("calibrate", "lidars", "--help")
keys = {"map": keys_of("map"), "map by stems": keys_of("map", "--front-end", "sparse"),
        "correct": keys_of("correct"), "inventory": keys_of("inventory"), "register": keys_of("register")}
guides = sorted((TOP / "docs" / "guides").glob("*.md"))
assert len(guides) >= 5, guides
checked = 0
for page in [first, *guides, *sorted((TOP / "docs" / "reference").glob("*.md"))]:
    for words in commands(page):
        check_command(page, words, helps, keys)
        checked += 1
    for words in commands_in_sentences(page):
        check_command(page, words, helps, keys)
        checked += 1
assert checked > 60, checked

# A folder that holds a run is refused: two commands of a guide never write the same one.
for page in guides:
    written = [words[words.index("-o") + 1] for words in commands(page) if "-o" in words]
    wrong += [f"{page.name}: two commands write {name}" for name in set(written) if written.count(name) > 1]

# What a page says before its first section leads to all of them.
for page in sorted((TOP / "docs" / "reference").glob("*.md")):
    before, *sections = re.split(r"^## ", page.read_text(), flags=re.M)
    if len(page.read_text().split()) < LONGEST_WITHOUT_LIST:
        continue
    for section in sections:
        head = section.split("\n", 1)[0].lower()
        anchor = re.sub(r"[^\w\- ]", "", head).replace(" ", "-")
        if f"](#{anchor})" not in before:
            wrong.append(f"{page.name}: its beginning does not lead to the section {head}")

counted = 0
for page in sorted(pages | {TOP / "CHANGELOG.md"}):
    for sentence in sentences(text_of(page)):
        counted += 1
        if len(words_of(sentence)) > LONGEST_SENTENCE:
            wrong.append(f"{page.relative_to(TOP)}: {len(words_of(sentence))} words: {sentence}")
assert counted > 3000, counted

# P0 to P4 are keys of docs/method: a user meets the papers by their titles, without their equations.
for page in [first, *guides, *sorted((TOP / "docs" / "reference").glob("*.md"))]:
    for found in re.finditer(r"\bP[0-4]\b.{0,20}", text_of(page)):
        wrong.append(f"{page.relative_to(TOP)}: a paper without its title: {found[0]}")

# So do help texts and the meanings of settings.
said = {f"{name} --help": text for name, text in helps.items()}
for words in (["map"], ["map", "--front-end", "sparse"], ["correct"], ["inventory"], ["register"]):
    said[" ".join(words) + " --print-config"] = printed(*words, "--print-config")
for where, text in said.items():
    for found in re.finditer(r"\bP[0-4]\b.{0,20}|.{0,20}[ (]\(\d+\)", text):
        wrong.append(f"{where}: a paper without its title, or an equation: {found[0]}")

# Abbreviations of the pages that are read first are in the glossary. These are names of a maker and of a file.
NAMES = {"AMD", "LICENSE", "RUN", "RECORDING"}
glossary = (TOP / "docs" / "reference" / "terms.md").read_text()
for page in [first, *guides]:
    plain = re.sub(r"`[^`]*`|\]\([^)]*\)", "", text_of(page))
    for word in sorted(set(re.findall(r"(?<![\w.-])[A-Z][A-Z0-9]+(?![\w-])", plain)) - NAMES):
        if not re.search(rf"\b{word}\b", glossary):
            wrong.append(f"{page.relative_to(TOP)}: {word} is not in the glossary")

# Settings (their last parts do) and kinds of warnings that a page names exist.
FILES = r"csv|gz|tum|json|html|laz|las|tif|gpkg|yaml|mcap|md|h|cc|py|pcap|nmea|qgs|txt|sh|bin|g2o|truth|sensor"
troubleshooting = (TOP / "docs" / "reference" / "troubleshooting.md").read_text()
warnings = set(re.findall(r"\b[a-z]+\.[a-z_]+\b", " ".join(re.findall(r"^\| ([a-z_., ]+) \|", troubleshooting, re.M))))
every = set().union(*keys.values(), keys_of("simulate", "handheld", option="--print-site"))
ends = {".".join(parts[k:]) for parts in (key.split(".") for key in every) for k in range(len(parts))}
for page in sorted(pages):
    for name in re.findall(r"`([a-z_]+(?:\.[a-z_0-9]+)+)[=`:]", page.read_text()):
        if name not in ends | warnings and not re.search(rf"\.({FILES})$|^python\.", name):
            wrong.append(f"{page.relative_to(TOP)}: no setting and no warning {name}")

# The settings that a page lists in tables, first column, exist.
settings = TOP / "docs" / "reference" / "configuration.md"
listed = re.findall(r"^\| ([a-z_]+(?:\.[a-z_]+)+) \|", settings.read_text(), re.M)
assert len(listed) >= 40, len(listed)
wrong += [f"{settings.name}: no key {key}" for key in listed if key not in keys["map"] | keys["map by stems"] | keys["inventory"]]
assert not wrong, "\n".join(wrong)
print(f"{len(reached)} pages, {counted} sentences, {checked} commands")
