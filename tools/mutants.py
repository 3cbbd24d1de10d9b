"""Mutation testing of one package: what share of a sample of small bugs its tests notice (docs/testing.md).

cosmic-ray makes the mutants, in a copy of the working tree; of the package's tests only those that reach the mutated
line run, the quickest first. One run of all of them under coverage says which those are. An interrupted run goes on
where it stopped, as long as neither the package nor its tests have changed.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import random
import shlex
import shutil
import subprocess
from collections import Counter
from pathlib import Path
from typing import Any

from cosmic_ray.commands.init import init
from cosmic_ray.mutating import mutate_and_test
from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import MutationSpec, TestOutcome, WorkerOutcome, WorkItem, WorkResult
from mutant_operators import register
from mutant_tests import PYTEST, Tests

ROOT = Path(__file__).resolve().parent.parent


def copy_tree(tree: Path) -> None:
    """Copy what git would see, without history, so that a mutant never stands in the sources themselves."""
    shutil.rmtree(tree, ignore_errors=True)
    listed = subprocess.run(
        ["git", "ls-files", "-z", "-co", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    for name in listed.split("\0"):
        if name and (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)


def fingerprint(package: str, leave_out: list[str]) -> str:
    """Digest of the package's sources and tests, and of what is left out of them."""
    digest = hashlib.sha256(" ".join(sorted(leave_out)).encode())
    for path in sorted((Path("src") / package).rglob("*.py")):
        digest.update(str(path).encode() + path.read_bytes())
    return digest.hexdigest()


def never_computed(module: Path) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Begin and end (line, column) of the annotations: what is changed there changes nothing."""
    found: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.arg | ast.AnnAssign):
            found.append(node.annotation)
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            found.append(node.returns)
    return [((n.lineno, n.col_offset), (n.end_lineno or 0, n.end_col_offset or 0)) for n in found if n is not None]


def draw(package: str, sample: int, seed: int, database: WorkDB) -> None:
    """Fill the database with one mutant for each of `sample` places, drawn alike from all of the package's."""
    modules = sorted((Path("src") / package / package).rglob("*.py"))
    init(modules, database, {})
    unread = {module: never_computed(module) for module in modules}
    places: dict[tuple[str, tuple[int, int]], list[WorkItem]] = {}
    for item in database.work_items:
        spec = item.mutations[0]
        if not any(low <= spec.start_pos < high for low, high in unread[spec.module_path]):
            places.setdefault((str(spec.module_path), spec.start_pos), []).append(item)
    generator = random.Random(seed)
    chosen = generator.sample(sorted(places), min(sample, len(places)))
    order = [
        generator.choice(sorted(places[place], key=lambda i: (i.mutations[0].operator_name, i.mutations[0].occurrence)))
        for place in chosen
    ]
    database.clear()
    database.add_work_items(order)


def test(spec: MutationSpec, tests: list[str], limit: float, folder: Path) -> WorkResult:
    """Run tests on a mutant, for `limit` seconds at most."""
    (folder / "tests.txt").write_text("\n".join(tests))
    return mutate_and_test([spec], shlex.join([*PYTEST, "-x", f"@{folder / 'tests.txt'}"]), limit)


def outcome(result: WorkResult) -> str:
    """Return a word for a result: killed, timeout, survived, not reached, or incompetent (it could not be tried)."""
    output = result.output or ""
    if result.worker_outcome is WorkerOutcome.NO_TEST:
        return "not reached"
    if result.test_outcome is TestOutcome.KILLED:
        if "no tests ran" in output and " error" not in output:
            return "incompetent"
        return "timeout" if output == "timeout" else "killed"
    return str(result.test_outcome.value) if result.test_outcome else "incompetent"


def judge(item: WorkItem, tests: list[str], limit: float, database: WorkDB, folder: Path) -> dict[str, Any]:
    """Return the verdict on a mutant, of now or of the run that was interrupted."""
    spec, earlier = item.mutations[0], dict(database.results).get(item.job_id)
    if earlier is not None:
        result = earlier
    elif tests:
        result = test(spec, tests, limit, folder)
        database.set_result(item.job_id, result)
    else:
        result = WorkResult(WorkerOutcome.NO_TEST)
    return {
        "place": f"{spec.module_path}:{spec.start_pos[0]}",
        "definition": spec.definition_name,
        "operator": spec.operator_name.rpartition("/")[2],
        "outcome": outcome(result),
        "tests": len(tests),
        "diff": result.diff,
    }


def tell(found: list[dict[str, Any]], options: argparse.Namespace, path: Path) -> None:
    """Print the survivors and the share, and write all of it to a file."""
    for mutant in found:
        if mutant["outcome"] not in ("killed", "timeout"):
            print(f"\n{mutant['place']} in {mutant['definition']}: {mutant['outcome']} ({mutant['tests']} tests)")
            print("\n".join((mutant["diff"] or "").splitlines()[3:]))
    counts = Counter(mutant["outcome"] for mutant in found)
    judged = len(found) - counts["incompetent"]
    killed = counts["killed"] + counts["timeout"]
    share = round(100.0 * killed / judged, 1) if judged else None
    report = {"package": options.package, "sample": options.sample, "seed": options.seed, "budget_s": options.budget}
    report["left_out"] = options.leave_out
    path.write_text(
        json.dumps(report | {"outcomes": counts, "killed_percent": share, "mutants": found}, indent=1) + "\n"
    )
    print(f"\n{options.package}: {killed} of {judged} killed ({share} %), seed {options.seed}; all in {path}")


def main() -> None:
    """Test one package's sample and report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("package", choices=sorted(path.parent.name for path in ROOT.glob("src/*/setup.py")))
    parser.add_argument("--sample", type=int, default=30, help="places that are mutated")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    parser.add_argument("--budget", type=float, default=60.0, help="seconds of tests a mutant, as they take without it")
    parser.add_argument("--leave-out", nargs="+", default=[], metavar="FILE", help="test files that are not used")
    options = parser.parse_args()
    register()
    folder = ROOT / "out" / "mutants" / options.package
    copy_tree(folder / "tree")
    os.chdir(folder / "tree")
    own = str(Path("src", options.package).resolve())
    os.environ["PYTHONPATH"] = os.pathsep.join([own, os.environ.get("PYTHONPATH", "")])
    known, key = folder / "key", fingerprint(options.package, options.leave_out)
    if not known.exists() or known.read_text() != key:
        for name in ("baseline.txt", "coverage", "key", *(path.name for path in folder.glob("*.sqlite"))):
            (folder / name).unlink(missing_ok=True)
    tests = Tests(options.package, folder, options.leave_out)
    known.write_text(key)
    if tests.failing:
        print(f"left out, for they fail without any mutant: {', '.join(sorted(tests.failing))}")
    found = []
    with use_db(folder / f"{options.sample}-{options.seed}.sqlite", WorkDB.Mode.create) as database:
        if not database.num_work_items:
            draw(options.package, options.sample, options.seed, database)
        for number, item in enumerate(database.work_items, 1):
            chosen, limit = tests.reaching(item.mutations[0], options.budget)
            found.append(judge(item, chosen, limit, database, folder))
            print(f"{number:3d} {found[-1]['outcome']:12s}{found[-1]['place']}", flush=True)
    tell(found, options, folder / f"{options.sample}-{options.seed}.json")


if __name__ == "__main__":
    main()
