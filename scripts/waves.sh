#!/usr/bin/env bash
# Simulates one unit with traces and says how to look at them: FST, or VCD where the headers for FST
# are missing; WAVES_FORMAT=vcd or fst chooses. Usage: scripts/waves.sh UNIT, from the root of the
# repository, with the Python environment on PATH.
set -euo pipefail

unit=$1
format=${WAVES_FORMAT:-}
if [[ -z $format ]]; then
  format=$(python -c 'from flicker.toolchain import trace_format as f; print(f())')
  if [[ $format == vcd ]]; then
    missing=$(python -c 'from flicker.toolchain import missing_fst_packages as m; print(*m())')
    echo "waves: VCD traces, larger and slower than FST, whose headers are missing (Debian: $missing)"
  fi
fi

rm -rf "build/waves/$unit"
status=0
WAVES=1 WAVES_FORMAT=$format python -m pytest -m sim --unit "$unit" tb || status=$?

shopt -s nullglob
traces=("build/waves/$unit"/*/*."$format")
if ((${#traces[@]})); then
  printf '\nOpen a trace with its signal view (saved in tb/waves, fitted to the trace):\n'
  for trace in "${traces[@]}"; do
    echo "  gtkwave $trace ${trace%.*}.gtkw"
  done
fi
exit "$status"
