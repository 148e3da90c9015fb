#!/usr/bin/env bash
# Runs README's two lines in a fresh environment on each given version of Python:
#
#     tools/try_pythons.sh 3.12 3.13                  # the default training, then the whole suite
#     tools/try_pythons.sh 3.12 -- -m "not slow"      # options of pytest after --
#
# Each version is looked for as pythonX.Y, then among those of pyenv. Exits with 1 if anything fails.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

versions=()
while (($#)) && [[ $1 != -- ]]; do versions+=("$1") && shift; done
(($#)) && shift
((${#versions[@]})) || { echo "error: which versions of Python? For example: tools/try_pythons.sh 3.12 3.13" >&2; exit 1; }

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

python_of() {
    local found
    for found in "$(command -v "python$1")" "${PYENV_ROOT:-$HOME/.pyenv}/versions/$1".*/bin/python; do
        if [[ -x $found ]] && "$found" -c "import sys; sys.exit(sys.version_info[:2] != tuple(map(int, '$1'.split('.'))))" 2>/dev/null; then
            echo "$found"
            return
        fi
    done
    echo "error: there is no Python $1 here" >&2
    return 1
}

try() {
    local venv="$scratch/$1" version=$1 python
    shift
    python=$(python_of "$version") || return 1
    "$python" -m venv "$venv" || return 1
    "$venv/bin/pip" install --quiet --no-compile -e ".[test]" || return 1
    "$venv/bin/python" train.py "hydra.run.dir=$scratch/run-$version" || return 1
    "$venv/bin/python" -m pytest "$@"
}

failed=()
for version in "${versions[@]}"; do
    echo "== Python $version"
    try "$version" "$@" || failed+=("$version")
done
((${#failed[@]} == 0)) || { echo "error: failed on Python ${failed[*]}" >&2; exit 1; }
