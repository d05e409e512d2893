#!/usr/bin/env bash
# Checks the tools that must come with the machine and installs the rest into a virtual
# environment. Usage: scripts/setup.sh FOLDER [EXTRA], from the root of the repository. With the name
# of an extra it installs the lines of the lock file that are marked so, into an environment that is there.
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

# Without bytecode of all packages, half of the time: Python compiles what is imported.
pip=("$venv/bin/python" -m pip --disable-pip-version-check install --quiet --progress-bar off --no-compile)
if [[ -n ${2-} ]]; then
  echo "setup: installing the packages of the extra $2 into $venv"
  sed -n "s/ *; *extra == \"$2\"\$//p" requirements.lock > "$venv/extra-$2.txt"
  [[ -s $venv/extra-$2.txt ]] || fail "requirements.lock has no packages of an extra $2"
  "${pip[@]}" --no-deps -r "$venv/extra-$2.txt" || fail "could not install the packages of the extra $2"
  exit
fi

echo "setup: installing into $venv (a few minutes the first time)"
[[ -x $venv/bin/python ]] || "$python" -m venv "$venv"
# Scripts of a copied or moved environment name the old place.
"$venv/bin/python" - "$PWD/$venv" << 'END'
import pathlib, re, sys
here = pathlib.Path(sys.argv[1])
old = re.compile(rb"/[^\s'\":]*/" + re.escape(here.name.encode()) + rb"(?=['\"\s/])")
for path in (here / "bin").iterdir():
    text = b"\0" if path.is_symlink() else path.read_bytes()
    if b"\0" not in text and (new := old.sub(str(here).encode(), text)) != text:
        path.write_bytes(new)
END
"${pip[@]}" -r requirements.lock || fail "could not install the packages of requirements.lock"
"${pip[@]}" --no-deps --no-build-isolation --editable . || fail "could not install the flicker package"
# The package by a path relative to the environment: a copy of both finds its own, not the original's.
"$venv/bin/python" - << 'END'
import os, pathlib, sysconfig
site = pathlib.Path(sysconfig.get_path("purelib"))
for path in site.glob("__editable__.flicker-*.pth"):
    path.write_text("".join(os.path.relpath(line, site) + "\n" for line in path.read_text().split()))
END
echo "setup: done"
