#!/bin/sh
# Make the environment .venv and install rtcomp into it, editable.
#   tools/setup.sh run    what running it needs
#   tools/setup.sh dev    that, every optional format, and the tools of tests and checks
# PYTHON chooses the interpreter; else the first of the usual names that is Python 3.11 or newer and can make
# environments. Trying each is the only way to know: version managers leave names behind that do not run.
set -eu
cd "$(dirname "$0")/.."
kind=${1:-dev}
venv=.venv

fit() { "$1" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; }

choose() {
    if [ -n "${PYTHON:-}" ]; then
        fit "$PYTHON" && { echo "$PYTHON"; return; }
        echo "setup: PYTHON=$PYTHON is not a Python 3.11 or newer that can make environments" >&2
        exit 1
    fi
    for name in python3.11 python3.12 python3.13 python3 python3.14 python; do
        fit "$name" && { echo "$name"; return; }
    done
    for name in python3.11 python3.12 python3.13 python3; do
        if "$name" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
            echo "setup: $name lacks the module venv; on Debian and Ubuntu: apt install python3-venv" >&2
            exit 1
        fi
    done
    found=$(python3 -V 2>/dev/null || echo none)
    echo "setup: no Python 3.11 or newer (python3: $found); install one, or name it: make PYTHON=/its/path" >&2
    exit 1
}

if ! "$venv/bin/python" -m pip --version >/dev/null 2>&1; then
    python=$(choose)
    echo "setup: making $venv with $("$python" -V) ..."
    "$python" -m venv --clear "$venv"
fi
case $kind in
    run) what=. ;;
    dev) what='.[dev,parquet,mcap]' ;;
    *) echo "setup: '$kind' is neither run nor dev" >&2; exit 1 ;;
esac
echo "setup: installing what rtcomp needs into $venv (once; a minute or two) ..."
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-input -e "$what"
touch "$venv/.ready-$kind"
