# A machine needs Python 3.11 or newer, pip, make and gcc, and git for the tests; all else is installed into .venv.

PYTHON ?= python3
VENV   ?= .venv
# The versions that were tested. CONSTRAINTS= installs the newest that pyproject.toml allows.
CONSTRAINTS ?= constraints.txt
EXTRAS := dev,testing,plot,symbolic,urdf,ros,flash,twin,dask,solver,watch
PIP_INSTALL = -m pip install --quiet --disable-pip-version-check $(addprefix -c ,$(CONSTRAINTS))
BIN    := $(VENV)/bin
JOBS   := $(wildcard jobs/*.toml)
READY  := $(VENV)/.installed

# Where compiled modules may not be kept, each of the hundreds of commands that the tests start compiles all of them.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-changed campaigns check docs docs-tools prove bench firmware constraints flash clean help

help:
	@echo "make demo      install into $(VENV), build every job under jobs/, print one table: exact, and proven"
	@echo "make test      the tests of a change, which also rebuild half of firmware/"
	@echo "make test-changed  of these only the ones that import what changed, the nearest first, up to a failure"
	@echo "make campaigns the long tests: random robots and programs, hostile builds, clean clones, locales, clusters"
	@echo "make check     format, lint, types and all tests"
	@echo "make docs      make the documentation site, build/site, and fail at any warning"
	@echo "make firmware  rebuild firmware/, or one job of it: JOBS=jobs/lab8-exercise.toml"
	@echo "make prove     prove the programs of firmware/ for all inputs, and check each certificate: JOBS=jobs/…"
	@echo "make certificates  the same, and keep the certificates in certificates/: after make firmware"
	@echo "make bench     measure speeds and print ratios"
	@echo "make constraints  write constraints.txt: the newest versions that pyproject.toml allows; then make check"
	@echo "make flash     build JOB=lab8-exercise, compare its edges and program a chip: [PROGRAMMER=picpro] [PORT=/dev/ttyUSB0]"
	@echo "make clean     remove what was made"

# What changes the parts in C compiles them again.
IN_C := $(wildcard servogen/*/*.[ch] servogen/*/*/*.[ch]) servogen/native.py \
  $(addprefix servogen/,simulator/layout.py simulator/slots.py simulator/words.py checker/layout.py pic/device.py pic/isa.py)

$(READY): pyproject.toml hatch_build.py $(CONSTRAINTS) $(IN_C)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "servogen needs Python 3.11 or newer: make PYTHON=python3.11 ..."; exit 3; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python $(PIP_INSTALL) -e '.[$(EXTRAS)]'
	@touch $@

demo: $(READY)
	$(BIN)/servogen demo $(JOBS) --output build --certificates certificates

test: $(READY)
	$(BIN)/pytest -m "not campaign"

test-changed: $(READY)
	$(BIN)/python tools/changed_tests.py

campaigns: $(READY)
	$(BIN)/pytest -m campaign

# While one core checks the types, another compiles the tests: otherwise each worker of pytest compiles all of them.
check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pytest --collect-only -n0 >/dev/null & $(BIN)/mypy; status=$$?; wait; exit $$status
	$(BIN)/pytest

docs-tools: $(READY)
	$(BIN)/python $(PIP_INSTALL) -e '.[docs]'

docs: docs-tools
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

firmware: $(READY)
	$(BIN)/servogen demo $(JOBS) --output firmware
	$(BIN)/python tools/firmware_checksums.py firmware $(basename $(notdir $(JOBS)))

prove: $(READY)
	$(BIN)/servogen demo $(JOBS) --output build --certificates build/certificates --prove

certificates: $(READY)
	$(BIN)/servogen demo $(JOBS) --output build --certificates certificates --prove

# A fresh environment outside $(VENV), so that nothing of an earlier one is written down.
constraints: CONSTRAINTS =
constraints:
	rm -rf build/constraints
	$(PYTHON) -m venv build/constraints
	build/constraints/bin/python $(PIP_INSTALL) -e '.[$(EXTRAS),benchmarks,docs]'
	build/constraints/bin/python tools/constraints.py > build/constraints.txt
	mv build/constraints.txt constraints.txt
	rm -rf build/constraints

bench: $(READY)
	$(BIN)/python $(PIP_INSTALL) -e '.[benchmarks]'
	$(BIN)/python benchmarks/simulator.py
	$(BIN)/python benchmarks/kinematics.py
	$(BIN)/python benchmarks/twin.py

# JOB is a job file, or the name of one under jobs/.
JOBFILE = $(if $(wildcard $(JOB)),$(JOB),jobs/$(JOB).toml)
MADE    = build/$(basename $(notdir $(JOBFILE)))

flash: $(READY)
	@test -n "$(JOB)" || { echo "make flash JOB=lab8-exercise [PROGRAMMER=picpro] [PORT=/dev/ttyUSB0]"; exit 2; }
	$(BIN)/servogen build $(JOBFILE) --output $(MADE)
	$(BIN)/servogen flash $(MADE)/main.hex $(if $(PROGRAMMER),--programmer $(PROGRAMMER)) \
	  $(if $(PORT),--port $(PORT)) $(if $(DEVICE),--device $(DEVICE))

clean:
	rm -rf build .pytest_cache .mypy_cache .ruff_cache .hypothesis
