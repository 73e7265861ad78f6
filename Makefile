# Everything a fresh machine needs: a Python in the supported range and make. Nothing else is installed by hand.
SHELL := /bin/sh
.DEFAULT_GOAL := help
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: help install test lint demo bench foreign browser fuzz campaign challenge clean

help:            ## list the targets
	@grep -E '^[a-z-]+: .*##' $(MAKEFILE_LIST) | sed -E 's/:.*##/\t/'

install: $(STAMP) ## virtual environment in the checkout, locked versions

$(STAMP): requirements.lock pyproject.toml
	@sh .ci/make-venv $(VENV)
	@touch $(STAMP)

test: $(STAMP)   ## the whole test suite, one process a core
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist loadgroup

lint: $(STAMP)   ## formatter, linter, strict types, import directions
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

demo: $(STAMP)   ## the whole story on the simulated bench, with an effect nobody declared
	$(BIN)/rig demo

bench: $(STAMP)  ## benchmarks, as ratios
	$(BIN)/python -m tests.benchmarks

foreign: $(STAMP) ## other people's CANopen stacks against ours (installs durand here, npm canopen if there is Node.js)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation -e '.[foreign]'
	@if command -v npm >/dev/null 2>&1; then \
		cd tests/foreign && npm install --ignore-scripts --no-package-lock --no-fund --no-audit --loglevel=error; \
	else \
		echo "no npm on this machine: the tests against the npm package canopen are skipped"; \
	fi
	$(BIN)/python -m pytest tests/foreign

browser: $(STAMP) ## reports in a headless Chromium (installs Debian's where there is none and this is root)
	@sh .ci/get-browser
	BROWSER_REQUIRED=1 $(BIN)/python -m pytest tests/browser

SECONDS := 120
fuzz: $(STAMP)   ## property tests with new random examples for 2 minutes (SECONDS=...)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.fuzz $(SECONDS)

campaign: $(STAMP) ## every row of "What a campaign establishes" in docs/effects.md against the loop, and other long tests (half an hour)
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 -m campaign tests/rig

CHALLENGE := runs/challenge
challenge: $(STAMP) ## blind test: hidden effects, naming, errors, intervals (two hours; SMALL=1, SCALE=n, DEV=1, SEEDS=A:B)
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m tests.challenge --workers 2 -o $(CHALLENGE) \
		$(if $(SMALL),--small) $(if $(SCALE),--scale $(SCALE)) $(if $(DEV),--dev) $(if $(SEEDS),--seeds $(SEEDS))

clean:           ## remove the virtual environment and caches
	rm -rf tests/foreign/node_modules $(VENV) .pytest_cache .mypy_cache .ruff_cache build *.egg-info
