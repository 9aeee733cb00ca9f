"""Each source that is cited is in .github/REFERENCES.bib; each document that is named is here.

The rules are plain functions of a text, so that each is also shown to find what is planted.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from flexspline.effects import CATALOGUE

ROOT = Path(__file__).parents[2]
BIBLIOGRAPHY = ".github/REFERENCES.bib"
PLACES = (".github", ".ci", "cpp", "notebooks", "python/flexspline", "src", "tests")
NOT_TEXT = {".svg", ".so", ".pyc", ".typed", ".mypy_cache"}
BUILT = {"__pycache__", "python/flexspline/include", "python/flexspline/lib"}
COMMON = {"time_drift", "motor_crosstalk", "sensor_lag"}  # what every data sheet or book has

KEY = re.compile(r"\[([A-Z][A-Za-z-]*(?:1[6-9]|20)\d\d)\]")
PLACE = r"(?:\(\d|§|Figs?\. \d|Table [IVX\d])"  # in a paper
SLUG = re.compile(rf"\b([a-z]+(?:_[a-z]+){{2,}}) {PLACE}")
NAME = r"[A-ZÀ-Ž][a-zà-ž]+(?:-[A-ZÀ-Ž]?[a-zà-ž]+)?"
LOOSE = re.compile(rf"\b({NAME})((?:,| &| and| et al\.)(?: {NAME})?)* \(?((?:1[6-9]|20)\d\d)\b")
MONTHS = re.compile(r"(?:Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|Nov|Dec)[a-z]*$")
SOURCE = re.compile(r"std::string_view source =\s*\"[^\"]*\"")
BROKEN_LINE = re.compile(r"(?:\\n\",?)?\n[ \t]*(?://+|#+|\")?[ \t]*")
DOCUMENT = re.compile(r"(?<![\w/.{}-])((?:\.\./)*(?:[\w.-]+/)*[\w-]+\.(?:md|bib|pdf))\b")
SHARED = re.compile(r"\bshared/\w+")


def read(text: str) -> dict[str, dict[str, str]]:
    """Return fields by key; one field in a line, in braces that close in it, nothing else."""
    entries: dict[str, dict[str, str]] = {}
    fields: dict[str, str] | None = None
    for number, line in enumerate(text.splitlines(), 1):
        head = re.fullmatch(r"@[a-z]+\{([A-Za-z0-9_-]+),", line)
        field = re.fullmatch(r"  ([a-z]+) = \{(.+)\},", line)
        if fields is None and head and head[1] not in entries:
            fields = entries[head[1]] = {}
        elif fields is not None and field and field[1] not in fields and _closed(field[2]):
            fields[field[1]] = field[2]
        elif fields is not None and line == "}":
            fields = None
        elif fields is not None or (line and not line.startswith("%")):
            raise ValueError(f"line {number} is not of the form of the others: {line}")
    if fields is not None:
        raise ValueError("the last entry does not end")
    return entries


def _closed(value: str) -> bool:
    depth = 0
    for letter in value:
        depth += (letter == "{") - (letter == "}")
        if depth < 0:
            return False
    return depth == 0


def key_of(fields: dict[str, str]) -> str:
    """Family names of one or two authors, of more the first, in ASCII, and the year."""
    families = [author.partition(",")[0] for author in fields["author"].split(" and ")]
    name = "".join(families if len(families) < 3 else families[:1])
    for letter, ascii_letters in {"ü": "ue", "æ": "ae", "ø": "o"}.items():
        name = name.replace(letter, ascii_letters)
    name = unicodedata.normalize("NFKD", name)
    return "".join(c for c in name if c.isascii() and c.isalpha()) + fields["year"]


def entry_faults(entries: dict[str, dict[str, str]]) -> Iterator[str]:
    """What is wrong with each entry by itself."""
    for key, fields in entries.items():
        for name in ("author", "title", "year"):
            if name not in fields:
                yield f"{key} has no {name}"
        if not fields.keys() & {"doi", "url"} and "No DOI or URL" not in fields.get("note", ""):
            yield f"{key} has neither DOI nor URL, and no note that says so"
        if "doi" in fields and not re.fullmatch(r"10\.\d{4,5}/\S+", fields["doi"]):
            yield f"{key} has a DOI that is none"
        if "url" in fields and not fields["url"].startswith("https://"):
            yield f"{key} has a URL that is none"
        if not re.fullmatch(r"(?:1[6-9]|20)\d\d", fields.get("year", "2000")):
            yield f"{key} has a year that is none"
        # An organisation's entry is keyed by what it is called for short.
        corporate = fields.get("author", "{").startswith("{")
        if key[0].isupper() and not corporate and "year" in fields and key != key_of(fields):
            yield f"{key} should be {key_of(fields)}"


def text_faults(
    text: str, entries: dict[str, dict[str, str]], documents: set[str]
) -> Iterator[str]:
    """What a text cites that is not in the bibliography, or names that is not in the repository."""
    joined = BROKEN_LINE.sub(" ", SOURCE.sub("", text))
    for key in KEY.findall(joined) + SLUG.findall(joined):
        if key not in entries:
            yield f"cites {key}, which is not in {BIBLIOGRAPHY}"
    for found in LOOSE.finditer(joined):
        if not MONTHS.match(found[1]):
            yield f"cites '{found[0]}' without a key of {BIBLIOGRAPHY}"
    for slug in (key for key in entries if key[0].islower()):
        first, second, *_ = slug.split("_")
        for found in re.finditer(rf"\b{first}(?:_{second})? {PLACE}", joined, re.IGNORECASE):
            yield f"cites '{found[0]}' by half a key; write {slug}"
    yield from document_faults(text, documents)


def document_faults(text: str, documents: set[str]) -> Iterator[str]:
    """What files a text names that are not in the repository."""
    for name in DOCUMENT.findall(text):
        bare = name.removeprefix("flexspline/")  # where it is installed
        while bare.startswith("../"):
            bare = bare.removeprefix("../")
        if not any(path == bare or path.endswith("/" + bare) for path in documents):
            yield f"names {name}, which is not in the repository"
    for path in SHARED.findall(text):
        if path != "shared/data" or "FLEXSPLINE_DATA" not in text:
            yield f"names {path}, which is not in the repository"


def texts() -> dict[str, str]:
    """The repository's texts by path, but for this file and the bibliography."""
    every = [path for path in ROOT.iterdir() if path.is_file() and not path.name.startswith(".")]
    every += [p for place in PLACES for p in (ROOT / place).rglob("*") if p.is_file()]
    found = {}
    for path in every:
        name = path.relative_to(ROOT).as_posix()
        built = any(f"/{part}/" in f"/{name}/" for part in BUILT)
        if path.suffix not in NOT_TEXT and not built and path.resolve() != Path(__file__).resolve():
            found[name] = path.read_text(encoding="utf-8", errors="replace")
    del found[BIBLIOGRAPHY]
    return found


