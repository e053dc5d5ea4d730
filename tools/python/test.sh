#!/usr/bin/env bash
# Tries the wheel of dist/ in a fresh virtual environment in which no Rust can be found: its own tests,
# README's example, every example of examples/python, and most tests of tests/ on the program it brings.
set -euo pipefail
cd "$(dirname "$0")/../.."

folder=$1
environment=$folder/environment
rm -rf "$folder"
mkdir -p "$folder"
"${PYTHON:-python3}" -m venv "$environment"
wheel=$(ls -t dist/ftc_fmu-*manylinux*x86_64.whl | head -1)
"$environment/bin/pip" install --quiet --disable-pip-version-check "${wheel}[all]" --constraint tests/requirements.txt \
    --constraint tools/python/tests/requirements.txt --requirement tests/requirements.txt
# For the FMUs it holds, made by OpenModelica; what it depends on is not needed.
"$environment/bin/pip" install --quiet --disable-pip-version-check --no-deps gemseo-fmu==3.1.1

# No cargo, no rustc: what is tested is what a user has.
PATH=$PWD/$environment/bin:/usr/local/bin:/usr/bin:/bin
unset PYTHONPATH
for program in cargo rustc; do
    if command -v "$program"; then
        echo "$program can be found: the test would prove nothing" >&2
        exit 1
    fi
done

python -m pytest -c tools/python/pytest.ini --rootdir tools/python tools/python/tests
python -P tools/python/readme.py README.md "$folder/readme"
for example in quadruple_tank dc_motor boost_converter; do
    python "examples/python/$example.py" --out "$folder/$example" --runs 100
done
python examples/python/from_a_log.py --out "$folder/from_a_log"
# Proofs and optima, checked at length on another build of the same sources, are left out.
FTC_FMU=$PWD/$environment/bin/ftc-fmu python -m pytest --numprocesses auto --dist worksteal tests \
    --ignore tests/cvxpy --ignore tests/reference/test_exact_proof.py --ignore tests/reference/test_running_loop.py
