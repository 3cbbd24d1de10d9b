"""References in the repository can be followed: links, citations, and the benchmark's pages."""

from __future__ import annotations

import io
import math
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from sim_bridge.colors import COLORS, SEEN_PALETTE, UNSEEN_PALETTE
from sim_bridge.objects.kit_shapes import KIT_SHAPES
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.tasks import ALIASES, TASKS, make_task
from sim_bridge.tasks.adaptations import ADAPTATIONS

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("calibration/*.md")])
LONGEST = 140  # characters of a line
SOURCE_SUFFIXES = (".py", ".yaml", ".js", ".html", ".msg", ".srv", ".action", ".sh")
_COMMENT_MARK = re.compile(r"^\s*(#|//|\*)\s?", re.MULTILINE)
_TITLE = r'"([^"]+)"'
_CITATION = re.compile(rf"docs/([\w-]+\.md)((?:, {_TITLE}(?:(?:,| and) {_TITLE})*)?)")
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_MODULE = re.compile(r"`([a-z_]+(?:/[\w-]+)+\.(?:py|yaml|csv|action))`")
# A document that readers of the repository do not have, or a section of one that is not named.
_UNAVAILABLE = re.compile(
    r"\bspecifications?\b"
    r"|\btasks?[_ ]spec\b"
    r"|\b(?:spec|seed),? ?(?:§|sections?\b|figs?\.)"
    r"|\(seed, [A-I]\b"
    r"|§"
    r"|(?<!paper, )(?<!paper's )\bappendix [A-I]\b"
    r"|(?<!paper, )(?<!paper's )\bsections? \d",
    re.IGNORECASE,
)


def _source_files() -> list[Path]:
    folders = [ROOT / name for name in ("src", "tests", "tools", "calibration")]
    files = [path for folder in folders for path in folder.rglob("*") if path.suffix in SOURCE_SUFFIXES]
    return sorted(path for path in files if path != Path(__file__).resolve() and path.is_file())


@cache
def _prose(path: Path) -> str:
    """What a file says to people, on one line: of Python its comments and strings, of others everything."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        wanted = {tokenize.COMMENT, tokenize.STRING}
        wanted |= {getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING)}
        tokens = tokenize.generate_tokens(io.StringIO(text).readline)
        text = "\n".join(token.string for token in tokens if token.type in wanted)
    return " ".join(_COMMENT_MARK.sub("", text).split())


@cache
def _titles(page: Path) -> tuple[str, ...]:
    return tuple(line.lstrip("#").strip() for line in page.read_text(encoding="utf-8").splitlines() if line[:1] == "#")


def _anchor(title: str) -> str:
    """The anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def _missing_citations(text: str) -> Iterator[str]:
    """Citations of pages and sections in a text that do not exist."""
    for match in _CITATION.finditer(text):
        name, titles = match[1], re.findall(_TITLE, match[2])
        page = ROOT / "docs" / name
        if not page.is_file():
            yield f"docs/{name}"
        else:
            yield from (f'docs/{name}, "{title}"' for title in titles if title not in _titles(page))


@pytest.mark.parametrize(
    ("text", "missing"),
    [
        ('docs/benchmark.md, "Scores" and "The expert".', []),
        ('docs/benchmark.md, "Scores" and "No such title".', ['docs/benchmark.md, "No such title"']),
        ("see docs/no_such_page.md", ["docs/no_such_page.md"]),
    ],
)
def test_a_citation_of_nothing_is_noticed(text: str, missing: list[str]) -> None:
    assert list(_missing_citations(text)) == missing


def test_citations_in_the_code_exist() -> None:
    missing = {str(path.relative_to(ROOT)): list(_missing_citations(_prose(path))) for path in _source_files()}
    assert not {path: names for path, names in missing.items() if names}


def test_code_cites_the_benchmark_and_the_paper() -> None:
    cited = {match[1] for path in _source_files() for match in _CITATION.finditer(_prose(path)) if match[2]}
    assert cited >= {"benchmark.md", "paper.md"}


@pytest.mark.parametrize(
    "text",
    [
        "(task specification, section 3)",
        "(spec, section 9.5)",
        "Spec, sections 9.2 and 9.3",
        "(seed §D)",
        "(seed, section E)",
        "(seed, B)",
        "(appendix D)",
    ],
)
def test_unavailable_sources_are_noticed(text: str) -> None:
    assert _UNAVAILABLE.search(text)


@pytest.mark.parametrize("text", ["(paper, appendix D)", "(paper, section 4.3)", "the same seed, another scene"])
def test_available_sources_are_not(text: str) -> None:
    assert not _UNAVAILABLE.search(text)


def test_no_source_is_cited_that_readers_lack() -> None:
    found = {
        str(path.relative_to(ROOT)): [match[0] for match in _UNAVAILABLE.finditer(_prose(path))]
        for path in _source_files()
    }
    assert not {path: words for path, words in found.items() if words}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    for target in _LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        linked = (page.parent / file).resolve() if file else page
        assert linked.exists(), f"{page.name}: {target}"
        if anchor:
            assert anchor in [_anchor(title) for title in _titles(linked)], f"{page.name}: {target}"


