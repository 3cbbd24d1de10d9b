"""Program `ros2 run demo_tool episodes`: list, show and edit recorded episodes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from cliport_core.command_line import CommandParser
from cliport_episodes.checks import check_episode
from cliport_episodes.contact_sheet import draw_contact_sheet
from cliport_episodes.data_set import DataSet, draw_statistics
from cliport_episodes.edits import MARKS, verdict_words
from cliport_episodes.errors import EpisodesError
from cliport_episodes.statistics import SQUARE
from cliport_episodes.summary import EpisodeInfo

Command = Callable[[DataSet, argparse.Namespace], "int | None"]
AddCommand = Callable[[str, Command, str], argparse.ArgumentParser]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0 when it succeeded and `check` found nothing, else 1, or 130 when interrupted."""
    options = _parser().parse_args(arguments)
    try:
        command: Command = options.do
        return command(DataSet.open(options.data_set), options) or 0
    except EpisodesError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:  # as in `… | head`
        sys.stderr.close()
        return 1
    except OSError as error:  # a folder or file that cannot be read
        print(f"error: {error.filename or options.data_set}: {error.strerror or error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted", file=sys.stderr)
        return 130


def _list(data_set: DataSet, options: argparse.Namespace) -> None:
    if options.trash:
        _say("\n".join(data_set.trashed()) or "the trash is empty")
        return
    infos = data_set.episodes()
    for info in infos:
        _say(_line(info))
        for complaint in info.complaints:
            _say(f"    ! {complaint}")
    size = sum(info.bytes for info in infos) / 1e6
    _say(f"{len(infos)} episodes, {sum(info.n_steps for info in infos)} steps, {size:.1f} MB")


def _line(info: EpisodeInfo) -> str:
    state = verdict_words(info.success) if info.finished else "unfinished"
    return f"{info.name}  {info.n_steps:3d} steps  {state:10s}  {' | '.join(info.instructions)}"


def _show(data_set: DataSet, options: argparse.Namespace) -> None:
    episode = data_set.episode(options.episode)
    for step in episode.steps:
        record, action = step.record, step.record.action
        _say(f"{record.step:3d}  {record.instruction}")
        _say(
            f"     {action.primitive.label}, {record.source.name.lower()}"
            f", pick ({action.pick.x:.3f}, {action.pick.y:.3f}) m, place ({action.place.x:.3f}, {action.place.y:.3f}) m"
            f", {record.ending}"
        )
    for complaint in episode.complaints:
        _say(f"    ! {complaint}")
    out = options.out or Path(f"{episode.name}.png")
    draw_contact_sheet(episode, out)
    _say(f"the steps are on {out}")


def _relabel(data_set: DataSet, options: argparse.Namespace) -> None:
    data_set.relabel(options.episode, options.text, options.step)


def _mark(data_set: DataSet, options: argparse.Namespace) -> None:
    for name in options.episodes:
        data_set.mark(name, MARKS[options.mark])


def _trim(data_set: DataSet, options: argparse.Namespace) -> None:
    data_set.trim(options.episode, options.first, options.last)


def _delete(data_set: DataSet, options: argparse.Namespace) -> None:
    for name in options.episodes:
        data_set.delete(name)
    _say(f"{len(options.episodes)} in the trash: `restore` brings them back, `empty-trash` removes them for good")


def _restore(data_set: DataSet, options: argparse.Namespace) -> None:
    for name in options.episodes:
        data_set.restore(name)


def _empty_trash(data_set: DataSet, _: argparse.Namespace) -> None:
    _say(f"{data_set.empty_trash()} episodes removed for good")


def _merge(data_set: DataSet, options: argparse.Namespace) -> None:
    for other in options.others:
        _say(data_set.merge(other).words(str(other)))


def _split(data_set: DataSet, options: argparse.Namespace) -> None:
    for made in data_set.split(options.parts, options.seed).values():
        _say(f"{made.name}: {len(made.episodes())} episodes")


