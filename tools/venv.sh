#!/usr/bin/env bash
# Make or update the virtual environment in folder $1, with the package (editable) and, if given, its extra $2.
# Takes $PYTHON if set, else the first Python >= 3.11 that it finds.
set -euo pipefail

folder=$1
extra=${2:-}

new_enough() {
    "$1" -c 'import sys; sys.exit(sys.version_info < (3, 11))' > /dev/null 2>&1
}

find_python() {
    local candidate
    for candidate in ${PYTHON:-} python3 python3.13 python3.12 python3.11 python3.14 python; do
        if command -v "$candidate" > /dev/null 2>&1 && new_enough "$candidate"; then
            command -v "$candidate"
            return
        fi
    done
    echo "swingid needs Python 3.11 or newer and found none on PATH" \
        "(python3 is $(python3 --version 2>&1 || echo missing)); install one, or run: make PYTHON=/path/to/python" >&2
    return 1
}

if [ ! -x "$folder/bin/python" ] || ! new_enough "$folder/bin/python"; then
    python=$(find_python)
    echo "== setting up $folder with $("$python" --version)"
    if ! "$python" -m venv --clear "$folder"; then
        echo "$python cannot make virtual environments; on Debian and Ubuntu install the package python3-venv" >&2
        exit 1
    fi
fi
echo "== installing the package${extra:+ and its extra $extra} into $folder (the first time takes a minute)"
"$folder/bin/python" -m pip install -qq --disable-pip-version-check --editable ".${extra:+[$extra]}"
