#!/usr/bin/env bash
# Checks the tools that must come with the machine and installs the rest into a virtual
# environment. Usage: scripts/setup.sh FOLDER, from the root of the repository.
set -euo pipefail

venv=$1
python=${PYTHON:-python3}

fail() {
  echo "setup: $*" >&2
  exit 1
}

missing=()
if ! command -v "$python" > /dev/null; then
  missing+=("$python >= 3.11")
elif ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
  missing+=("Python >= 3.11 (this one is $("$python" --version))")
elif ! "$python" -c 'import venv, ensurepip' 2> /dev/null; then
  missing+=("the venv module of $python (Debian: python3-venv)")
fi
for tool in g++ make perl; do
  command -v "$tool" > /dev/null || missing+=("$tool")
done
if ((${#missing[@]})); then
  printf -v list '%s, ' "${missing[@]}"
  fail "please install: ${list%, }"
fi
case $PWD in
  *[[:space:]]*) fail "Verilator cannot build in a path with spaces: $PWD" ;;
esac

echo "setup: installing into $venv (a few minutes the first time)"
[[ -x $venv/bin/python ]] || "$python" -m venv "$venv"
pip=("$venv/bin/python" -m pip --disable-pip-version-check install --quiet --progress-bar off)
"${pip[@]}" -r requirements.lock || fail "could not install the packages of requirements.lock"
"${pip[@]}" --no-deps --no-build-isolation --editable . || fail "could not install the flicker package"
echo "setup: done"
