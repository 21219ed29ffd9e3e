#!/usr/bin/env bash
# Build the wheel with the Python $1, install it in an empty environment, and identify a twin's log with it,
# outside the checkout: finds files missing from the wheel and dependencies missing from its list.
set -euo pipefail

python=$1
checkout=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
unset PYTHONPATH VIRTUAL_ENV NUMBA_CACHE_DIR
export XDG_CACHE_HOME="$place/cache" PIP_DISABLE_PIP_VERSION_CHECK=1

"$python" -m build --wheel --outdir "$place/dist" "$checkout" > "$place/build.log" 2>&1 || {
    cat "$place/build.log" >&2
    exit 1
}
# without a pip of its own and without bytecode of modules that nobody imports, which take as long as the rest
"$python" -m venv --without-pip "$place/env"
"$python" -m pip --python "$place/env/bin/python" install -qq --no-compile "$place"/dist/swingid-*.whl
export PATH="$place/env/bin:$PATH"

mkdir "$place/work"
cd "$place/work"
swingid init lab
swingid simulate --rig paper --reference "sine 0.8 rad 8.5 rad/s" --duration 25 --rate 1000 --out run.parquet \
    2> simulate.err
swingid identify run.parquet --rig paper --json result.json --report report.html > summary.txt 2> identify.err
swingid identify run.parquet --rig paper --json - > again.json 2>> identify.err
swingid simulate --rig paper --reference "sine 0.8 rad 8.5 rad/s" --duration 1 --rate 1000 --out again.parquet \
    2> again.err
grep -q "compiling kernels" simulate.err
if grep "compiling kernels" identify.err again.err; then
    echo "identify, or the second simulate, compiles kernels" >&2
    exit 1
fi
python - "$checkout" << 'END'
import json
import pathlib
import sys

import swingid

home = pathlib.Path(swingid.__file__).resolve()
assert not home.is_relative_to(pathlib.Path(sys.argv[1]) / "src"), f"{home} is the checkout, not the wheel"
result = json.loads(pathlib.Path("result.json").read_text(encoding="utf-8"))
inertia = result["parameters"]["inertia"]
assert result["status"] in ("ok", "warning"), result
assert abs(inertia["value"] / 302.2e-5 - 1) < 2e-4, inertia
assert inertia["standard_uncertainty"] > 0, inertia
swingid.Rig.load("lab/rig.toml")
again = json.loads(pathlib.Path("again.json").read_text(encoding="utf-8"))["parameters"]
assert list(again) == list(result["parameters"])
for name, found in result["parameters"].items():
    # sums in vector registers and BLAS depend on where arrays lie in memory, so the last digits may differ
    spread = found["standard_uncertainty"] or abs(found["value"])
    assert abs(again[name]["value"] - found["value"]) <= 1e-3 * spread, (name, found, again[name])
assert pathlib.Path("report.html").stat().st_size > 10_000
print(f"the wheel {home.parent.name} {swingid.__version__} finds {inertia['value']:.6g} kg m^2 of 0.003022")
END