TEXTS = texts()
ENTRIES = read((ROOT / BIBLIOGRAPHY).read_text(encoding="utf-8"))
DOCUMENTS = {path for path in (*TEXTS, BIBLIOGRAPHY) if path.endswith((".md", ".bib", ".pdf"))}


def keys_of_source(source: str) -> set[str]:
    """Entries that the source of an effect means: by key, or by first author and year."""
    made = {key for key in ENTRIES if key[0].islower() and key in source}
    for name, _, year in LOOSE.findall(source):
        made |= {key for key, f in ENTRIES.items() if f["author"].startswith(f"{name},")
                 and f["year"] == year}  # fmt: skip
    return made


def test_each_entry_has_author_title_year_and_a_place_where_it_is_found() -> None:
    assert list(entry_faults(ENTRIES)) == []


def test_no_text_cites_or_names_what_is_not_here() -> None:
    faults = [f"{path} {fault}" for path, text in TEXTS.items()
              for fault in text_faults(text, ENTRIES, DOCUMENTS)]  # fmt: skip
    assert faults == []


@pytest.mark.parametrize("place", ["README.md", *PLACES])
def test_texts_of_every_place_are_looked_at(place: str) -> None:
    assert any(f"{path}/".startswith(f"{place}/") for path in TEXTS)


def test_each_effect_has_a_source_in_the_bibliography_or_is_common_knowledge() -> None:
    without = {name for name, info in CATALOGUE.items() if not keys_of_source(info.source)}
    assert without == COMMON


def uncited(entries: Iterable[str], texts: Iterable[str]) -> set[str]:
    """Entries that neither a text nor the source of an effect cites."""
    cited = {key for info in CATALOGUE.values() for key in keys_of_source(info.source)}
    for text in texts:
        cited.update(KEY.findall(text))
        cited.update(key for key in entries if key[0].islower() and key in text)
    return set(entries) - cited


