#!/usr/bin/env bash
# Simulates one unit with FST traces and says how to look at them. Usage: scripts/waves.sh UNIT,
# from the root of the repository, with the Python environment on PATH.
set -euo pipefail

unit=$1
missing=$(python -c 'from flicker.toolchain import missing_fst_packages as m; print(*m())')
if [[ -n $missing ]]; then
  echo "waves: FST traces need the headers of Debian's $missing: please install" >&2
  exit 1
fi

rm -rf "build/waves/$unit"
status=0
WAVES=1 python -m pytest -m sim --unit "$unit" tb || status=$?

shopt -s nullglob
traces=("build/waves/$unit"/*/*.fst)
if ((${#traces[@]})); then
  printf '\nOpen a trace with its signal view (saved in tb/waves, fitted to the trace):\n'
  for trace in "${traces[@]}"; do
    echo "  gtkwave $trace ${trace%.fst}.gtkw"
  done
fi
exit "$status"
