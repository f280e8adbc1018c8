#!/usr/bin/env python3
"""Checks the words of code and documents.

(a) The codes of the methods stand in docs/reference/methods.md and in tests, and nowhere else.
(b) A comment or a document names only files that the tree has.
(c) Words that the project has retired do not occur in comments, string literals and documents.

usage: words_test.py SOURCE_FOLDER [--count | --list PREFIX]
  --count        prints the number of hits of (a) and (c) of every room
  --list PREFIX  prints these hits of the files below PREFIX
"""
import bisect
import collections
import pathlib
import re
import sys

ROOMS = ("geometry", "io", "partition", "match", "adjust", "merge", "cluster", "tests", "docs", "examples", "cmake")
CODES = re.compile(r"\bT?(?:CN|KP|CP|AT|KL)-?[0-9]+|\bM[0-9]{1,2}\b")
CODES_IN_TEXT = re.compile(r"\bT?(?:CN|KP|CP|AT|KL)-?[0-9]+")  # a string literal may hold an SVG path, "M0 0"
CODES_ALLOWED = ("docs/reference/methods.md", "tests/")

# (word, what to say instead, contexts in which it is ordinary English)
WORDS = [
    (r"\bpictures?\b", "image", r"(with|as|draws?|see|this) (a|an|the) picture\b|picture \(SVG"),
    (r"\bphotos?\b", "image", r"Exif\.Photo|\"photo\""),
    (r"\bstations?\b", "frame", r"scan(ner)? stations?|(base|total|reference|weather) stations?"),
    (r"\bstrays?\b", "outlier", None),
    (r"\bsights?\b", "observation", r"(in|out of|at first|lines? of) sight"),
    (r"\bwrong (observations?|measurements?)\b", "outlier", None),
    (r"\bagreeing (observations?|measurements?|matches|points|rays)\b", "inlier", None),
    (r"\btie[- ]point measurements?\b|\bmeasurements? of (a |the )?tie points?\b", "tie point observation",
     r"keeps \d+ of \d+ tie"),
    (r"\bboundary unknowns?\b", "separator unknowns", None),
    (r"\b(upward|downward)s? pass(es)?\b|\bpass(es)? (up|down)(ward|wards)?\b",
     "sweep up, sweep down", r"pass(es)? (up|down) (the )?(streets?|roads?)"),
    (r"\bpass(es)? over (the|all|its) (tiles?|tree)\b", "sweep", None),
    (r"\b(rounds|steps) of the (global adjustment|whole block|merge)\b", "iterations", None),
    (r"\bcells? of the partition\b", "tile", None),
    (r"\bwhat (a|its|the) child(ren)? pass(es)? up\b", "update", None),
    (r"\bthat which\b", "a noun", None),
    (r"\bboundary frames?\b", "separator frame", None),
    (r"\bsub-?blocks?\b", "model, tile", None),
]
WORDS = [(re.compile(word, re.IGNORECASE), say, re.compile(allowed, re.IGNORECASE) if allowed else None)
         for word, say, allowed in WORDS]

FILE = re.compile(r"(?<![\w./<*{-])[\w./-]+\.(?:h|cpp|py|md)\b(?![\w/*(-])")
PLACEHOLDER = re.compile(r"\b(NAME|FILE|ROOM|FOLDER|SUITE)\b|[A-Z]{3,}_test|<|\*")

source = pathlib.Path(sys.argv[1])
mode = sys.argv[2] if len(sys.argv) > 2 else ""


def files():
    """Every file of the project whose words are read."""
    for room in ROOMS:
        for path in sorted((source / room).rglob("*")):
            if path.suffix in (".h", ".cpp", ".py", ".md", ".sh", ".txt", ".cmake"):
                yield path
    yield from sorted(source.glob("*.md"))
    yield source / "CMakeLists.txt"
    yield source / "get-started"


def cpp_pieces(text):
    """Comments and string literals of C++ with their offsets, and which they are."""
    comment = r"//[^\n]*(?:\n[ \t]*//[^\n]*)*|/\*.*?\*/"
    literal = r'R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"'
    token = re.compile(rf"{comment}|{literal}|^\s*#\s*include[^\n]*", re.DOTALL | re.MULTILINE)
    for match in token.finditer(text):
        found = match.group()
        if not found.lstrip().startswith("#"):
            yield match.start(), found, "comment" if found.startswith(("//", "/*")) else "literal"


