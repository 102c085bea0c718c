# One machine needs only Python 3.11 or newer, pip, make and gcc; all else is installed into .venv.

PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
JOBS   := $(wildcard jobs/*.toml)
READY  := $(VENV)/.installed

.PHONY: demo test check bench firmware flash clean help

help:
	@echo "make demo      install into $(VENV), build and prove every job under jobs/, print one table"
	@echo "make test      the tests"
	@echo "make check     format, lint, types and the tests, which also make firmware/ anew"
	@echo "make firmware  make firmware/ anew, or one job of it: JOBS=jobs/lab8-exercise.toml"
	@echo "make bench     measure speeds and print ratios"
	@echo "make flash     build JOB=lab8-exercise, prove it and program a chip: [PROGRAMMER=picpro] [PORT=/dev/ttyUSB0]"
	@echo "make clean     remove what was made"

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "servogen needs Python 3.11 or newer: make PYTHON=python3.11 ..."; exit 3; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev,plot,urdf,flash,dask]'
	@touch $@

demo: $(READY)
	$(BIN)/servogen demo $(JOBS) --output build

test: $(READY)
	$(BIN)/pytest

check: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/pytest

firmware: $(READY)
	$(BIN)/servogen demo $(JOBS) --output firmware
	$(BIN)/python tools/firmware_checksums.py firmware $(basename $(notdir $(JOBS)))

bench: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[benchmarks]'
	$(BIN)/python benchmarks/simulator.py
	$(BIN)/python benchmarks/kinematics.py

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