def test_each_entry_is_cited_somewhere() -> None:
    assert uncited(ENTRIES, TEXTS.values()) == set()


def test_an_entry_that_nobody_cites_is_found() -> None:
    planted = {**ENTRIES, "Nobody1999": {}, "nobody_writes_papers": {}}
    assert uncited(planted, TEXTS.values()) == {"Nobody1999", "nobody_writes_papers"}
    assert uncited(planted, [*TEXTS.values(), "[Nobody1999], nobody_writes_papers (3)"]) == set()


@pytest.mark.parametrize(
    ("planted", "fault"),
    [
        ('"""Source: [Nobody1999], chapter 3."""', "cites Nobody1999"),
        ("/// Source: nobody_writes_papers (3).", "cites nobody_writes_papers"),
        ("# as in nobody_writes_papers §2", "cites nobody_writes_papers"),
        (
            '"""The largest of them (Davies 1987)."""',
            "cites 'Davies 1987' without",
        ),
        ("/// Source: Olsson et al.\n/// 1998.", "cites 'Olsson et al. 1998' without"),
        ("# Huber & Ronchetti 2009", "cites 'Huber & Ronchetti 2009' without"),
        ('    "Turlapati et al. (2024) turn\\n",', "cites 'Turlapati et al. (2024' without"),
        ("# the line of zhang (25)", "write zhang_disturbance_elimination"),
        ("# Turlapati §3.1", "write turlapati_intrinsic_dynamics"),
        ("# full_range Table III", "write full_range_torque_estimation"),
        ("# Channels as in `spec/log_format.md`.", "names spec/log_format.md"),
        ("# (effects.md)", "names effects.md"),
        ("% see ../papers/zhang.pdf", "names ../papers/zhang.pdf"),
        ("# the logs of ../shared/data", "names shared/data"),
        ("# FLEXSPLINE_DATA and shared/spec", "names shared/spec"),
    ],
)
def test_what_is_planted_in_a_file_is_found(tmp_path: Path, planted: str, fault: str) -> None:
    file = tmp_path / "planted.py"
    file.write_text(f"x = 1\n{planted}\n", encoding="utf-8")
    found = list(text_faults(file.read_text(encoding="utf-8"), ENTRIES, DOCUMENTS))
    assert len(found) == 1 and fault in found[0], found


@pytest.mark.parametrize(
    "sound",
    [
        "/// Source: [Davies1987], section 2; zhang_disturbance_elimination (25), Fig. 18.",
        '  static constexpr std::string_view source = "Olsson et al. 1998, Friction models";',
        "# since November 2021; a = list[2000]; see README.md and cpp/firmware/README.md",
        'os.environ.get("FLEXSPLINE_DATA", "../../shared/data")',
    ],
)
def test_what_is_sound_is_left_alone(sound: str) -> None:
    assert list(text_faults(sound, ENTRIES, DOCUMENTS)) == []


ENTRY = """@book{Higham2002,
  author = {Higham, Nicholas J.},
  title = {Accuracy and stability of numerical algorithms},
  year = {2002},
  doi = {10.1137/1.9780898718027},
}
"""


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ("  author = {Higham, Nicholas J.},\n", "", "has no author"),
        ("  title = {Accuracy and stability of numerical algorithms},\n", "", "has no title"),
        ("  year = {2002},\n", "", "has no year"),
        ("  doi = {10.1137/1.9780898718027},\n", "", "neither DOI nor URL"),
        ("10.1137/", "1137/", "a DOI that is none"),
        ("doi = {10.1137/1.9780898718027}", "url = {www.siam.org}", "a URL that is none"),
        ("{2002}", "{unknown}", "a year that is none"),
        ("{Higham2002,", "{Higham1996,", "should be Higham2002"),
    ],
)
def test_a_faulty_entry_is_found(old: str, new: str, fault: str) -> None:
    assert list(entry_faults(read(ENTRY))) == []
    assert any(fault in found for found in entry_faults(read(ENTRY.replace(old, new, 1))))


@pytest.mark.parametrize(
    "broken",
    [
        ENTRY + ENTRY,  # a key twice
        ENTRY[:-2],  # no end
        ENTRY.replace("},", "}", 1),  # no comma
        ENTRY.replace("{Higham, ", "{{Higham, "),  # a brace left open
    ],
)
def test_a_bibliography_of_another_form_is_refused(broken: str) -> None:
    with pytest.raises(ValueError):
        read(broken)