def script_pieces(text):
    """Comments of Python, shell and CMake, and the documentation string of a Python file."""
    for match in re.finditer(r'"""(.*?)"""', text, re.DOTALL):
        yield match.start(), match.group(), "comment"
    for match in re.finditer(r"(?:^|\s)(#[^\n]*)", text):
        yield match.start(1), match.group(1), "comment"


def pieces(path, text):
    if path.suffix == ".md":
        return [(0, text, "document")]
    return cpp_pieces(text) if path.suffix in (".h", ".cpp") else script_pieces(text)


def blank(pattern, text):
    return re.sub(pattern, lambda match: re.sub(r"[^\n]", " ", match.group()), text, flags=re.DOTALL | re.MULTILINE)


def plain(text, kind):
    """The words alone: what is code, a path or an identifier is blanked out, so that offsets stay."""
    if kind == "document":
        text = blank(r"^```.*?^```|^(?: {4,}|\t)[^\n]*|`[^`\n]*`|\]\([^)\s]*\)", text)
    return blank(r"`[^`\n]*`|[\w.-]*[/_][\w./-]*", text)


def joined(text, kind):
    """Line breaks as blanks, so that a phrase may go over the end of a line."""
    if kind == "literal":
        return text
    return re.sub(r"\n[ \t]*//", lambda match: " " * len(match.group()), text).replace("\n", " ")


def hits_of(path, name, text, starts):
    """(line, message) of every code and retired word."""
    found = []
    if name == "CONTRIBUTING.md":  # its table names the retired words
        text = blank(r"^\|[^\n]*", text)
    for start, piece, kind in pieces(path, text):
        codes = CODES_IN_TEXT if kind == "literal" else CODES
        if not name.startswith(CODES_ALLOWED):
            for match in codes.finditer(piece):
                line = bisect.bisect_right(starts, start + match.start())
                found.append((line, f"the code {match.group()} belongs to docs/reference/methods.md"))
        words = joined(plain(piece, kind), kind)
        for pattern, say, allowed in WORDS:
            for match in pattern.finditer(words):
                around = words[max(0, match.start() - 24):match.end() + 24]
                if allowed and allowed.search(around):
                    continue
                line = bisect.bisect_right(starts, start + match.start())
                found.append((line, f"'{match.group()}': say {say}"))
    return found


def dead_names(path, text, starts, paths, names):
    """(line, message) of every file name in a comment or document that the tree does not have."""
    for start, piece, kind in pieces(path, text):
        if kind == "literal":
            continue
        for match in FILE.finditer(piece):
            name = match.group()
            if path.suffix == ".md" and text[text.rfind("\n", 0, start + match.start()) + 1:].startswith("    "):
                continue  # an example of the reader's own files
            if PLACEHOLDER.search(name) or "://" in piece[max(0, match.start() - 12):match.start()]:
                continue
            wanted = re.sub(r"^(\.\./|\./)+", "", name)
            known = wanted in names if "/" not in wanted else any(f"/{other}".endswith(f"/{wanted}") for other in paths)
            if not known and not wanted.startswith("shared/"):
                yield bisect.bisect_right(starts, start + match.start()), f"no such file: {name}"


all_files = list(dict.fromkeys(files()))
paths = {path.relative_to(source).as_posix() for path in all_files}
names = {path.name for path in all_files}
problems, count, read = [], collections.Counter(), 0
for path in all_files:
    name = path.relative_to(source).as_posix()
    if name == "tests/unit/words_test.py":
        continue
    text = path.read_text()
    starts = [0] + [match.end() for match in re.finditer("\n", text)]
    read += 1
    hits = hits_of(path, name, text, starts)
    room = name.split("/")[0] if not name.startswith("docs/") else "/".join(name.split("/")[:2])
    count[room] += len(hits)
    if mode == "--list" and name.startswith(sys.argv[3]):
        print("\n".join(f"{name}:{line}: {message}" for line, message in hits), end="\n" if hits else "")
    problems += [f"{name}:{line}: {message}" for line, message in hits]
    problems += [f"{name}:{line}: {message}" for line, message in dead_names(path, text, starts, paths, names)]

if mode == "--count":
    print("\n".join(f"{number:5d} {room}" for room, number in sorted(count.items())))
if mode != "--list":
    print("\n".join(problems) or f"the words of {read} files are as agreed")
    sys.exit(1 if problems or read < 100 else 0)
