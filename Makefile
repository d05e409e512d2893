# FLICKER: `make` lists the targets. Every target first brings the Python environment up to date.

PYTHON ?= python3
VENV   := .venv
STAMP  := $(VENV)/.installed
SOC    := $(VENV)/.installed-soc
NEXTPNR := $(VENV)/.installed-route
BIN    := $(VENV)/bin
JOBS   ?= 2
UNIT   ?=
PART   ?=
CONFIG ?=
NETLIST ?=
SLOW   ?=
FRESH  ?=
BASE   ?=
REASON ?=
LIBERTY ?=
CHIP   ?= tiny
KEYS   ?=
ROUTE  ?=

# What make itself was told must not reach the makes that the builds start.
unexport MAKEFLAGS MFLAGS

.DEFAULT_GOAL := help
.PHONY: help setup demo generate test check record sim lint waves mutants synth fpga formal soc report docs site clean FORCE

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /\1\t/p' Makefile | while IFS="$$(printf '\t')" read -r name text; \
	  do printf '  make %-8s %s\n' "$$name" "$$text"; done
	@echo
	@echo '  UNIT=name chooses a unit (tb/**/test_name.py), FLICKER_SEED=n the seed of the tests,'
	@echo '  JOBS=n the number of parallel tests, PYTHON=path the interpreter for setup.'

setup: $(STAMP) ## check the tools of the machine, create .venv with everything else

# The stamp says for which folder the environment was set up: a copied or moved checkout sets it up again.
$(STAMP): requirements.lock pyproject.toml scripts/setup.sh $(if $(filter $(CURDIR),$(shell cat $(STAMP) 2> /dev/null)),,FORCE)
	@PYTHON="$(PYTHON)" scripts/setup.sh "$(VENV)"
	@echo '$(CURDIR)' > $@

FORCE:

demo: $(STAMP) ## make the demo scene and render it through the RTL
	@$(BIN)/flicker demo

generate: $(STAMP) ## write the generated sources (registers, packages, mask generators, file lists) and the block diagrams of the pages
	@$(BIN)/python scripts/gen_counters.py
	@$(BIN)/python scripts/gen_registers.py
	@$(BIN)/python scripts/gen_params.py
	@$(BIN)/python scripts/gen_manifests.py
	@$(BIN)/python scripts/gen_figures.py

test: $(STAMP) $(if $(shell sh -c 'command -v riscv64-unknown-elf-gcc'),$(SOC)) lint ## lint, all tests, the fast proofs; SLOW=1: also those that take long; FRESH=1: also those that passed on the same inputs
	@SLOW="$(SLOW)" FRESH="$(FRESH)" $(BIN)/python -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder --cached tb
	@$(BIN)/python scripts/formal.py --fast --jobs $(JOBS)

check: $(STAMP) ## lint and tests of what an edit changes, two minutes; against another commit: make check BASE=main
	@$(BIN)/python scripts/check.py --jobs $(JOBS) --base $(or $(BASE),HEAD)

record: $(STAMP) ## figures that a change has moved, with the reason: make record REASON="sorts in half the time"
	@$(if $(strip $(REASON)),,echo 'record: say why figures move: make record REASON="..."'; exit 2;) \
	  FLICKER_SEED=1 FLICKER_RECORD="$(REASON)" $(BIN)/python -m pytest -q -n $(JOBS) tb/model/test_gates.py tb/frames/test_chip_frames.py \
	  -k "test_gates or what_holds_a_frame_up" && git diff --stat -- tb/figures.csv

sim: $(STAMP) ## simulations of all units, or of one, or of its netlist: make sim UNIT=prtu [NETLIST=1]
	@NETLIST="$(NETLIST)" $(BIN)/python -m pytest -n $(JOBS) -m sim $(if $(UNIT),--unit $(UNIT)) tb

lint: $(STAMP) ## Verilator on every module, Verible style, ruff, mypy, generated files, links of pages
	@$(BIN)/python scripts/lint.py

waves: $(STAMP) ## simulate a unit and keep its traces for GTKWave: make waves UNIT=stream_cells
	@$(if $(UNIT),,echo 'waves: name a unit, for example make waves UNIT=stream_cells'; exit 2;) \
	  PATH="$(abspath $(BIN)):$$PATH" scripts/waves.sh "$(UNIT)"

mutants: $(STAMP) ## every mutant of the hardware must die in its unit's tests; long: make mutants [UNIT=vru]
	@$(BIN)/python scripts/mutants.py --jobs $(JOBS) $(if $(UNIT),--unit $(UNIT))

synth: $(STAMP) ## area and timing of every unit: make synth [UNIT=prtu [CONFIG="conic fp8"]] [LIBERTY=path]
	@$(BIN)/python scripts/synth.py --jobs $(JOBS) $(if $(UNIT),--unit $(UNIT)) $(if $(CONFIG),--config "$(CONFIG)") $(if $(LIBERTY),--liberty "$(LIBERTY)")

fpga: $(if $(ROUTE),$(NEXTPNR),$(STAMP)) ## what a chip takes on an FPGA; ROUTE=1: its rendering stage placed and routed: make fpga [CHIP=tiny] [BOARD=kv260]
	@$(BIN)/python scripts/fpga.py --chip "$(CHIP)" $(if $(BOARD),--board "$(BOARD)") $(if $(ROUTE),--route)

$(NEXTPNR): $(STAMP) requirements.lock scripts/setup.sh
	@scripts/setup.sh "$(VENV)" route
	@touch $@

formal: $(STAMP) ## all proofs, with covers and mutants: make formal [UNIT=fifo]
	@$(BIN)/python scripts/formal.py --jobs $(JOBS) $(if $(UNIT),--unit $(UNIT))

soc: $(SOC) ## a processor boots and renders frames with the chip, simulated: make soc [CHIP=tiny] [KEYS=1]
	@$(BIN)/python soc/run.py --chip "$(CHIP)" $(if $(KEYS),--keys)

# LiteX and what comes with it: the lines of the lock file that name the extra.
$(SOC): $(STAMP) requirements.lock scripts/setup.sh
	@scripts/setup.sh "$(VENV)" soc
	@touch $@

report: $(STAMP) ## build/report/index.html: make report [SCENES="a.ply b.sog"]
	@$(BIN)/flicker report $(SCENES)

docs: $(STAMP) ## tables and charts of docs/: make docs [PART=areas]
	@$(BIN)/python scripts/docs.py $(PART)

site: $(STAMP) ## the pages as a site with search, strict: build/site/index.html
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo 'site: build/site/index.html'

clean: ## remove build results (not .venv)
	rm -rf build .pytest_cache
	find model tb scripts -name __pycache__ -type d -prune -exec rm -rf {} +
