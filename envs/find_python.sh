#!/usr/bin/env bash
# Print the path of the interpreter that `make` builds .venv with.
#   find_python.sh         Python 3.13, or else 3.11, or else a 3.13 that uv downloads
#   find_python.sh 3.11    that version, which uv downloads if it is missing
#   find_python.sh PYTHON  that interpreter
# An interpreter must run to count: a version manager's shim may exist, but not work.
set -euo pipefail
cd "$(dirname "$0")/.."

# runs PYTHON VERSION: succeed if the interpreter runs and has that version.
runs() {
    [[ $("$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) == "$2" ]]
}

# find_version VERSION: print the first interpreter of that version that runs, on the PATH or in pyenv.
find_version() {
    local python
    while read -r python; do
        # Skip the environments, which are about to be replaced.
        if [[ $python != "$PWD"/.venv* ]] && runs "$python" "$1"; then
            echo "$python"
            return
        fi
    done < <(
        type -aP "python$1" python3 || true
        compgen -G "${PYENV_ROOT:-$HOME/.pyenv}/versions/$1.*/bin/python3"
    )
    return 1
}

find_any() {
    find_version 3.13 || find_version 3.11
}

# download VERSION: download a Python into .python with uv, and print its path. Install uv if needed.
download() {
    local uv=uv
    if ! uv --version >/dev/null 2>&1; then
        uv=.python/uv/bin/uv
        python3 -m venv .python/uv && .python/uv/bin/pip install --quiet --disable-pip-version-check \
            --require-hashes -r envs/requirements-uv.txt || return
    fi
    UV_PYTHON_INSTALL_DIR=$PWD/.python "$uv" python install --quiet "$1" &&
        UV_PYTHON_INSTALL_DIR=$PWD/.python "$uv" python find --managed-python "$1"
}

if [[ ${1-} == 3.13 || ${1-} == 3.11 ]]; then
    find_version "$1" && exit
    echo "Python $1 does not run here: downloading $1 with uv" >&2
    download "$1" 2>/dev/null || {
        echo "error: no Python $1 runs here, and none could be downloaded; install it, as with pyenv" >&2
        exit 1
    }
    exit
fi

if [[ $# -gt 0 ]]; then
    runs "$1" 3.13 || runs "$1" 3.11 || {
        echo "error: PYTHON is $1, which is not Python 3.13 or 3.11, or does not run" >&2
        exit 1
    }
    echo "$1"
    exit
fi

find_any && exit
# A bare container may have no Python, or one that cannot make environments.
if ! python3 -c 'import ensurepip' >/dev/null 2>&1 && [[ $(id -u) == 0 ]] && type -P apt-get >/dev/null; then
    { apt-get -qq update && apt-get -qq install --yes python3 python3-venv; } >&2
    find_any && exit
fi
echo "neither Python 3.13 nor 3.11 runs here: downloading 3.13 with uv" >&2
download 3.13 2>/dev/null || {
    echo "error: no Python 3.13 or 3.11 runs here, and none could be downloaded; on Debian or Ubuntu:" \
        "sudo apt-get install python3 python3-venv; or name one: make PYTHON=/path/to/python3.13" >&2
    exit 1
}
