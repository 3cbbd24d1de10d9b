"""Results that are there already: gone on with where the settings agree, and never overwritten where they do not."""

from pathlib import Path

import pytest

from cliport_benchmark import evaluate_cli
from cliport_benchmark.errors import DataFolderError
from cliport_benchmark.evaluate import EvaluateConfig
from cliport_benchmark.journal import Discarded, GraphEpisode, Journal
from cliport_benchmark.json_files import read_json, write_json
from cliport_benchmark.summary import summary
from cliport_core.source_state import source_state

SEEN = "put-blocks-in-bowls-seen-colors"
SCENES = [Discarded(1, "no place"), Discarded(2, "flew apart")]


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """Results of two scenes, as evaluate leaves them."""
    path = tmp_path / "results.json"
    settings = EvaluateConfig("expert", SEEN, "test", 1, 2).settings() | source_state().to_dict()
    write_json(path, summary(settings, list(SCENES)))
    return path


def evaluate(out: Path, *options: str) -> int:
    command = ["--checkpoint", "expert", "--task", SEEN, "--first-seed", "1", "--processes", "1", "--out", str(out)]
    return evaluate_cli.main([*command, *options])


def test_finished_scenes_are_not_run_again(out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = out.read_bytes()
    for count in ("1", "2"):
        assert evaluate(out, "--episodes", count) == 0
        assert f"{SEEN}: {out} is kept, with its 2 scenes" in capsys.readouterr().out
    assert out.read_bytes() == before
    settings = EvaluateConfig("expert", SEEN, "test", 1, 9).settings() | source_state().to_dict()
    assert list(Journal(out, settings).outcomes.values()) == SCENES


def test_a_line_that_a_kill_cut_off_is_forgotten(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "results.json", {"seeds": 3})
    journal.add(SCENES[0])
    written = journal.path.read_bytes()
    journal.path.write_bytes(written + b'{"seed": 2, "rea')
    again = Journal(tmp_path / "results.json", {"seeds": 3})
    again.add(SCENES[1])
    assert again.path.read_bytes().startswith(written) and len(again.path.read_bytes().splitlines()) == 3
    assert list(Journal(tmp_path / "results.json", {"seeds": 3}).outcomes.values()) == SCENES


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--split", "val"], "split test not val"),
        (["--first-seed", "2"], "first_seed 1 not 2"),
        (["--exact-offset"], "offset centred not exact"),
        (["--randomize", "light"], "randomize False not"),
    ],
)
def test_results_of_other_settings_are_not_overwritten(
    out: Path, options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = out.read_bytes()
    assert evaluate(out, "--episodes", "2", *options) == 1
    error = capsys.readouterr().err
    assert f"holds results of other settings ({words}" in error and error.count("\n") == 1
    assert out.read_bytes() == before


def test_reworded_results_are_other_results(out: Path) -> None:
    settings = EvaluateConfig("expert", SEEN, "test", 1, 2).settings() | source_state().to_dict()
    write_json(out, read_json(out) | {"wording": {"patterns": ["{block} {bowl}"], "synonyms": {}}})
    with pytest.raises(DataFolderError, match="wording"):
        Journal(out, settings)


def test_episodes_through_the_graph_come_back_as_they_were(tmp_path: Path) -> None:
    episode = GraphEpisode(3, 0.5, 2, ("first", "second"), "reached", 40.5)
    Journal(tmp_path / "graph.json", {"graph": True}).add(episode)
    assert Journal(tmp_path / "graph.json", {"graph": True}).outcomes == {3: episode}


def test_a_journal_that_never_began_is_removed_without_a_word(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "results.json", {"task": SEEN})
    journal.remove()
    journal.add(SCENES[0])
    assert [path.name for path in tmp_path.iterdir()] == ["results.episodes.jsonl"]
    journal.remove()
    assert not list(tmp_path.iterdir())