def _long_lines(page: Path) -> list[int]:
    """Numbers of the lines too long for a window beside another; Markdown has no way to wrap a table's row."""
    may_be_long = "|" if page != ROOT / "README.md" else "no line may"
    lines = page.read_text(encoding="utf-8").splitlines()
    return [n for n, line in enumerate(lines, 1) if len(line) > LONGEST and not line.startswith(may_be_long)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_line_is_too_long_to_read(page: Path) -> None:
    assert not _long_lines(page), f"{page.name}: longer than {LONGEST}"


def test_long_lines_are_noticed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"{'a' * LONGEST}\n{'b' * (LONGEST + 1)}\n| {'c' * LONGEST} |\n", encoding="utf-8")
    assert _long_lines(page) == [2]


@pytest.mark.parametrize("page", ["README.md", "ARCHITECTURE.md"])
def test_the_pages_about_sources_are_linked(page: str) -> None:
    targets = _LINK.findall((ROOT / page).read_text(encoding="utf-8"))
    assert {"docs/benchmark.md", "docs/paper.md", "docs/glossary.md"} <= set(targets)


@pytest.mark.parametrize("name", ["benchmark.md", "paper.md", "glossary.md"])
def test_modules_that_a_page_names_exist(name: str) -> None:
    modules = _MODULE.findall((ROOT / "docs" / name).read_text(encoding="utf-8"))
    assert modules
    there = {module: list((ROOT / "src").glob(f"*/{module}")) or (ROOT / module).is_file() for module in modules}
    assert all(there.values()), [module for module, found in there.items() if not found]


def _benchmark_page() -> str:
    return " ".join((ROOT / "docs/benchmark.md").read_text(encoding="utf-8").split())


def _rows(section: str) -> list[list[str]]:
    """Cells of the table in a section of the benchmark's page, without its head."""
    text = (ROOT / "docs/benchmark.md").read_text(encoding="utf-8").split(f"## {section}\n")[1].split("\n## ")[0]
    return [[cell.strip() for cell in row.split("|")[1:-1]] for row in re.findall(r"^\|.*\|$", text, re.MULTILINE)[2:]]


def test_colours_are_the_codes() -> None:
    page = {name: (tuple(map(int, rgb.split(","))), seen, unseen) for name, rgb, seen, unseen in _rows("Colours")}
    yes = {True: "yes", False: ""}
    assert list(page.items()) == [
        (name, (rgb, yes[name in SEEN_PALETTE], yes[name in UNSEEN_PALETTE])) for name, rgb in COLORS.items()
    ]


def test_kitting_shapes_are_the_codes() -> None:
    page = [(name, float(period.rstrip("°"))) for _, name, _, period in _rows("Kitting shapes")]
    assert page == [(shape.name, pytest.approx(math.degrees(shape.period))) for shape in KIT_SHAPES]


def test_step_limits_are_the_codes() -> None:
    text = (ROOT / "docs/benchmark.md").read_text(encoding="utf-8")
    limits = {}
    for section in text.split("\n### ")[1:]:
        steps = re.search(r"\bSteps: (\d+)", section)
        named = re.search(r"^- (?:Splits?|Task): (.*?)\n- On", section, re.DOTALL | re.MULTILINE)
        assert named, section[:40]
        if steps:
            limits |= {name: int(steps[1]) for name in re.findall(r"`([a-z-]+)`", named[1]) if name in TASKS}
    assert len(limits) >= 16
    assert limits == {name: make_task(name, "test").max_steps for name in limits}


@pytest.mark.parametrize("name", TASKS)
def test_every_task_is_described(name: str) -> None:
    page = _benchmark_page()
    assert f"`{name}`" in page
    task = make_task(name, "test")
    assert isinstance(task, GoalTask)
    assert f'"{task.done_sentence}"' in page


@pytest.mark.parametrize("alias", ALIASES)
def test_every_alias_is_described(alias: str) -> None:
    stem = re.sub(r"(seen-colors|unseen-colors|full)$", "…", alias).replace("un…", "…")
    assert f"`{stem}`" in _benchmark_page()


def test_adaptations_name_tasks_that_exist() -> None:
    without_set = {name.replace("-seen-google", "-google").replace("-unseen-google", "-google") for name in TASKS}
    names = {name for row in ADAPTATIONS for name in row.tasks.split(", ")} - {"all"}
    unknown = {name for name in names if not any(task.startswith(name) for task in {*TASKS, *without_set})}
    assert not unknown


def test_adaptations_differ_and_are_complete() -> None:
    assert len({(row.tasks, row.what) for row in ADAPTATIONS}) == len(ADAPTATIONS)
    assert all(row.what and row.why and row.effect for row in ADAPTATIONS)


def test_every_adaptation_has_its_row_beside_cliports_code() -> None:
    """And no row of the table is of an adaptation that is gone."""
    table = (ROOT / "docs/peers.md").read_text().split("## Tasks")[1].split("## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines() if line.startswith("| ")][
        1:
    ]
    assert [(row[0], *row[2:]) for row in rows] == [(each.tasks, each.what, each.effect) for each in ADAPTATIONS]
    assert all(row[1] and row[1] != row[2] for row in rows)