def _stats(data_set: DataSet, options: argparse.Namespace) -> None:
    statistics = data_set.statistics()
    _say(f"{statistics.n_steps} steps in {statistics.n_episodes} episodes, {statistics.n_executed} of them executed")
    tables = {
        "episodes": statistics.success,
        "primitive": statistics.primitives,
        "chosen by": statistics.sources,
        "colour word": statistics.color_words,
        "instruction": statistics.instructions,
    }
    for title, counts in tables.items():
        for name, count in counts.items():
            _say(f"{title:12s} {count:5d}  {name}")
    for title, counts_at in (("picks in", statistics.picks), ("places in", statistics.places)):
        squares = statistics.squares(counts_at)
        _say(f"{title:12s} {(squares > 0).sum():5d}  of {squares.size} squares of {100 * SQUARE:.0f} cm")
    for line in statistics.biases():
        _say(f"! {line}")
    out = options.out or Path(f"{data_set.name}_statistics.png")
    draw_statistics(statistics, out)
    _say(f"the picture is {out}")


def _rebuild(data_set: DataSet, _: argparse.Namespace) -> None:
    _say(f"index of {len(data_set.rebuild_index())} episodes made from their bags")


def _check(data_set: DataSet, options: argparse.Namespace) -> int:
    amiss = 0
    for name in options.episodes or [info.name for info in data_set.episodes()]:
        found = check_episode(data_set.episode(name), data_set.setup)
        amiss += bool(found)
        _say(f"{name}  {'ok' if not found else ''}")
        for line in found:
            _say(f"    ! {line}")
    _say(f"{amiss} episodes with something amiss" if amiss else "nothing is amiss")
    return 1 if amiss else 0


def _say(text: str) -> None:
    """Print a text without control characters: a bag's content must not command the terminal."""
    print("".join(c if c.isprintable() or c in "\n\u200c\u200d\u3000" else "\ufffd" for c in text), flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="episodes", description="Look through recorded demonstrations, and edit them.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, do: Command, text: str) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(do=do)
        command.add_argument("data_set", type=Path, metavar="DATA_SET", help="folder with a dataset.yaml")
        return command

    _add_views(add)
    _add_edits(add)
    _add_data_set_commands(add)
    return parser


def _add_views(add: AddCommand) -> None:
    add("list", _list, "list the episodes").add_argument("--trash", action="store_true", help="those in the trash")
    command = add("show", _show, "print an episode's steps, and draw them on a sheet")
    command.add_argument("episode")
    command.add_argument("--out", type=Path, metavar="PNG", help="default: EPISODE.png here")


def _add_edits(add: AddCommand) -> None:
    command = add("relabel", _relabel, "give all steps, or one, another instruction")
    command.add_argument("episode")
    command.add_argument("text")
    command.add_argument("--step", type=int, metavar="N")
    command = add("mark", _mark, "say whether episodes show what was asked for")
    command.add_argument("mark", choices=sorted(MARKS))
    command.add_argument("episodes", nargs="+", metavar="episode")
    command = add("trim", _trim, "let only some steps count; without options, all again")
    command.add_argument("episode")
    command.add_argument("--first", type=int, metavar="N", help="number of the first step that counts")
    command.add_argument("--last", type=int, metavar="N", help="number of the last one")
    add("delete", _delete, "put episodes into the trash").add_argument("episodes", nargs="+", metavar="episode")
    add("restore", _restore, "take episodes out of the trash").add_argument("episodes", nargs="+", metavar="episode")
    add("empty-trash", _empty_trash, "remove what is in the trash for good")


def _add_data_set_commands(add: AddCommand) -> None:
    command = add("merge", _merge, "add the episodes of other data sets with the same setup")
    command.add_argument("others", nargs="+", type=Path, metavar="OTHER")
    command = add("split", _split, "deal the episodes out to new data sets DATA_SET_NAME beside it")
    command.add_argument(
        "parts", nargs="+", type=_part, metavar="NAME=SHARE", help="as in train=0.8 val=0.2, or numbers"
    )
    command.add_argument("--seed", type=int, default=0, help="of the order in which they are dealt out (default 0)")
    command = add("stats", _stats, "count what the steps show, and draw it")
    command.add_argument("--out", type=Path, metavar="PNG", help="default: DATA_SET_statistics.png here")
    add("rebuild", _rebuild, "make the index anew from the bags")
    add("check", _check, "read everything once, and say what is amiss").add_argument(
        "episodes", nargs="*", metavar="episode"
    )


def _part(text: str) -> tuple[str, float]:
    name, _, share = text.partition("=")
    try:
        return name, float(share)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is not NAME=SHARE, as in train=0.8") from None


if __name__ == "__main__":
    sys.exit(main())
