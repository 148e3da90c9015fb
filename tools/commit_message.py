"""Check messages of commits: a subject `area: what`, and a body that says why.

    python -m tools.commit_message FILE   # one message, with what is staged: the hook in .pre-commit-config.yaml
    python -m tools.commit_message        # all commits since the one that added this file: .ci/run

A change of at most `SMALL` lines needs no body. In a shallow clone, or without git, the commits are not there: the
second form says so and passes.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MAX_SUBJECT = 72  # characters, which git's own lists show whole
SMALL = 10  # lines added and removed, up to which a subject says enough
SUBJECT = re.compile(r'[a-z][\w./+-]*(, [\w./+-]+)*: \S.*|Revert ".*"')
UNFINISHED = ("fixup! ", "squash! ", "amend! ")  # git joins them with another commit before they are shown to anyone
SCISSORS = "# ------------------------ >8 ------------------------"


def problems(message: str, lines: int) -> list[str]:
    """Return what is wrong with a message.

    Args:
        message: the whole message.
        lines: how many lines the commit adds and removes.

    Returns:
        One sentence for each mistake; none for a good message.
    """
    subject, _, rest = message.strip().partition("\n")
    found = []
    if not SUBJECT.fullmatch(subject):
        found.append(f"the subject {subject!r} must be 'area: what', such as 'trainers: registry of algorithms'")
    if len(subject) > MAX_SUBJECT:
        found.append(f"the subject has {len(subject)} characters, and at most {MAX_SUBJECT} are shown: {subject!r}")
    if rest and rest.partition("\n")[0].strip():
        found.append(f"an empty line must follow the subject {subject!r}")
    if lines > SMALL and not rest.strip():
        found.append(f"{subject!r} changes {lines} lines: a body of at least one line must say why")
    return found


def written(text: str) -> str:
    """Return the message in the file that git passes to its hook, without comments and the diff below them."""
    kept = text.partition(SCISSORS)[0].splitlines()
    return "\n".join(line for line in kept if not line.startswith("#")).strip()


def changed_lines(numstat: str) -> int:
    """Return the lines added and removed of `git ... --numstat`. A binary file counts as none."""
    rows = [line.split("\t") for line in numstat.splitlines() if line.count("\t") == 2]
    return sum(int(count) for row in rows for count in row[:2] if count.isdigit())


def check_commits(root: Path) -> tuple[list[str], str]:
    """Check the commits since the one that added this file, in the repository at `root`. Merges are left out.

    Returns:
        The mistakes, each with its commit; and what was checked, or why nothing could be.
    """
    try:
        if Path(_git(root, "rev-parse", "--show-toplevel").strip()).resolve() != root.resolve():
            return [], f"{root} is no repository of its own: no commits are checked"
        shallow = _git(root, "rev-parse", "--is-shallow-repository").strip() == "true"
    except (OSError, subprocess.CalledProcessError):
        return [], f"{root} is no git repository: no commits are checked"
    if shallow:
        return [], "this clone is shallow: no commits are checked; git fetch --unshallow brings them"
    added = _git(root, "log", "--diff-filter=A", "--format=%H", "--", "tools/commit_message.py").split()
    if not added:
        return [], "tools/commit_message.py is not committed yet: no commits are checked"
    commits = [added[-1], *_git(root, "rev-list", "--no-merges", f"{added[-1]}..HEAD").split()]
    found = []
    for commit in commits:
        message = _git(root, "log", "-1", "--format=%B", commit)
        lines = changed_lines(_git(root, "show", "--numstat", "--format=", commit))
        found += [f"{commit[:9]}: {problem}" for problem in problems(message, lines)]
    return found, f"{len(commits)} commit messages are checked"


def _git(root: Path, *words: str) -> str:
    done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True, encoding="utf-8")
    return done.stdout


def main(arguments: Sequence[str]) -> int:
    """Check the message in a file, or the commits. Print the mistakes, and return the exit code."""
    if arguments:
        message = written(Path(arguments[0]).read_text(encoding="utf-8"))
        staged = changed_lines(_git(Path.cwd(), "diff", "--cached", "--numstat"))
        found = [] if message.startswith(UNFINISHED) else problems(message, staged)
    else:
        found, about = check_commits(ROOT)
        print(about)
    for problem in found:
        print(f"error: {problem}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
